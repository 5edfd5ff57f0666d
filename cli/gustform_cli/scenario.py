"""The scenario: what a YAML file may say, as typed and frozen models.

The models know the fixed part of the format (run, output, events, wind, how components hang together); the
parameters of a component are checked against its declaration in `components.py`. `validate` reports every error it
finds, each with its place in the file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationError,
    WithJsonSchema,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from gustform.language.errors import GustformError
from gustform_cli.document import Document, NodePath, dotted
from gustform_cli.errors import did_you_mean
from gustform_cli.quantity import is_plain, parse_quantity

NAME_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*$"
QUANTITY_PATTERN = r"^\s*[+-]?[0-9.][0-9_.eE+-]*\s*\S.*$"


# ---- field types ----------------------------------------------------------------------------------------------------
def _refuse(code: str, message: str, hint: str = "") -> PydanticCustomError:
    """An error of ours inside a pydantic validator; `validate` puts path and place to it."""
    return PydanticCustomError(code, "{message}", {"message": message, "hint": hint})


def _check_name(value: object) -> object:
    if isinstance(value, str) and not re.match(NAME_PATTERN, value):
        raise _refuse(
            "GF2205",
            f" must be a name of letters, digits and _, not beginning with a digit; got {value!r}",
            re.sub(r"\W+", "_", value).strip("_") or "wt",
        )
    return value


def _check_many(value: object) -> object:
    if value == "turbines" or (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
        return value
    raise _refuse("GF2003", f" must be a whole number from 1 on, or the word turbines; got {_shown(value)}", "1")


def _quantity(
    unit: str, *, above: float = -math.inf, low: float = -math.inf, high: float = math.inf
) -> Callable[[object], float]:
    def convert(value: object) -> float:
        try:
            number = parse_quantity(value, unit, "")
        except GustformError as error:
            raise _refuse(error.code, error.message, error.hint) from None
        for wrong, bound in (
            (number <= above, f"greater than {above:g}"),
            (number < low, f"at least {low:g}"),
            (number > high, f"at most {high:g}"),
        ):
            if wrong:
                text = bound if is_plain(unit) else f"{bound} {unit}"
                raise _refuse("GF2003", f" must be {text}; got {value}", f"a value {text}")
        return number

    return convert


def _in(unit: str, example: str) -> dict[str, Any]:
    """JSON schema of a quantity, for editors."""
    if is_plain(unit):
        return {"anyOf": [{"type": "number"}, {"type": "string", "pattern": r"%\s*$"}], "examples": [example]}
    return {"type": "string", "pattern": QUANTITY_PATTERN, "examples": [example]}


Name = Annotated[StrictStr, BeforeValidator(_check_name), WithJsonSchema({"type": "string", "pattern": NAME_PATTERN})]
Moment = Annotated[float, BeforeValidator(_quantity("s", low=0.0)), WithJsonSchema(_in("s", "30 s"))]
Duration = Annotated[float, BeforeValidator(_quantity("s", above=0.0)), WithJsonSchema(_in("s", "20 ms"))]
Speed = Annotated[float, BeforeValidator(_quantity("m/s", low=0.5, high=100.0)), WithJsonSchema(_in("m/s", "8 m/s"))]
Length = Annotated[float, BeforeValidator(_quantity("m", above=0.0)), WithJsonSchema(_in("m", "90 m"))]
Tolerance = Annotated[float, BeforeValidator(_quantity("1", low=1e-12, high=1e-2)), WithJsonSchema(_in("1", "1e-6"))]
# A number of things, or the word that stands for the scenario's number of turbines.
Many = Annotated[
    int | Literal["turbines"],
    BeforeValidator(_check_many),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 1}, {"const": "turbines"}]}),
]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=False)


class ComponentEntry(BaseModel):
    """One component: its type, where it is connected, how many it stands for, and its parameters."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: StrictStr = Field(description="component type, as `gustform info` lists them")
    at: Name | None = Field(None, description="component its AC terminal is connected to")
    from_: Name | None = Field(None, alias="from", description="component its first terminal is connected to")
    to: Name | None = Field(None, description="component its second terminal is connected to")
    count: Many | None = Field(None, description="how many individual components: name[1], name[2], ...")
    aggregate: Many | None = Field(None, description="how many units this one stands for")


class ConstantWind(_Part):
    """Wind of one speed."""

    type: Literal["constant"]
    speed: Speed = Field(description="wind speed")


class TurbulentWindBlock(_Part):
    """IEC 61400-1 turbulence (Kaimal spectrum, normal turbulence model), made while running."""

    type: Literal["turbulence"]
    mean: Speed = Field(description="mean wind speed at hub height")
    class_: Literal["A", "B", "C"] = Field("B", alias="class", description="turbulence class of IEC 61400-1")
    seed: Annotated[StrictInt, Field(ge=0)] = Field(1, description="another seed, another wind of the same kind")
    hub_height: Length = Field(90.0, description="gives the length scale of the turbulence")
    every: Duration = Field(0.05, description="spacing of the samples")
    rotor_effective: StrictBool = Field(True, description="averaged over the rotor, as a turbine feels it")
    radius: Length | None = Field(None, description="rotor radius for the averaging; that of the turbine if left out")


class WindColumns(_Part):
    """Columns of a wind file by the names in its header."""

    time: StrictStr = Field("time", description="column of the times, counted from the start of the run")
    speed: StrictStr = Field("speed", description="column of the wind speeds")


class WindUnits(_Part):
    """Units the columns of a wind file are in."""

    time: StrictStr = Field("s", description="unit of the times")
    speed: StrictStr = Field("m/s", description="unit of the speeds")


class FileWind(_Part):
    """Rotor-effective wind from a CSV file whose first line names the columns."""

    type: Literal["file"]
    path: StrictStr = Field(description="the file, relative to the scenario")
    columns: WindColumns = Field(default_factory=lambda: WindColumns.model_validate({}))
    units: WindUnits = Field(default_factory=lambda: WindUnits.model_validate({}))
    on_end: Literal["error", "hold"] = Field("error", description="when the file ends before the run")


WindBlock = Annotated[ConstantWind | TurbulentWindBlock | FileWind, Field(discriminator="type")]


class Event(_Part):
    """Parameters that take new values at one moment."""

    at: Moment = Field(description="when")
    set: dict[StrictStr, Any] = Field(
        description="component.parameter: new value", min_length=1, json_schema_extra={"examples": [{"load.P": "1 MW"}]}
    )


class Run(_Part):
    """How long and how accurately."""

    until: Duration = Field(description="end of the simulated time")
    rtol: Tolerance = Field(1e-6, description="relative tolerance of the solver")
    atol: Tolerance | None = Field(
        None, description="absolute tolerance in nominal values of each unknown; a hundredth of rtol if left out"
    )
    limiters: Literal["pass", "locate"] = Field(
        "pass", description="pass over the bends of limiters under error control, or locate each and restart there"
    )
    max_step: Duration | None = Field(None, description="longest step of the solver")


class Output(_Part):
    """What is kept of a run."""

    every: Duration = Field(0.02, description="spacing of the rows in the result")
    channels: list[StrictStr] = Field(
        default_factory=lambda: ["*"], min_length=1, description="names with * and ?, e.g. wt.*"
    )


class Scenario(_Part):
    """A system, its wind, its events, and what to do with them."""

    name: StrictStr = Field(min_length=1, description="title, used in figures")
    description: StrictStr = Field("", description="free text")
    fidelity: Literal["lossless", "rms", "dq"] = Field(
        "rms",
        description="lossless: the paper's analysis model; rms: phasors; dq: filters, inner loops, stator",
    )
    turbines: Annotated[StrictInt, Field(ge=1, le=100_000)] | None = Field(
        None, description="number that `count: turbines` and `aggregate: turbines` refer to"
    )
    components: dict[Name, ComponentEntry] = Field(min_length=1, description="name: {type: ..., parameters}")
    connections: list[Annotated[list[StrictStr], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list, description="further connections, [component.port, component.port]"
    )
    frame: Name | None = Field(None, description="machine whose speed the phasors rotate with")
    wind: dict[Name, WindBlock] = Field(default_factory=dict, description="wind of each turbine")
    events: list[Event] = Field(default_factory=list, description="changes of parameters while running")
    run: Run
    output: Output = Field(default_factory=lambda: Output.model_validate({}))


# ---- validation with places -----------------------------------------------------------------------------------------
def validate(document: Document) -> tuple[Scenario | None, list[GustformError]]:
    """The scenario in a document, or None and all that is wrong with its fixed part."""
    try:
        plain = document.plain()
    except GustformError as error:
        return None, [error]
    try:
        return Scenario.model_validate(plain), []
    except ValidationError as error:
        return None, [_translate(document, plain, details) for details in error.errors(include_url=False)]


def _node_path(plain: Mapping[str, Any], loc: Iterable[str | int]) -> NodePath:
    """pydantic's location without what is not in the file: union tags and the marker of a mapping's key."""
    path: list[str | int] = []
    node: Any = plain
    steps = list(loc)
    for index, step in enumerate(steps):
        if isinstance(node, Mapping) and step in node:
            node = node[step]
        elif isinstance(node, list) and isinstance(step, int) and step < len(node):
            node = node[step]
        elif index < len(steps) - 1 or step == "[key]" or not isinstance(node, Mapping):
            continue
        path.append(step)
    return tuple(path)


def _model_at(loc: tuple[str | int, ...]) -> type[BaseModel] | None:
    """The model whose keys stand at a location of pydantic's."""
    kind: Any = Scenario
    for step in loc:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            fields = {field.alias or name: field.annotation for name, field in kind.model_fields.items()}
            kind = fields.get(str(step))
        elif get_origin(kind) in (list, dict):
            kind = get_args(kind)[-1]
        elif get_origin(kind) is Union or type(kind).__name__ == "UnionType":
            members = [member for member in get_args(kind) if isinstance(member, type)]
            kind = next((member for member in members if _tag_of(member) == step), None)
        if get_origin(kind) is Annotated:
            kind = get_args(kind)[0]
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


def _tag_of(model: type) -> object:
    if not issubclass(model, BaseModel) or "type" not in model.model_fields:
        return None
    return next(iter(get_args(model.model_fields["type"].annotation)), None)


_SHAPES = {
    "string_type": "text",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a mapping (key: value)",
    "model_type": "a mapping (key: value)",
    "model_attributes_type": "a mapping (key: value)",
    "float_type": "a number",
}


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _translate(document: Document, plain: Mapping[str, Any], details: ErrorDetails) -> GustformError:
    """One of pydantic's errors in our words."""
    kind, loc, context = details["type"], details["loc"], details.get("ctx", {})
    path = _node_path(plain, loc)
    name, got = dotted(path), _shown(details["input"])
    place = document.place(path)
    if kind.startswith("GF"):
        key = loc[-1:] == ("[key]",)
        return GustformError(
            kind,
            f"{f'the key {name}' if key else name}{context['message']}",
            hint=context["hint"],
            place=document.place(path, key=key),
        )
    if kind == "extra_forbidden":
        model = _model_at(loc[:-1])
        known = [field.alias or key for key, field in model.model_fields.items()] if model else []
        return GustformError(
            "GF2201",
            f"{name} must not be here: {dotted(path[:-1])} has no key {path[-1]!r}",
            hint=did_you_mean(str(path[-1]), known),
            place=document.place(path, key=True),
        )
    if kind == "missing":
        return GustformError(
            "GF2202", f"{name} must be given; it is missing", hint=f"adding {loc[-1]}: ...", place=document.place(path)
        )
    if kind == "union_tag_not_found":
        return GustformError(
            "GF2202",
            f"{name}.type must be given; it is missing"
            if isinstance(details["input"], dict)
            else f"{name} must be a mapping with a type; got {got}",
            hint="{type: constant, speed: 8 m/s}",
            place=place,
        )
    if kind == "union_tag_invalid":
        known = str(context["expected_tags"]).replace("'", "").split(", ")
        return GustformError(
            "GF2204",
            f"{name}.type must be {' or '.join(known)}; got {context['tag']!r}",
            hint=did_you_mean(str(context["tag"]), known),
            place=document.place((*path, "type")),
        )
    if kind == "literal_error":
        expected = str(context["expected"]).replace("'", "")
        return GustformError("GF2204", f"{name} must be {expected}; got {got}", hint=expected, place=place)
    if kind in _SHAPES:
        return GustformError(
            "GF2203", f"{name} must be {_SHAPES[kind]}; got {got}", hint=f"writing {_SHAPES[kind]}", place=place
        )
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        least = "at least" if kind == "too_short" else "at most"
        return GustformError(
            "GF2003",
            f"{name} must have {least} {wanted} entries; it has {context['actual_length']}",
            hint=f"{least} {wanted}",
            place=place,
        )
    if kind == "string_too_short":
        return GustformError("GF2003", f"{name} must not be empty; got {got}", hint="a word", place=place)
    bound = details["msg"].replace("Input should be ", "")
    return GustformError("GF2003", f"{name} must be {bound}; got {got}", hint=f"a value {bound}", place=place)

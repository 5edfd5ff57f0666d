"""The scenario: what a YAML file may say, as typed and frozen models.

The models know the fixed part of the format (run, output, events, wind, how components hang together); the
parameters of a component are checked against its declaration in `components.py`. `validate` reports every error it
finds, each with its place in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, ValidationError
from pydantic_core import ErrorDetails

from gustform.language.errors import GustformError
from gustform_cli.document import Document, NodePath, dotted
from gustform_cli.errors import did_you_mean
from gustform_cli.fields import Block, Duration, Many, Moment, Name, Tolerance, shown
from gustform_cli.output_blocks import Output
from gustform_cli.wind.blocks import WindBlock

M = TypeVar("M", bound=BaseModel)


class ComponentEntry(BaseModel):
    """One component: its type, where it is connected, how many it stands for, and its parameters."""

    model_config = ConfigDict(extra="allow", frozen=True)

    type: StrictStr = Field(description="component type, as `gustform info` lists them")
    at: Name | None = Field(None, description="component its AC terminal is connected to")
    from_: Name | None = Field(None, alias="from", description="component its first terminal is connected to")
    to: Name | None = Field(None, description="component its second terminal is connected to")
    count: Many | None = Field(None, description="how many individual components: name[1], name[2], ...")
    aggregate: Many | None = Field(None, description="how many units this one stands for")


class Event(Block):
    """Parameters that take new values at one moment."""

    at: Moment = Field(description="when")
    set: dict[StrictStr, Any] = Field(
        description="component.parameter: new value", min_length=1, json_schema_extra={"examples": [{"load.P": "1 MW"}]}
    )


class Run(Block):
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
    checkpoint: Duration | None = Field(
        None,
        description="simulated time between checkpoints; from an hour on a fiftieth of the run, at least 10 min, if "
        "left out",
    )


class Scenario(Block):
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
    return validate_as(Scenario, document, "{type: constant, speed: 8 m/s}")


def validate_as(model: type[M], document: Document, typed: str) -> tuple[M | None, list[GustformError]]:
    """A document as `model`, or None and all that is wrong with it. `typed` is an example of a mapping that has to say
    its type."""
    try:
        plain = document.plain()
    except GustformError as error:
        return None, [error]
    try:
        return model.model_validate(plain), []
    except ValidationError as error:
        found = error.errors(include_url=False)
        return None, [_translate(document, plain, details, model, typed) for details in found]


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


def _model_at(root: type[BaseModel], loc: tuple[str | int, ...]) -> type[BaseModel] | None:
    """The model whose keys stand at a location of pydantic's."""
    kind: Any = root
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
        if type(None) in (options := get_args(kind)):  # what may be left out
            kind = next(option for option in options if option is not type(None))
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


def _translate(
    document: Document, plain: Mapping[str, Any], details: ErrorDetails, root: type[BaseModel], typed: str
) -> GustformError:
    """One of pydantic's errors in our words."""
    kind, loc, context = details["type"], details["loc"], details.get("ctx", {})
    path = _node_path(plain, loc)
    name, got = dotted(path), shown(details["input"])
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
        model = _model_at(root, loc[:-1])
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
            hint=typed,
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

"""Types of the fields of a scenario: names, moments, speeds, ...: checked, converted, and described for editors."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, StrictStr, WithJsonSchema
from pydantic_core import PydanticCustomError

from gustform.language.errors import GustformError
from gustform_cli.quantity import is_plain, parse_quantity

NAME_PATTERN = r"^[A-Za-z_][A-Za-z0-9_]*$"
QUANTITY_PATTERN = r"^\s*[+-]?[0-9.][0-9_.eE+-]*\s*\S.*$"


def refuse(code: str, message: str, hint: str = "") -> PydanticCustomError:
    """An error of ours inside a pydantic validator; `validate` puts path and place to it."""
    return PydanticCustomError(code, "{message}", {"message": message, "hint": hint})


def _check_name(value: object) -> object:
    if isinstance(value, str) and not re.match(NAME_PATTERN, value):
        raise refuse(
            "GF2205",
            f" must be a name of letters, digits and _, not beginning with a digit; got {value!r}",
            re.sub(r"\W+", "_", value).strip("_") or "wt",
        )
    return value


def _check_many(value: object) -> object:
    if value == "turbines" or (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
        return value
    raise refuse("GF2003", f" must be a whole number from 1 on, or the word turbines; got {shown(value)}", "1")


def quantity(
    unit: str, *, above: float = -math.inf, low: float = -math.inf, high: float = math.inf
) -> Callable[[object], float]:
    """Validator of a quantity: text with a unit becomes a number in `unit`, within bounds."""

    def convert(value: object) -> float:
        try:
            number = parse_quantity(value, unit, "")
        except GustformError as error:
            raise refuse(error.code, error.message, error.hint) from None
        for wrong, bound in (
            (number <= above, f"greater than {above:g}"),
            (number < low, f"at least {low:g}"),
            (number > high, f"at most {high:g}"),
        ):
            if wrong:
                text = bound if is_plain(unit) else f"{bound} {unit}"
                raise refuse("GF2003", f" must be {text}; got {value}", f"a value {text}")
        return number

    return convert


def schema_of(unit: str, example: str) -> dict[str, Any]:
    """JSON schema of a quantity, for editors."""
    if is_plain(unit):
        return {"anyOf": [{"type": "number"}, {"type": "string", "pattern": r"%\s*$"}], "examples": [example]}
    return {"type": "string", "pattern": QUANTITY_PATTERN, "examples": [example]}


Name = Annotated[StrictStr, BeforeValidator(_check_name), WithJsonSchema({"type": "string", "pattern": NAME_PATTERN})]
Moment = Annotated[float, BeforeValidator(quantity("s", low=0.0)), WithJsonSchema(schema_of("s", "30 s"))]
Duration = Annotated[float, BeforeValidator(quantity("s", above=0.0)), WithJsonSchema(schema_of("s", "20 ms"))]
Speed = Annotated[
    float, BeforeValidator(quantity("m/s", low=0.5, high=100.0)), WithJsonSchema(schema_of("m/s", "8 m/s"))
]
Length = Annotated[float, BeforeValidator(quantity("m", above=0.0)), WithJsonSchema(schema_of("m", "90 m"))]
Tolerance = Annotated[
    float, BeforeValidator(quantity("1", low=1e-12, high=1e-2)), WithJsonSchema(schema_of("1", "1e-6"))
]
# A number of things, or the word that stands for the scenario's number of turbines.
Many = Annotated[
    int | Literal["turbines"],
    BeforeValidator(_check_many),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 1}, {"const": "turbines"}]}),
]


class Block(BaseModel):
    """A mapping with fixed keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=False)


def shown(value: object) -> str:
    """A value as messages show it, not too long."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

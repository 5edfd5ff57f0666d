"""What may stand under `output:` in a scenario: which rows are stored, and which statistics are made while running."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, StrictInt, StrictStr
from pydantic_core import CoreSchema

from gustform_cli.fields import Block, Duration, Moment, refuse, shown

Kind = Literal["moments", "histogram", "psd", "rainflow"]


def _check_exponent(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.5 <= value <= 50.0:
        raise refuse("GF2003", f" must be a slope of a fatigue curve, from 0.5 to 50; got {shown(value)}", "4")
    return float(value)


def _check_range(value: Any) -> Any:
    if not (isinstance(value, list) and len(value) == 2):
        raise refuse("GF2003", f" must be [lowest, highest]; got {shown(value)}", "[0 m/s, 30 m/s]")
    return tuple(value)


Exponent = Annotated[float, BeforeValidator(_check_exponent)]
Range = Annotated[tuple[Any, Any], BeforeValidator(_check_range)]


class StatisticsBlock(Block):
    """Statistics of channels, made while running in constant memory. `true` alone takes all defaults."""

    every: Duration | None = Field(None, description="spacing of the samples; that of the rows if left out")
    start: Moment = Field(0.0, description="what comes before is left out")
    channels: list[StrictStr] | None = Field(
        None, min_length=1, description="names with * and ?; the stored ones if left out"
    )
    of: list[Kind] = Field(
        default_factory=lambda: list[Kind](["moments"]),
        description="moments (mean, deviation, extremes: always), histogram, psd (Welch), rainflow (ASTM E1049-85)",
    )
    wohler: list[Exponent] = Field(
        default_factory=lambda: [3.0, 4.0, 10.0],
        min_length=1,
        description="slopes m of the fatigue curves that damage-equivalent loads are for",
    )
    bins: Annotated[StrictInt, Field(ge=1, le=10_000)] = Field(100, description="of histograms and rainflow ranges")
    ranges: dict[StrictStr, Range] = Field(
        default_factory=dict,
        description="name with * and ?: [lowest, highest] of its histogram",
        json_schema_extra={"examples": [{"wt.wind": ["0 m/s", "30 m/s"]}]},
    )
    segment: Duration = Field(
        100.0, description="length of a segment of the spectrum, rounded up to a power of two of samples"
    )


class _TrueOrFalse:
    """Schema: the block, or true or false in its place."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        block = handler(core)
        return {"anyOf": [{"type": "boolean"}, *block.get("anyOf", [block])]}


def _from_bool(value: object) -> object:
    if value is True:
        return {}
    return {"of": []} if value is False else value


Statistics = Annotated[StatisticsBlock | None, BeforeValidator(_from_bool), _TrueOrFalse]


class Output(Block):
    """What is kept of a run."""

    every: Duration = Field(0.02, description="spacing of the rows in the result")
    channels: list[StrictStr] = Field(
        default_factory=lambda: ["*"], min_length=1, description="names with * and ?, e.g. wt.*"
    )
    precision: Literal["float32", "float64"] = Field(
        "float32", description="of the stored rows: 7 digits, or 16 in twice the space and at some cost of time"
    )
    statistics: Statistics = Field(
        None, description="statistics while running; made of the stored channels in runs of ten minutes and longer"
    )

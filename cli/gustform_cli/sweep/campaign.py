"""The campaign: what a YAML file may say, as typed and frozen models.

Paths are those of `--set`: wt.curtailment, wind.wt.mean, run.until, wt.control.K_gsc. Names of the wind block are
those of WEIS where WEIS has one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictInt, StrictStr

from gustform_cli import document
from gustform_cli.document import Document
from gustform_cli.errors import ErrorList
from gustform_cli.fields import Block, Duration, Moment, Name, Speed
from gustform_cli.scenario import validate_as

Count = Annotated[StrictInt, Field(ge=1, le=1_000_000)]
Seed = Annotated[StrictInt, Field(ge=0)]
Values = Annotated[list[Any], Field(min_length=1)]


class GridAxis(Block):
    """Every combination of the values."""

    type: Literal["grid"]
    values: dict[StrictStr, Values] = Field(min_length=1, description="path: [value, ...]")


class ListAxis(Block):
    """Values that go together, as columns (`values`) or as rows (`rows`)."""

    type: Literal["list"]
    values: dict[StrictStr, Values] = Field(default_factory=dict, description="path: [value, ...], all equally long")
    rows: list[Annotated[dict[StrictStr, Any], Field(min_length=1)]] = Field(
        default_factory=list, description="{path: value, ...} of each case"
    )


class Range(Block):
    """Where a sampled value may lie."""

    from_: Any = Field(alias="from", description="lowest value, a number or a quantity")
    to: Any = Field(description="highest value")
    scale: Literal["linear", "log"] = Field("linear", description="log: equal shares of each decade")


class LatinHypercubeAxis(Block):
    """n points in which each value has one point in each n-th part of its range."""

    type: Literal["latin_hypercube"]
    n: Count = Field(description="number of points")
    seed: Seed = Field(1, description="another seed, other points")
    ranges: dict[StrictStr, Range] = Field(min_length=1, description="path: {from: ..., to: ...}")


Axis = Annotated[GridAxis | ListAxis | LatinHypercubeAxis, Field(discriminator="type")]


class SpeedRange(Block):
    """Mean wind speeds from one to another, ws_bin_size apart."""

    from_: Speed = Field(alias="from", description="first mean wind speed")
    to: Speed = Field(description="last mean wind speed")


def _as_text(value: object) -> object:
    """DLC: 1.2 is a number in YAML."""
    return f"{value:g}" if isinstance(value, float) else value


class WindCampaign(Block):
    """Turbulent wind (normal turbulence model): mean speeds times seeds."""

    turbines: list[Name] = Field(
        default_factory=list, description="whose wind it is; all that the scenario has a wind for if left out"
    )
    DLC: Annotated[Literal["1.1", "1.2"] | None, BeforeValidator(_as_text)] = Field(
        None, description="design load case of IEC 61400-1 that gives speeds and number of seeds where left out"
    )
    wind_speed: list[Speed] | SpeedRange | None = Field(
        None, description="mean wind speeds, a list or {from: ..., to: ...}; cut_in to cut_out if left out"
    )
    ws_bin_size: Speed = Field(2.0, description="distance of the mean wind speeds")
    n_seeds: Count | None = Field(None, description="winds for each mean speed; by the DLC, else 1, if left out")
    seed: Seed = Field(1, description="another seed, other winds for all cases")
    cut_in: Speed = Field(4.0, description="lowest mean wind speed of a DLC")
    cut_out: Speed = Field(24.0, description="highest mean wind speed of a DLC")
    rated_speed: Speed = Field(11.4, description="where DLC 1.1 begins to ask for more seeds, less 2 m/s")
    turbine_class: Literal["I", "II", "III"] | None = Field(
        None, description="gives each case its share of the time (Rayleigh) in the column `weight`"
    )
    turbulence_class: Literal["A", "B", "C"] | None = Field(
        None, description="that of the scenario's wind, or B, if left out"
    )
    analysis_time: Duration = Field(600.0, description="simulated time that counts")
    transient_time: Moment = Field(120.0, description="simulated time before it, which the statistics leave out")


class Campaign(Block):
    """A base scenario, what is varied, and what is kept."""

    name: StrictStr = Field(min_length=1, description="title, used in tables and pages")
    description: StrictStr = Field("", description="free text")
    base: StrictStr = Field(min_length=1, description="scenario file, relative to the campaign")
    set: dict[StrictStr, Any] = Field(default_factory=dict, description="path: value, the same in all cases")
    axes: list[Axis] = Field(default_factory=list, description="each multiplies the cases of those before it")
    wind: WindCampaign | None = Field(None, description="mean wind speeds and seeds, a further axis")
    transient_time: Moment | None = Field(
        None, description="simulated time that the statistics leave out; that of the wind, else none, if left out"
    )
    keep: Literal["none", "failed", "all"] = Field("none", description="of which cases the result file is kept")
    scalars: list[StrictStr] = Field(
        default_factory=lambda: ["*"], min_length=1, description="columns of the table, names with * and ?"
    )

    @property
    def transient(self) -> float:
        """Simulated time before the statistics begin, s."""
        if self.transient_time is not None:
            return self.transient_time
        return self.wind.transient_time if self.wind is not None else 0.0


def read(file: Path) -> tuple[Campaign, Document]:
    """The campaign in a file. Raises ErrorList or GustformError with places in it."""
    written = document.read(file, what="campaign")
    campaign, errors = validate_as(Campaign, written, "{type: grid, values: {wt.curtailment: [5 %, 10 %]}}")
    if campaign is None:
        raise ErrorList(errors)
    return campaign, written

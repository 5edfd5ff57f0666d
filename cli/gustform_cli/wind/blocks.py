"""What may stand under `wind:` in a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictBool, StrictInt, StrictStr

from gustform_cli.fields import Block, Duration, Length, Speed


class ConstantWind(Block):
    """Wind of one speed."""

    type: Literal["constant"]
    speed: Speed = Field(description="wind speed")


class TurbulentWindBlock(Block):
    """IEC 61400-1 turbulence (Kaimal spectrum, normal turbulence model), made while running."""

    type: Literal["turbulence"]
    mean: Speed = Field(description="mean wind speed at hub height")
    class_: Literal["A", "B", "C"] = Field("B", alias="class", description="turbulence class of IEC 61400-1")
    seed: Annotated[StrictInt, Field(ge=0)] = Field(1, description="another seed, another wind of the same kind")
    hub_height: Length = Field(90.0, description="gives the length scale of the turbulence")
    every: Duration = Field(0.05, description="spacing of the samples")
    rotor_effective: StrictBool = Field(True, description="averaged over the rotor, as a turbine feels it")
    radius: Length | None = Field(None, description="rotor radius for the averaging; that of the turbine if left out")


class WindColumns(Block):
    """Columns of a wind file by the names in its header."""

    time: StrictStr = Field("time", description="column of the times, counted from the start of the run")
    speed: StrictStr = Field("speed", description="column of the wind speeds")


class WindUnits(Block):
    """Units the columns of a wind file are in."""

    time: StrictStr = Field("s", description="unit of the times")
    speed: StrictStr = Field("m/s", description="unit of the speeds")


class FileWind(Block):
    """Rotor-effective wind from a CSV file whose first line names the columns."""

    type: Literal["file"]
    path: StrictStr = Field(description="the file, relative to the scenario")
    columns: WindColumns = Field(default_factory=lambda: WindColumns.model_validate({}))
    units: WindUnits = Field(default_factory=lambda: WindUnits.model_validate({}))
    on_end: Literal["error", "hold"] = Field("error", description="when the file ends before the run")


WindBlock = Annotated[ConstantWind | TurbulentWindBlock | FileWind, Field(discriminator="type")]

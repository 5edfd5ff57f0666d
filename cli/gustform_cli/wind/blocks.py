"""What may stand under `wind:` in a scenario."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictBool, StrictInt, StrictStr, WithJsonSchema

from gustform.language.errors import GustformError
from gustform_cli.fields import Block, Duration, Length, Moment, Speed, quantity, refuse, schema_of, shown
from gustform_cli.quantity import parse_quantity
from gustform_cli.wind.stamps import zone_of

Share = Annotated[float, BeforeValidator(quantity("1", above=0.0, high=1.0)), WithJsonSchema(schema_of("1", "5 %"))]
Factor = Annotated[float, BeforeValidator(quantity("1", above=0.0)), WithJsonSchema(schema_of("1", "1.2"))]
RotorSpeed = Annotated[
    float, BeforeValidator(quantity("rad/s", above=0.0)), WithJsonSchema(schema_of("rad/s", "12.1 rpm"))
]


def _check_start(value: object) -> float | datetime:
    """A number of seconds or a moment of the calendar."""
    if isinstance(value, str):
        try:
            return datetime.fromisoformat(value)
        except ValueError:
            pass
    try:
        return parse_quantity(value, "s", "")
    except GustformError as error:
        raise refuse(
            error.code, f" must be a moment or a time in s; got {shown(value)}", "2015-04-01T00:00, or 600 s"
        ) from None


def _check_zone(value: object) -> object:
    if isinstance(value, str):
        try:
            zone_of(value)
        except ValueError:
            raise refuse(
                "GF2511",
                f" must be a time zone of the IANA data base; got {value!r}",
                "Europe/Paris, America/Denver, UTC or Etc/GMT-1 (one hour ahead of UTC all year)",
            ) from None
    return value


Start = Annotated[
    float | datetime,
    BeforeValidator(_check_start),
    WithJsonSchema({"type": "string", "examples": ["2015-04-01T00:00", "600 s"]}),
]
Zone = Annotated[
    StrictStr, BeforeValidator(_check_zone), WithJsonSchema({"type": "string", "examples": ["Europe/Paris"]})
]
TurbulenceClass = Literal["A", "B", "C"]
OnEnd = Literal["error", "hold", "repeat"]


class ThreeP(Block):
    """A component at three times the speed of the rotor, for towers and shear that the blades pass."""

    amplitude: Share = Field(description="of the component, relative to the wind")
    rotor_speed: RotorSpeed = Field(description="speed of the rotor, one for the whole run")


class ConstantWind(Block):
    """Wind of one speed."""

    type: Literal["constant"]
    speed: Speed = Field(description="wind speed")


class WindStep(Block):
    """One jump."""

    at: Moment = Field(description="when")
    to: Speed = Field(description="wind speed from then on")


class StepWind(Block):
    """Wind that jumps; the run stops at each jump and goes on behind it."""

    type: Literal["step"]
    from_: Speed = Field(alias="from", description="wind speed before the first jump")
    steps: list[WindStep] = Field(min_length=1, description="jumps in the order of time")


class RampWind(Block):
    """Wind that goes from one speed to another on a straight line."""

    type: Literal["ramp"]
    from_: Speed = Field(alias="from", description="wind speed before")
    to: Speed = Field(description="wind speed after")
    at: Moment = Field(description="when the ramp begins")
    duration: Duration = Field(description="how long it takes")


class GustWind(Block):
    """A gust of IEC 61400-1: EOG rises and falls within 10.5 s, ECG rises within 10 s and stays."""

    type: Literal["gust"]
    shape: Literal["EOG", "ECG"] = Field(description="extreme operating gust, extreme coherent gust")
    mean: Speed = Field(description="wind speed at hub height before the gust")
    at: Moment = Field(description="when the gust begins")
    turbine_class: Literal["I", "II", "III"] = Field("I", description="wind turbine class of IEC 61400-1")
    class_: TurbulenceClass = Field("B", alias="class", description="turbulence class of IEC 61400-1")
    hub_height: Length = Field(90.0, description="height of the hub")
    rotor_diameter: Length | None = Field(None, description="that of the turbine if left out")
    amplitude: Speed | None = Field(None, description="of the gust, in place of the standard's")


class TurbulentWindBlock(Block):
    """IEC 61400-1 turbulence (normal turbulence model), made while running."""

    type: Literal["turbulence"]
    mean: Speed = Field(description="mean wind speed at hub height")
    class_: TurbulenceClass = Field("B", alias="class", description="turbulence class of IEC 61400-1")
    model: Literal["kaimal", "mann"] = Field(
        "kaimal", description="Kaimal spectrum, or a box of Mann's model by hipersim (gustform[mann])"
    )
    level: Literal["quantile_90", "mean"] = Field(
        "quantile_90", description="standard deviation: 90 % quantile for loads, mean for energy"
    )
    intensity: Share | None = Field(None, description="standard deviation over mean, in place of class and level")
    seed: Annotated[StrictInt, Field(ge=0)] = Field(1, description="another seed, another wind of the same kind")
    duration: Duration | None = Field(None, description="length of the wind; that of the run if left out")
    on_end: OnEnd = Field("error", description="when the wind ends before the run")
    hub_height: Length = Field(90.0, description="gives the length scale of the turbulence")
    every: Duration = Field(0.05, description="spacing of the samples")
    rotor_effective: StrictBool = Field(True, description="averaged over the rotor, as a turbine feels it")
    radius: Length | None = Field(None, description="rotor radius for the averaging; that of the turbine if left out")
    three_p: ThreeP | None = Field(None, description="rotational sampling at three times the rotor's speed")


class WindColumns(Block):
    """Columns of a wind file, by the names in its header or by number from 1."""

    time: StrictStr | Annotated[StrictInt, Field(ge=1)] = Field("time", description="column of the times")
    speed: StrictStr | Annotated[StrictInt, Field(ge=1)] = Field("speed", description="column of the wind speeds")


class WindUnits(Block):
    """Units the columns of a wind file are in."""

    time: StrictStr = Field("s", description="unit of times that are numbers")
    speed: StrictStr = Field("m/s", description="unit of the speeds")


def _check_shape(value: Any) -> Any:
    if not (isinstance(value, list) and len(value) == 3 and all(type(n) is int and n >= 1 for n in value)):
        raise refuse("GF2003", f" must be three whole numbers from 1 on; got {shown(value)}", "[8192, 32, 32]")
    return tuple(value)


def _check_spacing(value: Any) -> Any:
    if not (isinstance(value, list) and len(value) == 3):
        raise refuse("GF2003", f" must be three lengths; got {shown(value)}", "[0.5 m, 4 m, 4 m]")
    return tuple(quantity("m", above=0.0)(one) for one in value)


Shape = Annotated[
    tuple[int, int, int],
    BeforeValidator(_check_shape),
    WithJsonSchema(
        {"type": "array", "items": {"type": "integer", "minimum": 1}, "minItems": 3, "maxItems": 3}
    ),
]  # fmt: skip
Spacing = Annotated[
    tuple[float, float, float],
    BeforeValidator(_check_spacing),
    WithJsonSchema({"type": "array", "items": schema_of("m", "4 m"), "minItems": 3, "maxItems": 3}),
]


class FileWind(Block):
    """Wind from a file: a table (CSV, Parquet, netCDF), uniform wind of AeroDyn, or a box (TurbSim, Mann, Bladed)."""

    type: Literal["file"]
    path: StrictStr = Field(description="the file, relative to the scenario")
    format: Literal["csv", "parquet", "netcdf", "uniform", "turbsim", "mann", "bladed"] | None = Field(
        None, description="what kind of file it is; by its ending if left out"
    )
    # tables
    columns: WindColumns = Field(default_factory=lambda: WindColumns.model_validate({}))
    units: WindUnits = Field(default_factory=lambda: WindUnits.model_validate({}))
    start: Start | None = Field(None, description="moment or time of the file at which the run starts")
    time_zone: Zone | None = Field(None, description="of stamps that have no offset")
    time_format: StrictStr | None = Field(None, description="of stamps that are not ISO 8601, as for strptime")
    header_rows: Annotated[StrictInt, Field(ge=0, le=100)] = Field(1, description="lines with names of the columns")
    missing: list[float] = Field(default_factory=list, description="numbers that stand for no value, e.g. -999")
    every: Duration | None = Field(None, description="spacing of the rows; as the file shows it if left out")
    gaps: Literal["error", "hold", "interpolate", "skip"] = Field(
        "error", description="where values or rows are missing: refuse, hold, bridge, or close up the time"
    )
    longest_gap: Duration = Field(3600.0, description="longest gap that hold and interpolate may bridge")
    interpolation: Literal["linear", "pchip"] | None = Field(
        None, description="between samples; pchip from 1 s spacing on, linear below, if left out"
    )
    # boxes
    reduce: Literal["hub", "rotor_average"] | None = Field(
        None, description="what is taken of a box: the wind at the hub or the mean over the rotor"
    )
    shape: Shape | None = Field(None, description="points of a Mann box in x, y, z")
    spacing: Spacing | None = Field(None, description="distances of the points of a Mann box in x, y, z")
    scale: Factor = Field(1.0, description="factor on the fluctuation of a Mann box")
    # all
    is_: Literal["point", "rotor_effective"] | None = Field(
        None, alias="is", description="measured at a point, and to be filtered, or what a rotor feels"
    )
    mean: Speed | None = Field(
        None, description="mean wind: of the operating point, the filter and a Mann box; the file's if left out"
    )
    radius: Length | None = Field(None, description="rotor radius; that of the turbine if left out")
    on_end: OnEnd = Field("error", description="when the file ends before the run")
    three_p: ThreeP | None = Field(None, description="rotational sampling at three times the rotor's speed")


WindBlock = Annotated[
    ConstantWind | StepWind | RampWind | GustWind | TurbulentWindBlock | FileWind, Field(discriminator="type")
]

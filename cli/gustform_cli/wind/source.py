"""From a `wind:` block to what drives the input of a turbine: a constant, or a series with its reader."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform.language.system import Constant, Series
from gustform_cli.wind.blocks import (
    ConstantWind,
    GustWind,
    RampWind,
    StepWind,
    ThreeP,
    TurbulentWindBlock,
    WindBlock,
)
from gustform_cli.wind.clean import LOWEST_SPEED
from gustform_cli.wind.gusts import COHERENT_GUST, EOG_SECONDS, ecg, eog, eog_amplitude, ramp
from gustform_cli.wind.kaimal import Kaimal, length_scale, standard_deviation
from gustform_cli.wind.mann import MannTurbulence
from gustform_cli.wind.rotor import Reader
from gustform_cli.wind.survey import duration
from gustform_cli.wind.three_p import BladeWind, check_spacing
from gustform_cli.wind.turbulence import TurbulentWind

PlaceOf = Callable[..., Place]  # of a key of the block: place("columns", "speed")


@dataclass(frozen=True)
class WindSource:
    """What drives one input, the reader that delivers a series' samples, and what is to be said about it.

    `longest_step`: a longer step of the solver could pass over the wind's only change, s.
    """

    drive: Constant | Series
    reader: Reader | None = None
    warnings: tuple[str, ...] = ()
    longest_step: float = math.inf


@dataclass(frozen=True)
class Site:
    """Where a block stands: the turbines it drives and the run they are in."""

    name: str
    instances: list[str]
    folder: Path
    until: float
    operating: float | None  # wind of the steady state that the run starts from, m/s
    radius: Callable[[], float]  # of the rotor, m; raises where it is not known
    place: PlaceOf

    def error(self, code: str, message: str, hint: str, *keys: str) -> GustformError:
        """An error at a key of the block."""
        return GustformError(code, message, hint=hint, place=self.place(*keys))


def operating_wind(block: WindBlock, folder: Path, until: float) -> float:
    """The wind speed that a turbine's operating point is made for unless its entry says another, m/s: where the wind
    starts, or its mean; the mean of a file is that over the run."""
    from gustform_cli.wind.files import file_mean

    if isinstance(block, ConstantWind):
        return block.speed
    if isinstance(block, StepWind | RampWind):
        return block.from_
    return block.mean if block.mean is not None else file_mean(block, folder, until)


def sources(block: WindBlock, site: Site) -> list[WindSource]:
    """A source for each instance: turbulence of its own, or the one wind for all."""
    from gustform_cli.wind.files import file_source

    if isinstance(block, TurbulentWindBlock):
        if block.model == "mann":
            return [_mann(block, site, number) for number in range(1, len(site.instances) + 1)]
        return [_kaimal(block, site, number) for number in range(1, len(site.instances) + 1)]
    if isinstance(block, ConstantWind):
        one = WindSource(Constant(block.speed))
    elif isinstance(block, StepWind):
        one = _step(block, site)
    elif isinstance(block, RampWind):
        times, speeds = ramp(block.from_, block.to, block.at, block.duration)
        one = WindSource(_inline(site, times, speeds, block.from_))
    elif isinstance(block, GustWind):
        one = _gust(block, site)
    else:
        one = file_source(block, site)
    return [one] * len(site.instances)


# ---- by a formula ---------------------------------------------------------------------------------------------------
def _inline(
    site: Site, times: NDArray[np.float64], speeds: NDArray[np.float64], start: float, interpolation: str = "linear"
) -> Series:
    return Series(
        name=f"wind of {site.name}",
        operating_value=start,
        t0=float(times[0]),
        time=times,
        value=np.maximum(speeds, LOWEST_SPEED),
        interpolation=interpolation,
        on_end="hold",
    )


def _step(block: StepWind, site: Site) -> WindSource:
    """A held series: the solver stops at each jump, so that no step sees both sides."""
    times = [step.at for step in block.steps]
    for number, (before, at) in enumerate(pairwise(times), start=1):
        if at <= before:
            raise site.error(
                "GF2003",
                f"wind.{site.name}.steps[{number}].at must be greater than {before:g} s, the one before; got {at:g} s",
                "steps in the order of time",
                "steps",
            )
    known = [(0.0, block.from_)] if times[0] > 0.0 else []
    known += [(step.at, step.to) for step in block.steps]
    table = np.array(known)
    return WindSource(_inline(site, table[:, 0], table[:, 1], block.from_, "hold"))


def _gust(block: GustWind, site: Site) -> WindSource:
    if block.shape == "ECG":
        times, speeds = ecg(block.mean, block.amplitude or COHERENT_GUST, block.at)
        return WindSource(_inline(site, times, speeds, block.mean))
    diameter = block.rotor_diameter or 2.0 * site.radius()
    amplitude = block.amplitude or eog_amplitude(
        block.mean, block.turbine_class, block.class_, block.hub_height, diameter
    )
    if amplitude <= 0.0:
        raise site.error(
            "GF2003",
            f"wind.{site.name}.mean must be less than the 1-year extreme wind of class {block.turbine_class}, or there "
            f"is no extreme operating gust; got {block.mean:g} m/s",
            "a lower mean, or amplitude: with that of the gust",
            "mean",
        )
    times, speeds = eog(block.mean, amplitude, block.at)
    # Before and after it nothing happens: a free-running solver would step over it.
    return WindSource(_inline(site, times, speeds, block.mean), longest_step=EOG_SECONDS / 10.0)


# ---- turbulence -----------------------------------------------------------------------------------------------------
def _turbulence_series(block: TurbulentWindBlock, site: Site, number: int, t_end: float, reader: Reader) -> WindSource:
    warnings: tuple[str, ...] = ()
    if t_end < site.until:
        warnings = at_end(site, block.on_end, "the wind", t_end, t_end, "duration")
    if block.three_p is not None:
        check_spacing(f"wind.{site.name}", block.every, block.three_p.rotor_speed)
        reader = with_blades(reader, block.three_p)
    series = Series(
        name=f"wind of {site.instances[number - 1]}",
        operating_value=block.mean,
        dt=block.every,
        on_end=block.on_end if math.isfinite(t_end) else "error",  # without a duration there is no end
        t_end=t_end,
    )
    return WindSource(series, reader, warnings)


def _deviation(block: TurbulentWindBlock) -> float:
    if block.intensity is not None:
        return block.intensity * block.mean
    return standard_deviation(block.class_, block.mean, block.level)


def _averaging(block: TurbulentWindBlock, site: Site) -> float | None:
    """Radius of the rotor that the wind is averaged over, m."""
    return (block.radius or site.radius()) if block.rotor_effective else None


def _kaimal(block: TurbulentWindBlock, site: Site, number: int) -> WindSource:
    """Turbulence of turbine `number` (from 1), which has a stream of its own under the block's seed."""
    spectrum = Kaimal(mean=block.mean, sigma=_deviation(block), length=length_scale(block.hub_height))
    reader = TurbulentWind(spectrum, step=block.every, seed=(block.seed, number), radius=_averaging(block, site))
    t_end = block.duration if block.duration is not None else math.inf
    return _turbulence_series(block, site, number, t_end, reader)


_MOST_PLANES = 1 << 15  # of 16 x 16 points: 2 GB while hipersim works on it


def _mann(block: TurbulentWindBlock, site: Site, number: int) -> WindSource:
    length = block.duration if block.duration is not None else site.until
    if length > _MOST_PLANES * block.every:
        raise site.error(
            "GF2003",
            f"wind.{site.name}.duration of a Mann box must be at most {duration(_MOST_PLANES * block.every)} "
            f"({_MOST_PLANES} planes every {block.every:g} s); got {duration(length)}",
            "duration: 10 min with on_end: repeat, or model: kaimal",
            "duration",
        )
    try:
        reader = MannTurbulence(
            mean=block.mean,
            deviation=_deviation(block),
            length=0.8 * length_scale(block.hub_height) / 8.1,
            step=block.every,
            duration=length,
            seed=1000 * block.seed + number,
            radius=_averaging(block, site),
        )
    except GustformError as error:
        raise site.error(error.code, error.message, error.hint, "model") from None
    period = reader.planes * block.every
    return _turbulence_series(block, site, number, period if block.on_end == "repeat" else length, reader)


# ---- shared with files ----------------------------------------------------------------------------------------------
def with_blades(reader: Reader, three_p: ThreeP) -> Reader:
    """A reader with rotational sampling."""
    return BladeWind(reader, three_p.amplitude, three_p.rotor_speed)


def at_end(site: Site, on_end: str, what: str, end: float, period: float, key: str) -> tuple[str, ...]:
    """What is to be said where the wind ends, at `end`, s, before the run; GF2506 under on_end: error."""
    if on_end == "error":
        raise site.error(
            "GF2506",
            f"{what} must cover the run, {site.until:g} s; it ends at {end:.10g} s",
            f"run.until: {math.floor(1e3 * end) / 1e3:.10g} s, or on_end: hold or repeat",
            key,
        )
    if on_end == "hold":
        return (f"wind.{site.name}: {what} ends at {end:.10g} s; its last value is held to the end of the run",)
    times, line = site.until / period, 1.0 / period
    text = f"{what} is repeated every {duration(period)}, {times:.3g} times in this run: false periods at multiples of"
    return (f"wind.{site.name}: {text} {line:.3g} Hz, and statistics no better than those of one period",)

"""Statistics of a run, made by the runtime while it goes on: what is asked for, and what came out.

The runtime keeps everything in constant memory and looks at double precision values every `statistics.every`, stored
or not. Columns are the stored channels and, behind them, those that only statistics need.
"""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.errors import ErrorList
from gustform_cli.fields import shown
from gustform_cli.limits import Limit, turbine_limits
from gustform_cli.model import Model, all_inputs
from gustform_cli.names import expand, with_best_names
from gustform_cli.output_blocks import StatisticsBlock
from gustform_cli.quantity import parse_quantity
from gustform_codegen.table import Channel

if TYPE_CHECKING:
    from gustform_runtime import Cycles, Histogram, Keep, Moments, Spectrum, Statistics

Floats = NDArray[np.float64]

FROM_SECONDS = 600.0  # runs from here on have statistics unless the scenario says otherwise
_LEAST_SEGMENT = 8  # samples
# Where a histogram reaches whose range is not given, by unit; others reach to three times what they start with.
_RANGES = {"m/s": (0.0, 50.0), "pu": (-0.5, 2.0), "Hz": (45.0, 55.0), "deg": (-10.0, 90.0)}


@dataclass(frozen=True)
class Watched:
    """A channel that statistics are made of, and its column."""

    name: str
    unit: str
    description: str
    column: int


@dataclass(frozen=True)
class AtLimit:
    """A limit of a turbine and the number of what counts the samples beyond it."""

    turbine: str
    limit: Limit
    keep: int


@dataclass(frozen=True)
class Yield:
    """The power of a turbine: its rating (W, all that it stands for) and the numbers of what keeps its moments."""

    turbine: str
    rating: float
    power: int
    reserve: int
    available: int


@dataclass(frozen=True)
class Plan:
    """What the statistics of a run are made of. `stored` of the `columns` go into the result."""

    every: float
    start: float
    block: StatisticsBlock
    columns: tuple[Channel, ...]
    stored: int
    watched: tuple[Watched, ...] = ()
    limits: tuple[AtLimit, ...] = ()
    yields: tuple[Yield, ...] = ()
    keeps: tuple[Keep, ...] = ()
    spans: tuple[tuple[float, float], ...] = ()  # of the histogram of each watched channel

    @property
    def needed(self) -> bool:
        """Whether there is anything to keep."""
        return bool(self.keeps)

    @property
    def size(self) -> int:
        """About how many bytes the results take in a file."""
        return sum(1024 + 8 * (2 * len(keep.edges) + keep.segment + keep.ranges) for keep in self.keeps)

    def create(self) -> Statistics:
        """What the runtime fills; for one run."""
        from gustform_runtime import Statistics

        return Statistics(self.keeps, len(self.columns), self.every)


class _Columns:
    """The channels of a run by what they are, more of them as more are asked for."""

    def __init__(self, model: Model) -> None:
        self.linked = model.built.linked
        self.channels = list(model.channels)
        self._number = {(c.kind, c.a, c.b): k for k, c in enumerate(self.channels)}
        self._names = {c.name: k for k, c in enumerate(self.channels)}

    def of(self, channel: Channel) -> int:
        """The column of a channel."""
        key = (channel.kind, channel.a, channel.b)
        if key not in self._number:
            self._number[key] = len(self.channels)
            self.channels.append(channel)
        return self._number[key]

    def named(self, name: str) -> tuple[int, int] | None:
        """The column of a variable and the sign it has there; None if there is no such variable."""
        if name in self._names:
            return self._names[name], 1
        found = self.linked.channel(name)
        return None if found is None else (self.of(found[0]), found[1])


def plan(model: Model, starts: Mapping[str, float] | None = None) -> Plan:
    """What the scenario asks for. `starts`: values of channels at the start, which ranges that are not given follow.

    Raises ErrorList for patterns that match nothing and ranges that are none.
    """
    from gustform_runtime import Keep

    scenario = model.assembled.scenario
    block, every = scenario.output.statistics, scenario.output.every
    columns = _Columns(model)
    stored = len(columns.channels)
    if block is None:
        block = StatisticsBlock.model_validate({"of": ["moments"] if scenario.run.until >= FROM_SECONDS else []})
    every = block.every if block.every is not None else every
    if not block.of:
        return Plan(every, block.start, block, tuple(columns.channels), stored)
    watched = _watched(model, block, columns)
    spans = _spans(model, block, watched, starts or {})
    keeps = [_keep(Keep, block, every, one.column, span) for one, span in zip(watched, spans, strict=True)]
    limits: list[AtLimit] = []
    yields: list[Yield] = []
    for name, component in model.assembled.system.components.items():
        if not isinstance(component, PmsgTurbine):
            continue
        for limit in turbine_limits(name, component):
            found = columns.named(limit.channel)
            if found is not None:
                low, high = limit.edges
                edges = (low, high) if found[1] > 0 else (-high, -low)
                limits.append(AtLimit(name, limit, len(keeps)))
                keeps.append(Keep(found[0], edges=edges))
        power = [columns.named(f"{name}.{part}") for part in ("P", "P_reserve", "P_available")]
        if all(found is not None and found[1] > 0 for found in power):
            rating = float(component.rating) * float(component.aggregate)
            yields.append(Yield(name, rating, *(len(keeps) + k for k in range(3))))
            keeps += [Keep(found[0]) for found in power if found is not None]
    return Plan(
        every, block.start, block, tuple(columns.channels), stored, watched, tuple(limits), tuple(yields),
        tuple(keeps), spans,
    )  # fmt: skip


def needs_starts(model: Model) -> bool:
    """Whether ranges of histograms may follow what channels start with."""
    block = model.assembled.scenario.output.statistics
    return block is not None and bool({"histogram", "rainflow"} & set(block.of))


def _watched(model: Model, block: StatisticsBlock, columns: _Columns) -> tuple[Watched, ...]:
    if block.channels is None:
        return tuple(Watched(c.name, c.unit, c.description, k) for k, c in enumerate(model.channels))
    wanted, errors = [], []
    for index, pattern in enumerate(block.channels):
        expanded = expand(pattern, model.assembled.counts)
        try:
            columns.linked.select([expanded])
            wanted.append(expanded)
        except GustformError as error:
            path = ("output", "statistics", "channels", index)
            errors.append(
                GustformError(
                    "GF2406",
                    f"output.statistics.channels[{index}] must match a variable; none matches {pattern!r}",
                    hint=error.hint,
                    place=model.assembled.document.place(path),
                )
            )
    if errors:
        raise ErrorList(errors)
    found, aliases = columns.linked.select(wanted)
    best, _ = with_best_names(found, aliases, all_inputs(model.assembled))
    return tuple(Watched(c.name, c.unit, c.description, columns.of(c)) for c in best)


def _keep(keep: type[Keep], block: StatisticsBlock, every: float, column: int, span: tuple[float, float]) -> Keep:
    of = set(block.of)
    low, high = span
    rainflow = "rainflow" in of
    return keep(
        column,
        edges=np.linspace(low, high, block.bins + 1) if "histogram" in of else (),
        segment=segment_samples(block.segment, every) if "psd" in of else 0,
        exponents=tuple(block.wohler) if rainflow else (),
        ranges=block.bins if rainflow else 0,
        range_width=(high - low) / block.bins if rainflow else 0.0,
    )


def segment_samples(seconds: float, every: float) -> int:
    """The power of two of samples that is at least so long."""
    return max(_LEAST_SEGMENT, 1 << math.ceil(math.log2(max(1.0, seconds / every * (1.0 - 1e-9)))))


def _spans(
    model: Model, block: StatisticsBlock, watched: Sequence[Watched], starts: Mapping[str, float]
) -> tuple[tuple[float, float], ...]:
    """Where the histogram of each channel begins and ends: as given, by its unit, or by what it starts with."""
    spans: dict[str, tuple[float, float]] = {}
    errors = []
    for pattern, ends in block.ranges.items():
        path = ("output", "statistics", "ranges", pattern)
        names = expand(pattern, model.assembled.counts).replace("[", "[[]")  # a bracket is one, and no set of letters
        named = [one for one in watched if fnmatch.fnmatchcase(one.name, names)]
        try:
            if not named:
                raise GustformError(
                    "GF2406", f"output.statistics.ranges.{pattern} must match a channel that statistics are made of",
                    hint=", ".join(one.name for one in watched[:8]),
                )  # fmt: skip
            for one in named:
                low, high = (parse_quantity(end, one.unit, f"output.statistics.ranges.{pattern}") for end in ends)
                if not low < high:
                    raise GustformError(
                        "GF2003", f"output.statistics.ranges.{pattern} must be [lowest, highest]; got {shown(ends)}",
                        hint="[0, 1]",
                    )  # fmt: skip
                spans[one.name] = low, high
        except GustformError as error:
            place = model.assembled.document.place(path)
            errors.append(GustformError(error.code, error.message, hint=error.hint, place=place))
    if errors:
        raise ErrorList(errors)
    return tuple(spans.get(one.name) or _default_span(one, starts.get(one.name, 0.0)) for one in watched)


def _default_span(one: Watched, start: float) -> tuple[float, float]:
    if one.unit in _RANGES:
        return _RANGES[one.unit]
    # A power of two hides the last digits of the start, which need not be the same on every machine.
    reach = 2.0 ** math.ceil(math.log2(3.0 * max(abs(start), 1e-3))) if math.isfinite(start) else 1.0
    return -reach, reach


# ---- what came out --------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class ChannelStatistics:
    """All there is on one channel; None what was not asked for."""

    channel: Watched
    moments: Moments
    histogram: Histogram | None
    spectrum: Spectrum | None
    cycles: Cycles | None


@dataclass(frozen=True)
class LimitTime:
    """How long a turbine stood at a limit."""

    turbine: str
    limit: Limit
    seconds: float
    share: float  # of the time


@dataclass(frozen=True)
class Energy:
    """What a turbine delivered, and what it could have."""

    turbine: str
    seconds: float
    mean_power: float  # W
    rating: float  # W
    available: float  # mean, W
    reserve: float  # mean, W
    least_reserve: float  # W; below zero while inertia gives more than the wind

    @property
    def mwh(self) -> float:
        """Energy delivered, MWh."""
        return self.mean_power * self.seconds / 3.6e9

    @property
    def capacity_factor(self) -> float:
        """Mean power over rated power."""
        return self.mean_power / self.rating


@dataclass(frozen=True)
class Report:
    """The statistics of a run, up to the time it has reached."""

    plan: Plan
    channels: tuple[ChannelStatistics, ...]
    limits: tuple[LimitTime, ...]
    energies: tuple[Energy, ...]

    def equivalent_loads(self, one: ChannelStatistics) -> list[float]:
        """Damage-equivalent loads of 1 Hz, one for each slope: the range which so many cycles as there are seconds
        would do the same damage with. NaN without samples."""
        seconds = one.moments.count * self.plan.every
        if one.cycles is None or seconds <= 0.0:
            return [math.nan] * len(self.plan.block.wohler)
        return [float(load) for load in one.cycles.equivalent(self.plan.block.wohler, seconds)]


def report(plan: Plan, statistics: Statistics) -> Report:
    """What the runtime has counted so far."""
    of = set(plan.block.of)
    channels = tuple(
        ChannelStatistics(
            one,
            statistics.moments(k),
            statistics.histogram(k) if "histogram" in of else None,
            statistics.spectrum(k) if "psd" in of else None,
            statistics.cycles(k) if "rainflow" in of else None,
        )
        for k, one in enumerate(plan.watched)
    )
    limits = []
    for at in plan.limits:
        outside, count = statistics.histogram(at.keep), statistics.moments(at.keep).count
        beyond = outside.below + outside.above
        share = beyond / count if count else math.nan
        limits.append(LimitTime(at.turbine, at.limit, beyond * plan.every, share))
    energies = []
    for turbine in plan.yields:
        power, reserve = statistics.moments(turbine.power), statistics.moments(turbine.reserve)
        available = statistics.moments(turbine.available)
        energies.append(
            Energy(
                turbine.turbine,
                seconds=max(0, power.count - 1) * plan.every,
                mean_power=power.mean,
                rating=turbine.rating,
                available=available.mean * turbine.rating,
                reserve=reserve.mean * turbine.rating,
                least_reserve=reserve.minimum * turbine.rating,
            )
        )
    return Report(plan, channels, tuple(limits), tuple(energies))


def as_dict(found: Report) -> dict[str, Any]:
    """The keys of summary.json: statistics, energy, limits. What is no number is null."""
    result: dict[str, Any] = {}
    if found.channels:
        result["statistics"] = {one.channel.name: _channel_dict(found, one) for one in found.channels}
    if found.energies:
        result["energy"] = {
            one.turbine: _numbers(
                energy_mwh=one.mwh, mean_power_mw=one.mean_power / 1e6, capacity_factor=one.capacity_factor,
                rated_power_mw=one.rating / 1e6,
                available_mwh=one.available * one.seconds / 3.6e9, reserve_mean_mw=one.reserve / 1e6,
                reserve_least_mw=one.least_reserve / 1e6, seconds=one.seconds,
            )
            for one in found.energies
        }  # fmt: skip
    limits: dict[str, dict[str, Any]] = {}
    for at in found.limits:
        limits.setdefault(at.turbine, {})[at.limit.name] = {
            **_numbers(seconds=at.seconds, share=at.share),
            "when": at.limit.condition,
        }
    if limits:
        result["limits"] = limits
    return result


def _channel_dict(found: Report, one: ChannelStatistics) -> dict[str, Any]:
    moments = one.moments
    result: dict[str, Any] = {
        "unit": one.channel.unit,
        **_numbers(
            mean=moments.mean, std=moments.deviation, min=moments.minimum, max=moments.maximum,
            min_time_s=moments.t_minimum, max_time_s=moments.t_maximum,
        ),
        "samples": moments.count,
    }  # fmt: skip
    if moments.not_finite:
        result["not_finite"] = moments.not_finite
    if one.cycles is not None:
        loads = found.equivalent_loads(one)
        result["damage_equivalent_load"] = _numbers(
            **{f"{m:g}": load for m, load in zip(found.plan.block.wohler, loads, strict=True)}
        )
        result["cycles"] = one.cycles.full + 0.5 * one.cycles.half
    return result


def _numbers(**values: float) -> dict[str, float | None]:
    return {name: value if math.isfinite(value) else None for name, value in values.items()}

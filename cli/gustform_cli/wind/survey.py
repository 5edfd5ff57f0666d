"""One pass over a table before the run: what is wrong with it, its mean, and where its samples begin in the file.

The pass goes through the table in blocks and as far as the run needs it. It leaves an index of bounded size, so that
`TableWind` can deliver samples from any number on without reading all that comes before.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.wind.clean import HIGHEST_SPEED, LOWEST_SPEED, Findings, Policy, State, Tally, clean
from gustform_cli.wind.table import Position, Rows, TableFile, place

_MOST_ENTRIES = 2048  # of the index; beyond, every other one goes
_STANDSTILL = 8  # equal samples in a row, over which a solver's steps grow beyond the spacing of the samples


@dataclass(frozen=True)
class Entry:
    """Where sample `sample` comes from: the block at `position` without its first `skip` rows, after `state`."""

    sample: int
    position: Position | None
    skip: int
    state: State


@dataclass(frozen=True)
class Survey:
    """A table that has been gone through. Times s from the start of the run, speeds m/s."""

    table: TableFile
    policy: Policy
    index: tuple[Entry, ...]
    samples: int
    first: float
    last: float
    mean: float
    deviation: float
    longest_step: float  # of a solver that is to miss no sample, s; infinite where the wind always moves
    findings: Findings
    warnings: tuple[str, ...]

    @property
    def spacing(self) -> float:
        """Mean distance of two samples, s."""
        return (self.last - self.first) / max(1, self.samples - 1)


def survey(table: TableFile, policy: Policy, until: float) -> Survey:
    """Go through a table up to the time `until`, s.

    Raises what the table raises, GF2502 without a valid row, GF2504 stamps that do not increase, GF2505 missing
    values, GF2506 if the table does not cover the start of the run, GF2507 speeds that no wind has, GF2510 gaps.
    """
    begin = _begin(table)
    if policy.spacing is None and not table.polyline:
        policy = replace(policy, spacing=_regular(table, begin))
    if policy.gaps == "skip" and policy.spacing is None:
        raise GustformError(
            "GF2510",
            "gaps: skip needs rows at equal distances; those of the wind file are not",
            hint="every: with the spacing of the rows",
            place=place(table),
        )
    findings, moments, index = Findings(), _Moments(), list[Entry]()
    samples, first, last, stride, state = 0, math.nan, math.nan, 1, State()
    longest_step = math.inf
    for number, (position, skip, rows) in enumerate(_walk(table, begin)):
        if number % stride == 0:
            index.append(Entry(samples, position, skip, state))
            if len(index) > _MOST_ENTRIES:
                index, stride = index[::2], stride * 2
        times, _, origin, _ = clean(rows, state, policy)
        reached = np.flatnonzero(times >= until)
        if reached.size:  # what comes after is no concern of this run
            end = int(origin[reached[0]]) + 1
            rows = _part(rows, slice(0, end))
        times, speeds, _, state = clean(rows, state, policy, findings)
        if times.size:
            first = float(times[0]) if samples == 0 else first
            last = float(times[-1])
            samples += times.size
            moments.add(times, speeds)
            longest_step = min(longest_step, _longest_step(times, speeds, policy.spacing))
        if reached.size:
            break
    _judge(table, policy, findings)
    warnings = (*table.warnings, *_warnings(table, policy, findings))
    return Survey(
        table, policy, tuple(index), samples, first, last, moments.mean, moments.deviation, longest_step, findings,
        warnings,
    )  # fmt: skip


class TableWind:
    """Samples of a table that has been gone through: the reader of a runtime series. Each run needs one of its own."""

    def __init__(self, survey: Survey) -> None:
        self._survey = survey
        self._numbers = [entry.sample for entry in survey.index]
        self._go(0)

    def _go(self, entry: int) -> None:
        """Begin again where an entry of the index says."""
        self._source = self._samples(self._survey.index[entry])
        self._first = self._numbers[entry]  # number of the first sample held
        self._times: NDArray[np.float64] = np.empty(0)
        self._speeds: NDArray[np.float64] = np.empty(0)

    def _samples(self, entry: Entry) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        state = entry.state
        for _, _, rows in _walk(self._survey.table, entry):
            times, speeds, _, state = clean(rows, state, self._survey.policy)
            yield times, speeds

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end."""
        count = max(0, min(count, self._survey.samples - first))
        if count == 0:
            return np.empty(0), np.empty(0)
        entry = bisect.bisect_right(self._numbers, first) - 1
        if first < self._first or self._numbers[entry] > self._first + self._times.size:
            self._go(entry)
        while self._first + self._times.size < first + count:
            times, speeds = next(self._source)
            drop = min(max(first - self._first, 0), self._times.size)
            self._first += drop
            self._times = np.concatenate((self._times[drop:], times))
            self._speeds = np.concatenate((self._speeds[drop:], speeds))
        start = first - self._first
        return self._times[start : start + count], self._speeds[start : start + count]


# ---- going through --------------------------------------------------------------------------------------------------
def _walk(table: TableFile, entry: Entry) -> Iterator[tuple[Position, int, Rows]]:
    """The blocks from an entry on: position, rows skipped, rows."""
    skip = entry.skip
    for rows in table.blocks(entry.position):
        yield rows.position, skip, _part(rows, slice(skip, None)) if skip else rows
        skip = 0


def _part(rows: Rows, which: slice) -> Rows:
    return Rows(rows.position, rows.labels[which], rows.times[which], rows.speeds[which])


def _begin(table: TableFile) -> Entry:
    """The last valid row at or before the start of the run. GF2506 if there is none, GF2502 without any valid row."""
    found: Entry | None = None
    latest = math.nan
    for rows in table.blocks():
        valid = np.isfinite(rows.times) & np.isfinite(rows.speeds)
        before, after = (np.flatnonzero(valid & side) for side in (rows.times <= 0.0, rows.times > 0.0))
        if after.size:
            before = before[before < after[0]]
        if before.size:
            latest = float(rows.times[before[-1]])
            first = int(before[rows.times[before] == latest][0])  # the others are duplicates of it
            found = Entry(0, rows.position, first, State())
        if after.size:
            if found is not None:
                return found
            raise GustformError(
                "GF2506",
                f"the wind file must cover the run from its start, {table.shown(0.0)}; its first valid row is at "
                f"{table.shown(float(rows.times[after[0]]))}",
                hint="start: with a later time, or times that count from the start of the run",
                place=place(table),
            )
    if found is None:
        raise GustformError(
            "GF2502",
            "the wind file must have rows with a time and a speed; it has none",
            hint="other columns",
            place=place(table),
        )
    if latest < 0.0:
        raise GustformError(
            "GF2506",
            f"the wind file must cover the start of the run, {table.shown(0.0)}; it ends at {table.shown(latest)}",
            hint=f"start: {table.shown(latest)} or earlier",
            place=place(table),
        )
    return found


def _regular(table: TableFile, begin: Entry) -> float | None:
    """The spacing of a regular table, s, as its first block shows it; None if the rows come at any distance."""
    for _, _, rows in _walk(table, begin):
        steps = np.diff(rows.times[np.isfinite(rows.times)])
        steps = steps[steps > 0.0]
        if steps.size < 2:
            return None
        usual = float(np.median(steps))
        equal = np.abs(steps - usual) < 0.01 * usual
        return usual if np.count_nonzero(equal) >= 0.8 * steps.size else None
    return None


def _longest_step(times: NDArray[np.float64], speeds: NDArray[np.float64], spacing: float | None) -> float:
    """Where a wind stands still, a free-running solver takes long steps; a gust that comes after and passes again
    within one of them would be missed. In a regular table steps are then no longer than its spacing, in a polyline half
    the shortest time in which the wind leaves a speed that it had kept and comes back to it."""
    still = np.diff(speeds) == 0.0
    if spacing is not None:
        kept = np.diff(np.flatnonzero(np.concatenate(([True], ~still, [True]))))
        return spacing if kept.size and kept.max() >= _STANDSTILL else math.inf
    shortest = math.inf
    for leaving in np.flatnonzero(still[:-1] & ~still[1:]) + 1:
        away = np.sign(speeds[leaving + 1 :] - speeds[leaving])
        back = np.flatnonzero(away != away[0])
        if back.size:
            shortest = min(shortest, float(times[leaving + 1 + back[0]] - times[leaving]))
    return 0.5 * shortest


class _Moments:
    """Mean and standard deviation over time of what linear interpolation makes of the samples."""

    def __init__(self) -> None:
        self._length = self._first = self._second = 0.0
        self._last: tuple[float, float] | None = None

    def add(self, times: NDArray[np.float64], speeds: NDArray[np.float64]) -> None:
        """The next samples."""
        if self._last is None:
            self._offset = float(speeds[0])
        else:
            times, speeds = np.append(self._last[0], times), np.append(self._last[1], speeds)
        self._last = float(times[-1]), float(speeds[-1])
        step, v = np.diff(times), speeds - self._offset
        a, b = v[:-1], v[1:]
        self._length += float(step.sum())
        self._first += float((step * (a + b)).sum()) / 2.0
        self._second += float((step * (a * a + a * b + b * b)).sum()) / 3.0

    @property
    def mean(self) -> float:
        return self._offset + (self._first / self._length if self._length else 0.0)

    @property
    def deviation(self) -> float:
        if not self._length:
            return 0.0
        return math.sqrt(max(0.0, self._second / self._length - (self._first / self._length) ** 2))


# ---- what is wrong --------------------------------------------------------------------------------------------------
def _kinds(table: TableFile, found: Findings) -> dict[str, tuple[Tally, str]]:
    """What was found, in words."""

    def at(tally: Tally) -> str:
        return tally.where(table.counted, table.shown)

    return {
        "missing": (found.missing, f"{_many(found.missing, 'value')} missing or NaN in {at(found.missing)}"),
        "decreasing": (
            found.decreasing,
            f"{_many(found.decreasing, 'stamp')} earlier than one before, in {at(found.decreasing)}",
        ),
        "duplicate": (found.duplicate, f"{_many(found.duplicate, 'duplicate stamp')}, in {at(found.duplicate)}"),
        "gaps": (
            found.gaps,
            f"{_many(found.gaps, 'gap')}, the longest {duration(found.longest)}, before {at(found.gaps)}",
        ),
    }


def _many(tally: Tally, what: str) -> str:
    return f"{tally.count} {what}{'s' if tally.count > 1 else ''}"


def duration(seconds: float) -> str:
    """A length of time for people."""
    for unit, size in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.4g} {unit}"
    return f"{seconds:.4g} s"


def _judge(table: TableFile, policy: Policy, found: Findings) -> None:
    """Raise what the policy does not let pass; the other faults stand in the same message."""
    kinds = _kinds(table, found)
    if found.outside.count:
        tally = found.outside
        raise GustformError(
            "GF2507",
            f"the speeds of the wind file must be 0 ... {HIGHEST_SPEED:g} m/s; {tally.count} "
            f"{'are' if tally.count > 1 else 'is'} not, the first {found.first_outside:g} m/s, in "
            f"{tally.where(table.counted, table.shown)}",
            hint="missing: with the numbers that stand for no value, or another unit",
            place=place(table, tally.labels[0]),
        )
    if policy.gaps == "error":
        for kind, code, wanted, hint in (
            ("missing", "GF2505", "have a number in every row", "gaps: interpolate, hold or skip"),
            ("decreasing", "GF2504", "have times that increase from row to row", "sorting it, or gaps: interpolate"),
            ("duplicate", "GF2504", "have times that increase from row to row", "removing them, or gaps: interpolate"),
            ("gaps", "GF2510", "have no gaps", "gaps: interpolate, hold or skip"),
        ):
            tally, text = kinds[kind]
            if tally.count == 0:
                continue
            others = [words for other, (more, words) in kinds.items() if other not in (kind, "gaps") and more.count]
            if kind != "gaps" and found.gaps.count > found.missing.count:  # each missing value makes a gap as well
                others.append(kinds["gaps"][1])
            raise GustformError(
                code,
                f"the wind file must {wanted}; {'; '.join([text, *others])}",
                hint=hint,
                place=place(table, tally.labels[0]),
            )
    elif policy.gaps in ("hold", "interpolate") and found.too_long.count:
        raise GustformError(
            "GF2510",
            f"no gap of the wind file may be longer than longest_gap, {duration(policy.longest_gap)}; "
            f"{_many(found.too_long, 'gap')} {'are' if found.too_long.count > 1 else 'is'}, the longest "
            f"{duration(found.longest)}, before {found.too_long.where(table.counted, table.shown)}",
            hint=f"longest_gap: {duration(found.longest)}, gaps: skip, or another start",
            place=place(table, found.too_long.labels[0]),
        )


def _warnings(table: TableFile, policy: Policy, found: Findings) -> list[str]:
    done = {"hold": "held", "interpolate": "interpolated", "skip": "closed up"}.get(policy.gaps, "")
    kinds = _kinds(table, found)
    result = []
    if found.gaps.count:
        more = f", {duration(found.removed)} in all: the calendar no longer fits" if policy.gaps == "skip" else ""
        missing = f" ({_many(found.missing, 'value')} missing or NaN)" if found.missing.count else ""
        result.append(f"{kinds['gaps'][1]}{missing}: {done}{more}")
    result += [f"{kinds[kind][1]}: left out" for kind in ("duplicate", "decreasing") if kinds[kind][0].count]
    if found.calm:
        result.append(f"{found.calm} speed{'s' if found.calm > 1 else ''} below {LOWEST_SPEED:g} m/s: raised to it")
    return result

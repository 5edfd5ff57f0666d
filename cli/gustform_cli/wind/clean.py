"""From the rows of a table to samples: what becomes of gaps, of missing values, and of stamps that do not increase.

A *gap* lies between two valid rows when rows between them have no speed, or when their distance is more than one and
a half times the spacing of a regular table. `gaps` says what becomes of it:

error        nothing may be missing
hold         the last valid speed holds until one spacing before the next valid row
interpolate  a straight line (or the PCHIP curve) leads from one valid row to the next
skip         the time of the gap is closed up: the next valid row comes one spacing after the last

Under hold and interpolate no gap may be longer than `longest_gap`. Under all but error, rows whose stamp does not
come after all stamps before it are left out, and everything is counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gustform_cli.wind.table import Rows

# The rotor equations know no standstill wind; calm is raised to this, m/s.
LOWEST_SPEED = 0.5
HIGHEST_SPEED = 100.0
_SHOWN = 3  # places named in a message
_APART = 1.5  # spacings between two rows, from which on something is missing between them


@dataclass(frozen=True)
class Policy:
    """What becomes of gaps. Times in s; `spacing` None: rows may come at any distance."""

    gaps: str = "error"
    longest_gap: float = np.inf
    spacing: float | None = None


@dataclass(frozen=True)
class State:
    """What is known of the rows before a block."""

    stamp: float = -np.inf  # the latest of all stamps, s
    row: float = np.nan  # time of the last row kept, with a speed or without
    time: float = np.nan  # time of the last valid row
    speed: float = np.nan  # its speed, m/s
    missing: bool = False  # rows without a speed came after it
    removed: float = 0.0  # closed up so far, s


@dataclass
class Tally:
    """How many, and where the first few are."""

    count: int = 0
    labels: list[int] = field(default_factory=list)
    times: list[float] = field(default_factory=list)

    def add(self, labels: NDArray[np.int64], times: NDArray[np.float64]) -> None:
        """More of them, in order."""
        self.count += labels.size
        room = _SHOWN - len(self.labels)
        if room > 0:
            self.labels += labels[:room].tolist()
            self.times += times[:room].tolist()

    def where(self, counted: str, shown: Callable[[float], str]) -> str:
        """The first few: "at lines 4 (2.5 s), 7 (5 s), ..."."""
        places = [
            f"{label} ({shown(time)})" if np.isfinite(time) else str(label)
            for label, time in zip(self.labels, self.times, strict=True)
        ]
        more = ", ..." if self.count > len(places) else ""
        return f"{counted}{'s' if self.count > 1 else ''} {', '.join(places)}{more}"


@dataclass
class Findings:
    """What was found in the rows so far."""

    rows: int = 0
    missing: Tally = field(default_factory=Tally)  # rows without a speed or without a time
    duplicate: Tally = field(default_factory=Tally)  # stamps equal to one before
    decreasing: Tally = field(default_factory=Tally)  # stamps before the latest one
    gaps: Tally = field(default_factory=Tally)  # by the row behind the gap
    too_long: Tally = field(default_factory=Tally)
    outside: Tally = field(default_factory=Tally)  # speeds that no wind has
    first_outside: float = np.nan
    calm: int = 0  # speeds raised to the lowest
    longest: float = 0.0  # longest time between two valid rows of a gap, s
    removed: float = 0.0  # closed up, s


def clean(
    rows: Rows, state: State, policy: Policy, found: Findings | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp], State]:
    """Times and speeds of the samples in a block, the row of the block that each came from, and what the next block
    needs to know. Counts what it sees in `found`."""
    stamped = np.isfinite(rows.times)
    latest = np.maximum.accumulate(np.concatenate(([state.stamp], np.where(stamped, rows.times, -np.inf))))
    late = stamped & (rows.times <= latest[:-1])
    empty = ~np.isfinite(rows.speeds)
    if found is not None:
        found.rows += rows.times.size
        same = late & (rows.times == latest[:-1])
        found.duplicate.add(rows.labels[same], rows.times[same])
        found.decreasing.add(rows.labels[late & ~same], rows.times[late & ~same])
        lost = (empty | ~stamped) & ~late
        found.missing.add(rows.labels[lost], rows.times[lost])
    kept = np.flatnonzero(stamped & ~late)
    times, speeds = rows.times[kept], rows.speeds[kept]
    valid = np.flatnonzero(~empty[kept])
    good = speeds[valid]
    if found is not None:
        wrong = (good < 0.0) | (good > HIGHEST_SPEED)
        if wrong.any() and found.outside.count == 0:
            found.first_outside = float(good[wrong][0])
        found.outside.add(rows.labels[kept[valid[wrong]]], times[valid[wrong]])
        found.calm += int(np.count_nonzero(good < LOWEST_SPEED))
    speeds = np.maximum(speeds, LOWEST_SPEED)  # NaN stays
    gap, step = _gaps(times, valid, state, policy, found, rows.labels[kept])
    end = State(
        stamp=float(latest[-1]),
        row=float(times[-1]) if times.size else state.row,
        time=float(times[valid[-1]]) if valid.size else state.time,
        speed=float(speeds[valid[-1]]) if valid.size else state.speed,
        missing=bool(valid[-1] < times.size - 1) if valid.size else state.missing or times.size > 0,
        removed=state.removed,
    )
    if policy.gaps == "hold":
        return *_held(times, speeds, kept, state, policy), end
    samples, values, origin = times[valid], speeds[valid], kept[valid]
    if policy.gaps == "skip" and policy.spacing is not None:
        cut = np.where(gap, np.maximum(step - policy.spacing, 0.0), 0.0)
        removed = state.removed + np.cumsum(cut)
        if removed.size:
            end = State(end.stamp, end.row, end.time, end.speed, end.missing, float(removed[-1]))
        if found is not None:
            found.removed = end.removed
        samples = samples - removed
    return samples, values, origin, end


def _gaps(
    times: NDArray[np.float64],
    valid: NDArray[np.intp],
    state: State,
    policy: Policy,
    found: Findings | None,
    labels: NDArray[np.int64],
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """For each valid row whether a gap lies before it, and the time from the valid row before, s."""
    at = times[valid]
    step = np.diff(at, prepend=state.time)
    if step.size and np.isnan(step[0]):
        step[0] = 0.0  # the very first row
    gap = np.diff(valid, prepend=-1) > 1
    if gap.size and state.missing:
        gap[0] = True
    if policy.spacing is not None:
        gap |= step > _APART * policy.spacing
    if found is not None and gap.any():
        found.gaps.add(labels[valid[gap]], at[gap])
        found.longest = max(found.longest, float(step[gap].max()))
        long = gap & (step > policy.longest_gap * (1.0 + 1e-9))
        found.too_long.add(labels[valid[long]], at[long])
    return gap, step


def _held(
    times: NDArray[np.float64], speeds: NDArray[np.float64], kept: NDArray[np.intp], state: State, policy: Policy
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
    """Missing speeds are the last valid one; where rows are missing, one sample is put before the next row."""
    filled = np.concatenate(([state.speed], speeds))
    source = np.maximum.accumulate(np.where(np.isfinite(filled), np.arange(filled.size), 0))
    filled = filled[source]
    before, values = filled[:-1], filled[1:]
    if policy.spacing is None or times.size == 0:
        return times, values, kept
    step = np.diff(times, prepend=state.row)
    put = np.flatnonzero(step > _APART * policy.spacing)
    return (
        np.insert(times, put, times[put] - policy.spacing),
        np.insert(values, put, before[put]),
        np.insert(kept, put, kept[put]),
    )

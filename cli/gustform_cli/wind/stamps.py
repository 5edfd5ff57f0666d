"""Times of a wind file: numbers with a unit, or moments of the calendar with or without a zone.

The run starts at `start`: a number of seconds, a moment, or by itself the first moment of the file (of numbers: 0).
A `start` without an offset is on the clock of the file: in `time_zone` where that is given, otherwise with the offset
of the first stamp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError

_EPOCH = datetime(1970, 1, 1)
_QUARTER = 900 * 10**9  # ns; no clock has been changed at other times since 1972
NOT_A_TIME = np.iinfo(np.int64).min


@dataclass(frozen=True)
class Clock:
    """What a scenario says about the times of a file."""

    factor: float = 1.0  # of numbers, s
    zone: str | None = None
    start: float | datetime | None = None
    form: str | None = None  # of moments that are not ISO 8601, for strptime


@dataclass(frozen=True)
class Stamps:
    """Turns the times of one file into seconds from the start of the run."""

    factor: float = 1.0
    start: float = 0.0  # s, of numbers
    origin: int = 0  # ns since 1970 in UTC, or on the file's own clock if it has no zone
    zone: tzinfo | None = None  # in which moments are shown
    local: ZoneInfo | None = None  # of stamps that have no offset of their own
    calendar: bool = False

    def from_numbers(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Seconds from numbers in the file's unit."""
        result: NDArray[np.float64] = values * self.factor - self.start
        return result

    def from_moments(self, moments: NDArray[np.int64]) -> NDArray[np.float64]:
        """Seconds from ns since 1970."""
        result = (moments - self.origin) / 1e9
        result[moments == NOT_A_TIME] = np.nan
        return result

    def shown(self, time: float) -> str:
        """A time as the file writes it."""
        if not math.isfinite(time):
            return "no time"
        if not self.calendar:
            return f"{time + self.start:.10g} s"
        moment = _EPOCH + timedelta(microseconds=self.origin // 1000) + timedelta(seconds=time)
        if self.zone is not None:
            moment = moment.replace(tzinfo=UTC).astimezone(self.zone)
        return moment.isoformat(sep=" ", timespec="auto")


def zone_of(name: str) -> ZoneInfo:
    """The time zone called `name`; ValueError if there is none."""
    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError) as error:
        raise ValueError(name) from error


def numbered(clock: Clock) -> Stamps:
    """Stamps that are numbers."""
    if isinstance(clock.start, datetime):
        raise GustformError(
            "GF2511",
            f"start must be a number of seconds, because the times of the file are numbers; got {clock.start}",
            hint="start: 0 s",
        )
    return Stamps(factor=clock.factor, start=clock.start or 0.0)


def dated(clock: Clock, first: int, offset: timedelta | None) -> Stamps:
    """Stamps that are moments, of which `first` is the first: in UTC where they have an `offset`, and otherwise on the
    clock of `clock.zone` (already in UTC) or a clock unknown."""
    local = zone_of(clock.zone) if clock.zone is not None else None
    zone: tzinfo | None = local if local is not None else timezone(offset) if offset is not None else None
    start = clock.start
    if isinstance(start, datetime):
        if start.tzinfo is None and zone is not None:
            start = start.replace(tzinfo=zone)
        if start.tzinfo is not None and zone is None:
            raise GustformError(
                "GF2511",
                f"start must have no offset, because the stamps of the file have none; got {start.isoformat()}",
                hint="time_zone: with the zone of the stamps, e.g. Europe/Paris",
            )
        origin = nanoseconds(start)
    else:
        origin = first + round((start or 0.0) * 1e9)
    return Stamps(origin=origin, zone=zone, local=local if offset is None else None, calendar=True)


def nanoseconds(moment: datetime) -> int:
    """ns since 1970, in UTC if the moment has an offset."""
    if moment.tzinfo is not None:
        moment = moment.astimezone(UTC).replace(tzinfo=None)
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def _offset(moment: datetime) -> int:
    """How far the clock is ahead of UTC, ns."""
    return (moment.utcoffset() or timedelta(0)) // timedelta(microseconds=1) * 1000


def to_utc(moments: NDArray[np.int64], zone: ZoneInfo, before: int) -> NDArray[np.int64]:
    """Moments on the clock of a zone in UTC, ns.

    An hour that the clock shows twice is the first one until the stamps step back; `before` is the moment, in UTC, of
    the row before.
    """
    known = moments != NOT_A_TIME
    quarters, which = np.unique(np.where(known, moments, 0) // _QUARTER, return_inverse=True)
    clock = [_EPOCH + timedelta(seconds=int(quarter) * 900) for quarter in quarters]
    early, late = (
        np.array([_offset(moment.replace(tzinfo=zone, fold=fold)) for moment in clock], dtype=np.int64)[which]
        for fold in (0, 1)
    )
    result = np.where(known, moments - early, NOT_A_TIME)
    twice = known & (late < early)
    for row in np.flatnonzero(twice):
        behind = result[row - 1] if row > 0 else before
        if result[row] <= behind:
            result[row] = moments[row] - late[row]
    return result

"""What a reader looks for in a grid frequency: nadir, settling value and rate of change, found as rows come."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

SETTLE_AFTER = 60.0  # s after the event; the paper reads its settling frequencies there
ROCOF_WINDOW = 0.1  # s


@dataclass
class FrequencyWatch:
    """Fed with blocks of rows in order. `event` is the time of the first event, None without one; times in s, Hz."""

    event: float | None
    until: float
    nadir: float = math.inf
    nadir_time: float = math.nan
    _samples: dict[float, float] = field(default_factory=dict)
    _last: tuple[float, float] | None = None

    @property
    def _targets(self) -> tuple[float, ...]:
        if self.event is None:
            return (self.until,)
        return (self.event, self.event + ROCOF_WINDOW, min(self.event + SETTLE_AFTER, self.until))

    def add(self, times: NDArray[np.float64], hertz: NDArray[np.float64]) -> None:
        """One block: nadir from the event on, and the values at the moments of interest, interpolated linearly."""
        if times.size == 0:
            return
        if self._last is not None:  # the row before, so that no interval is lost between blocks
            times, hertz = np.append(self._last[0], times), np.append(self._last[1], hertz)
        after = times >= (self.event if self.event is not None else -math.inf)
        if after.any():
            lowest = int(np.argmin(np.where(after, hertz, np.inf)))
            if hertz[lowest] < self.nadir:
                self.nadir, self.nadir_time = float(hertz[lowest]), float(times[lowest])
        for target in self._targets:
            # A hair beyond the last row: output times are multiples of a step that is no binary fraction.
            if times[0] <= target <= times[-1] + 1e-9 * max(1.0, target):
                self._samples[target] = float(np.interp(target, times, hertz))
        self._last = float(times[-1]), float(hertz[-1])

    def state(self) -> dict[str, Any]:
        """All of it, for a checkpoint."""
        return {
            "nadir": self.nadir,
            "nadir_time": self.nadir_time,
            "samples": sorted(self._samples.items()),
            "last": self._last,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state."""
        self.nadir, self.nadir_time = state["nadir"], state["nadir_time"]
        self._samples = dict(state["samples"])
        self._last = tuple(state["last"]) if state["last"] is not None else None

    def summary(self, every: float) -> dict[str, float | None]:
        """The `frequency` part of summary.json; None where the run or its rows do not reach."""
        targets = self._targets
        settle = self._samples.get(targets[-1])
        if settle is None and self._last is not None:
            settle = self._last[1]  # stopped earlier: the end of what there is
        rocof = None
        if self.event is not None and every <= ROCOF_WINDOW:
            before, behind = self._samples.get(targets[0]), self._samples.get(targets[1])
            if before is not None and behind is not None:
                rocof = (behind - before) / ROCOF_WINDOW
        found = math.isfinite(self.nadir)
        return {
            "nadir_hz": self.nadir if found else None,
            "nadir_time_s": self.nadir_time if found else None,
            "settle_hz": settle,
            "rocof_hz_per_s": rocof,
        }

"""What the grid frequency does after each event of the scenario: nadir, peak, rate of change, settling.

An event is looked at from its moment to the next event, for a minute at most. Frequencies are taken from the rows
where these are close enough, or sampled apart every `SAMPLES` seconds; the samples of one window are all that is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform_cli.frequency import ROCOF_WINDOW, SETTLE_AFTER

SAMPLES = 0.05  # s between frequencies, at most
SETTLED_SHARE = 0.05  # of the largest excursion from where it settles
SETTLED_LEAST = 1e-3  # Hz

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Window:
    """An event and how long it is looked at, s."""

    at: float
    end: float
    changes: Mapping[str, Any]


def windows(events: Sequence[tuple[float, Mapping[str, Any]]], until: float) -> tuple[Window, ...]:
    """One for each moment at which events happen before the end of the run."""
    together: dict[float, dict[str, Any]] = {}
    for at, changes in sorted(events, key=lambda event: event[0]):
        if at < until:
            together.setdefault(at, {}).update(changes)
    moments = [*together, until]
    return tuple(Window(at, min(following, at + SETTLE_AFTER), together[at]) for at, following in pairwise(moments))


@dataclass
class EventWatch:
    """Fed with frequencies in the order of time, blocks of any size."""

    windows: tuple[Window, ...]
    figures: list[dict[str, float | None]] = field(default_factory=list)  # of the windows that are over
    _times: list[Floats] = field(default_factory=list)
    _hertz: list[Floats] = field(default_factory=list)

    def add(self, times: Floats, hertz: Floats) -> None:
        """One block."""
        while len(self.figures) < len(self.windows) and times.size:
            window = self.windows[len(self.figures)]
            # A hair beyond: row times are multiples of a step that is no binary fraction.
            hair = 1e-9 * max(1.0, window.end)
            inside = (times >= window.at - hair) & (times <= window.end + hair)
            if inside.any():
                self._times.append(times[inside])
                self._hertz.append(hertz[inside])
            if times[-1] < window.end - hair:
                return
            self._close(window)
            rest = times >= window.end - hair  # the last one may begin the next window
            times, hertz = times[rest], hertz[rest]

    def _close(self, window: Window) -> None:
        empty: Floats = np.empty(0)
        times, hertz = np.concatenate([empty, *self._times]), np.concatenate([empty, *self._hertz])
        self.figures.append(event_figures(window, times, hertz))
        self._times, self._hertz = [], []

    def summary(self) -> list[dict[str, Any]]:
        """The `events` of summary.json; a window that the run left open is taken as far as it goes."""
        figures = list(self.figures)
        if self._times:
            window = self.windows[len(figures)]
            figures.append(event_figures(window, np.concatenate(self._times), np.concatenate(self._hertz)))
        return [
            {"at_s": window.at, "set": dict(window.changes), **found}
            for window, found in zip(self.windows, figures, strict=False)
        ]

    def state(self) -> dict[str, Any]:
        """All of it, for a checkpoint."""
        return {
            "figures": self.figures,
            "times": [float(t) for block in self._times for t in block],
            "hertz": [float(f) for block in self._hertz for f in block],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from a state."""
        self.figures = list(state["figures"])
        self._times, self._hertz = [], []
        if state["times"]:
            self._times, self._hertz = [np.array(state["times"])], [np.array(state["hertz"])]


def event_figures(window: Window, times: Floats, hertz: Floats) -> dict[str, float | None]:
    """Figures of one event; None where the samples do not reach.

    `rocof_hz_per_s`: mean rate over the first 100 ms. `settle_hz`: at the end of the window. `settling_time_s`: after
    the event, from when on the frequency stays within 5 % of its largest excursion from there, or 1 mHz if that is
    more.
    """
    result: dict[str, float | None] = dict.fromkeys(
        ("nadir_hz", "nadir_time_s", "peak_hz", "peak_time_s", "rocof_hz_per_s", "settle_hz", "settling_time_s")
    )
    if not times.size:
        return result
    low, high = int(np.argmin(hertz)), int(np.argmax(hertz))
    result.update(
        nadir_hz=float(hertz[low]), nadir_time_s=float(times[low]),
        peak_hz=float(hertz[high]), peak_time_s=float(times[high]),
    )  # fmt: skip
    hair = 1e-9 * max(1.0, window.end)
    first = window.at + ROCOF_WINDOW
    close = times.size > 1 and float(np.max(np.diff(times[: int(np.searchsorted(times, first)) + 1]))) <= ROCOF_WINDOW
    if times[0] <= window.at + hair and times[-1] >= first - hair and close:
        before, behind = np.interp([window.at, first], times, hertz)
        result["rocof_hz_per_s"] = float(behind - before) / ROCOF_WINDOW
    if times[-1] >= window.end - hair:
        settled = float(hertz[-1])
        away = np.abs(hertz - settled)
        outside = np.flatnonzero(away > max(SETTLED_SHARE * float(away.max()), SETTLED_LEAST))
        result["settle_hz"] = settled
        result["settling_time_s"] = float(times[outside[-1] + 1] - window.at) if outside.size else 0.0
    return result

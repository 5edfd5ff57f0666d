"""Samples that are taken from outside of the solver: it goes to their moment, where all channels are read.

Rows in single precision come out of the solver by themselves and cost less. This is for rows in double precision, and
for the frequency after an event where rows are too far apart. Stopping there does not change a step of the solver.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from gustform_cli.grid_events import SAMPLES, Window

if TYPE_CHECKING:
    from gustform_runtime import Simulation, Status

Floats = NDArray[np.float64]
_ROUND_OFF = 1e-12  # relative: times that differ by less are one


class Sampler(Protocol):
    """`next`: when it wants its next sample, s; infinite when it wants no more."""

    @property
    def next(self) -> float: ...

    @property
    def state(self) -> list[int]:
        """Where it is, for a checkpoint."""
        ...

    def restore(self, state: list[int]) -> None:
        """Go on from there."""
        ...

    def take(self, row: Floats) -> None:
        """All channels at that time."""
        ...


class RowSampler:
    """A row each `every` seconds."""

    def __init__(self, every: float, receive: Callable[[Floats, Floats], None]) -> None:
        self.number = 0
        self._every, self._receive = every, receive

    @property
    def next(self) -> float:
        return self.number * self._every

    @property
    def state(self) -> list[int]:
        return [self.number]

    def restore(self, state: list[int]) -> None:
        (self.number,) = state

    def take(self, row: Floats) -> None:
        self._receive(np.array([self.next]), row[None, :])
        self.number += 1


class WindowSampler:
    """One column each 50 ms while a window is open."""

    def __init__(self, windows: tuple[Window, ...], column: int, receive: Callable[[Floats, Floats], None]) -> None:
        self._windows, self._column, self._receive = windows, column, receive
        self.window, self.number = 0, 0

    @property
    def next(self) -> float:
        if self.window >= len(self._windows):
            return np.inf
        window = self._windows[self.window]
        return min(window.at + self.number * SAMPLES, window.end)

    @property
    def state(self) -> list[int]:
        return [self.window, self.number]

    def restore(self, state: list[int]) -> None:
        self.window, self.number = state

    def take(self, row: Floats) -> None:
        now = self.next
        self._receive(np.array([now]), row[self._column : self._column + 1])
        self.number += 1
        while self.window < len(self._windows) and now >= self._windows[self.window].end:
            self.window, self.number = self.window + 1, 0
            if self.next > now:  # else the end of one window is the beginning of the next, and has been taken
                break
            self.number = 1


def advance(simulation: Simulation, until: float, samplers: list[Sampler]) -> Status:
    """To `until`, or to what stops the run earlier, with the samples on the way."""
    while samplers:
        due = min(sampler.next for sampler in samplers)
        if due > until * (1.0 + _ROUND_OFF):
            break
        status = simulation.advance(min(due, until))
        if status != 0:
            return status
        row = simulation.channels()
        for sampler in samplers:
            if sampler.next <= due:
                sampler.take(row)
    return simulation.advance(until)

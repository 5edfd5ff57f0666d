"""Rows on their way from the solver to the result: collected into blocks of one size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float64]
Rows = NDArray[Any]


class RowBlocks:
    """Takes rows in portions of any size and hands them on in blocks of `size`, so that a stop of the solver does not
    make a short block. `pending` are those of the block that is not full yet."""

    def __init__(self, size: int, columns: int, precision: str, receive: Callable[[Times, Rows], None]) -> None:
        self._times: Times = np.empty(size)
        self._rows: Rows = np.empty((size, columns), np.dtype(precision))
        self._receive = receive
        self._filled = 0

    @property
    def pending(self) -> tuple[Times, Rows]:
        """Times and rows that have not been handed on; views."""
        return self._times[: self._filled], self._rows[: self._filled]

    def add(self, times: Times, rows: Rows) -> None:
        """A portion."""
        size = self._times.size
        done = 0
        while done < times.size:
            if self._filled == 0 and times.size - done >= size:
                self._receive(times[done : done + size], rows[done : done + size])
                done += size
                continue
            count = min(size - self._filled, times.size - done)
            self._times[self._filled : self._filled + count] = times[done : done + count]
            self._rows[self._filled : self._filled + count] = rows[done : done + count]
            self._filled += count
            done += count
            if self._filled == size:
                self._filled = 0
                self._receive(self._times, self._rows)

    def flush(self) -> None:
        """Hand on what there is."""
        if self._filled:
            times, rows = self.pending
            self._filled = 0
            self._receive(times, rows)

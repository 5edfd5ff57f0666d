"""Ctrl-C in three phases: before the run it ends the command, during the run it asks the solver to stop at the end of
its step, and while the results are being closed it waits."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupt:
    """Use as a context around a whole command; only the main thread may."""

    def __init__(self) -> None:
        self.requested = False
        self._stop: Callable[[], None] | None = None
        self._closing = False
        self._before: dict[int, object] = {}

    def __enter__(self) -> Interrupt:
        for number in _SIGNALS:
            self._before[number] = signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number in _SIGNALS:
            signal.signal(number, self._before[number])  # type: ignore[arg-type]

    def running(self, stop: Callable[[], None]) -> None:
        """From now on a signal calls `stop`, which must be safe to call at any time and more than once."""
        self._stop = stop

    def closing(self) -> None:
        """From now on signals are noted only: a half-written file helps nobody."""
        self._closing = True

    def _handle(self, number: int, frame: FrameType | None) -> None:
        again = self.requested
        self.requested = True
        if self._closing or (again and self._stop is not None):
            print("gustform: stopping, the result is being written", file=sys.stderr)
        elif self._stop is not None:
            self._stop()
        else:
            raise KeyboardInterrupt

"""Progress of a run on stderr: a bar on a terminal, a line now and then where there is none."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_LINE_EVERY = 5.0  # s of waiting between lines


def times(factor: float) -> str:
    """A real-time factor with three digits: 0.482, 48.2, 4820."""
    return f"{factor:.3g}" if factor < 1000.0 else f"{float(f'{factor:.3g}'):.0f}"


def clock(seconds: float) -> str:
    """A time as people read it: 0:07, 12:30, 1:02:03."""
    hours, rest = divmod(round(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"


class RunProgress:
    """Shows simulated time, real-time factor and time left. Use as a context; `show` at any rate."""

    doing = "simulating"

    def __init__(self, until: float, start: float = 0.0) -> None:
        self.until, self._start = until, start
        self._begin = time.perf_counter()
        self._last_line = self._begin
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            # Loaded here only: a run into a log file does without.
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            self._bar = Progress(
                TextColumn(self.doing),
                BarColumn(bar_width=None),
                TextColumn("{task.fields[state]}"),
                console=Console(stderr=True),
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=self.until, state="")
        self._begin = self._last_line = time.perf_counter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, simulated: float, before: str = "") -> None:
        """Simulated time reached, s; `before` is text to stand before it."""
        now = time.perf_counter()
        text = before + self.state(simulated, now - self._begin)
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=simulated, state=text)
        elif now - self._last_line >= _LINE_EVERY:
            self._last_line = now
            print(f"{self.doing}: {text}", file=sys.stderr, flush=True)

    def state(self, simulated: float, waited: float) -> str:
        """ "12.0 / 90.0 s, 340 x real time, 0:02 left"."""
        text = f"{simulated:.1f} / {self.until:.1f} s"
        if simulated > self._start and waited > 0.0:
            factor = (simulated - self._start) / waited
            text += f", {times(factor)} x real time, {clock((self.until - simulated) / factor)} left"
        return text

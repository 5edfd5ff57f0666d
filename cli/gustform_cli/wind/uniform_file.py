"""Uniform ("hub-height") wind of AeroDyn and InflowWind: text, `!` comments, 8 columns or more, always m/s and s.

    time  speed  direction  vertical speed  horizontal shear  power-law shear  linear shear  gust speed

The wind of the rotor is speed + gust speed. Direction, shear and vertical speed have no place in a turbine model
without them; they are left out, with a warning where they are not 0. Between the rows the wind changes linearly.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gustform.language.errors import GustformError, Place
from gustform_cli.wind.csv_file import opened, whole_lines
from gustform_cli.wind.stamps import Clock, numbered
from gustform_cli.wind.table import Position, Rows

_TIME, _SPEED, _GUST, _COLUMNS = 0, 1, 7, 8
_LEFT_OUT = {2: "direction", 3: "vertical speed", 4: "horizontal shear", 5: "vertical shear", 6: "linear shear"}


class UniformFile:
    """A table of uniform wind. Raises GF2501, GF2502, GF2505, GF2508."""

    counted = "line"
    polyline = True

    def __init__(self, path: Path, clock: Clock) -> None:
        self.path, self.stamps = path, numbered(clock)
        left_out: set[str] = set()
        for text, _ in self._numbers(0, 1):
            left_out |= {name for column, name in _LEFT_OUT.items() if np.any(text[:, column] != 0.0)}
            break  # the first block shows what kind of file it is
        names = [name for name in _LEFT_OUT.values() if name in left_out]
        self.warnings: tuple[str, ...] = (
            (f"{', '.join(names)} in the file: left out, the turbine does not know them",) if names else ()
        )

    def shown(self, time: float) -> str:
        """A time as the file writes it."""
        return self.stamps.shown(time)

    def blocks(self, position: Position | None = None) -> Iterator[Rows]:
        """The rows in blocks; a position is a byte and a line. A row that repeats the one before is left out."""
        offset, line = position if position is not None else (0, 1)
        any_rows = position is not None
        before: tuple[float, float] | None = None
        for numbers, here in self._numbers(offset, line):
            times = self.stamps.from_numbers(numbers[:, _TIME])
            speeds = numbers[:, _SPEED] + numbers[:, _GUST]
            repeated = np.zeros(times.size, dtype=bool)
            repeated[1:] = (np.diff(times) == 0.0) & (np.diff(speeds) == 0.0)
            repeated[0] = before == (times[0], speeds[0])
            before = (float(times[-1]), float(speeds[-1]))
            any_rows = True
            labels = numbers[:, _COLUMNS].astype(np.int64)
            yield Rows(here, labels[~repeated], times[~repeated], speeds[~repeated])
        if not any_rows:
            raise GustformError(
                "GF2502", "the wind file must have rows; it has none", hint="another file", place=Place(str(self.path))
            )

    def _numbers(
        self, offset: int, line: int
    ) -> Iterator[tuple[np.ndarray[tuple[int, int], np.dtype[np.float64]], Position]]:
        """Rows of 8 numbers and the number of their line, and where each block begins."""
        with opened(self.path) as stream:
            for offset, first, text in whole_lines(stream, self.path, offset, line):  # noqa: B020
                rows = []
                for number, raw in enumerate(text.decode("utf-8", errors="backslashreplace").split("\n"), first):
                    words = raw.split("!")[0].split()
                    if not words:
                        continue
                    try:
                        values = [float(word) for word in words[:_COLUMNS]]
                    except ValueError:
                        raise GustformError(
                            "GF2508",
                            f"a uniform wind file must have rows of 8 numbers; got {raw.strip()[:60]!r}",
                            hint="! before what is no row, or format: with the kind of file it is",
                            place=Place(str(self.path), number),
                        ) from None
                    if len(values) < _COLUMNS:
                        raise GustformError(
                            "GF2508",
                            f"a uniform wind file must have rows of 8 numbers; got {len(values)}",
                            hint="time, speed, direction, vertical speed, three shears, gust speed",
                            place=Place(str(self.path), number),
                        )
                    rows.append([*values, number])
                if rows:
                    yield np.array(rows, dtype=np.float64), (offset, first)

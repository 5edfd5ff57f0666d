"""A wind file that is a table: rows of a time and a speed, given out in blocks.

`CsvFile`, `UniformFile`, `ParquetFile` and `NetcdfFile` are tables; `clean` and `survey` make samples of their rows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import Place

# Where a block of a table begins, for the table itself to understand: byte, line, row group, ...
Position = tuple[int, ...]


@dataclass(frozen=True)
class Rows:
    """A block of rows: times in s from the start of the run and speeds in m/s, NaN where there is none."""

    position: Position
    labels: NDArray[np.int64]  # the numbers of the rows in messages: lines of a text, rows of the rest, from 1
    times: NDArray[np.float64]
    speeds: NDArray[np.float64]


class TableFile(Protocol):
    """A table that can be read from its beginning or from where a block began, any number of times."""

    path: Path
    counted: str  # what the labels count: "line" or "row"
    polyline: bool  # rows stand where the wind bends, at any distance
    warnings: tuple[str, ...]

    def blocks(self, position: Position | None = None) -> Iterator[Rows]:
        """The rows in blocks of some 10,000."""

    def shown(self, time: float) -> str:
        """A time, s from the start of the run, as the file writes it."""


def place(table: TableFile, label: int = 0) -> Place:
    """Where a row is. Editors go to the line of a text; the number of a row would mislead them."""
    return Place(str(table.path), label if table.counted == "line" else 0)

"""Wind from a CSV file, read in blocks: a large file needs no more memory than a small one.

The first line names the columns. `scan` goes through the file once before the run and reports everything wrong with
it (how many, where, the first few); `CsvWind` then delivers samples while the run asks for them.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import did_you_mean

_ROWS = 8192  # a block: some 200 kB of text


@dataclass(frozen=True)
class CsvColumns:
    """Which file and columns, and the factors that turn them into s and m/s."""

    path: Path
    time: str
    speed: str
    time_factor: float = 1.0
    speed_factor: float = 1.0


@dataclass(frozen=True)
class _Block:
    lines: NDArray[np.int64]  # line numbers in the file, from 1
    times: NDArray[np.float64]
    speeds: NDArray[np.float64]


def _blocks(columns: CsvColumns) -> Iterator[_Block]:
    """The rows of the file in blocks. Raises GF2501, GF2502, GF2503, GF2505."""
    place = Place(str(columns.path))
    try:
        stream = columns.path.open(encoding="utf-8-sig", newline="")
    except OSError as error:
        raise GustformError(
            "GF2501",
            f"the wind file must be readable; {error.strerror or error}",
            hint="the path relative to the scenario file",
            place=place,
        ) from None
    with stream:
        try:
            yield from _parse(stream, columns, place)
        except UnicodeDecodeError as error:
            raise GustformError(
                "GF2505", f"the wind file must be text; byte {error.start} of a block is not UTF-8", place=place
            ) from None
        except OSError as error:
            raise GustformError("GF2501", f"the wind file must be readable; {error.strerror}", place=place) from None


def _parse(stream: Iterator[str], columns: CsvColumns, place: Place) -> Iterator[_Block]:
    header, number = "", 0
    for header in stream:
        number += 1
        if header.strip() and not header.startswith("#"):
            break
    else:
        header = ""
    if not header.strip():
        raise GustformError(
            "GF2502", "the wind file must have a header line and rows; it is empty", hint="another file", place=place
        )
    delimiter = max(",;\t", key=header.count)
    names = [name.strip() for name in next(csv.reader([header], delimiter=delimiter))]
    wanted = []
    for role, name in (("time", columns.time), ("speed", columns.speed)):
        if name not in names:
            raise GustformError(
                "GF2503",
                f"the wind file must have the column {name!r} (columns.{role}); it has {', '.join(names[:20])}",
                hint=did_you_mean(name, names),
                place=Place(str(columns.path), number),
            )
        wanted.append(names.index(name))
    any_rows = False
    while lines := list(islice(stream, _ROWS)):
        kept = [index for index, line in enumerate(lines) if line.strip() and not line.startswith("#")]
        if kept:
            any_rows = True
            text = [lines[index] for index in kept]
            values = _numbers(text, delimiter, wanted, number + 1 + np.asarray(kept, dtype=np.int64), place)
            yield _Block(
                number + 1 + np.asarray(kept, dtype=np.int64),
                values[:, 0] * columns.time_factor,
                values[:, 1] * columns.speed_factor,
            )
        number += len(lines)
    if not any_rows:
        raise GustformError(
            "GF2502", "the wind file must have rows; it has a header only", hint="another file", place=place
        )


def _numbers(
    text: list[str], delimiter: str, wanted: list[int], lines: NDArray[np.int64], place: Place
) -> NDArray[np.float64]:
    """Two columns of numbers; cells that are empty or "NaN" become NaN."""
    try:
        return np.loadtxt(text, delimiter=delimiter, usecols=wanted, ndmin=2, comments=None, quotechar='"')
    except (ValueError, IndexError):
        pass  # something in this block is no number: go through it cell by cell to say where
    values = np.full((len(text), 2), np.nan)
    for row, cells in enumerate(csv.reader(text, delimiter=delimiter)):
        for column, index in enumerate(wanted):
            cell = cells[index].strip() if index < len(cells) else ""
            if cell.lower() in ("", "na", "n/a", "null", "none", "-"):
                continue
            try:
                values[row, column] = float(cell)
            except ValueError:
                raise GustformError(
                    "GF2505",
                    f"the wind file must have numbers in its columns; got {cell!r}",
                    hint="times in seconds and a point as decimal sign",
                    place=Place(place.file, int(lines[row])),
                ) from None
    return values


def _first_few(lines: list[int], count: int) -> str:
    shown = ", ".join(str(line) for line in lines)
    return f"line{'s' if count > 1 else ''} {shown}" + (", ..." if count > len(lines) else "")


def scan(columns: CsvColumns, until: float, *, hold: bool) -> float:
    """Check the file up to the time `until`, s; returns its last time.

    Raises GF2501 ... GF2506. NaN and stamps that do not increase are counted, with the lines of the first few.
    """
    place = Place(str(columns.path))
    last, first, rows = -np.inf, np.nan, 0
    missing, missing_lines = 0, list[int]()
    backwards, backwards_lines = 0, list[int]()
    for block in _blocks(columns):
        bad = ~(np.isfinite(block.times) & np.isfinite(block.speeds))
        missing += int(bad.sum())
        missing_lines += [int(line) for line in block.lines[bad][: 3 - len(missing_lines)]]
        lines, times = block.lines[~bad], block.times[~bad]
        if times.size:
            steps = np.diff(times, prepend=last)
            wrong = steps <= 0.0
            backwards += int(wrong.sum())
            backwards_lines += [int(line) for line in lines[wrong][: 3 - len(backwards_lines)]]
            first = times[0] if rows == 0 else first
            last, rows = max(last, float(times.max())), rows + times.size
        if last >= until:
            break
    if missing:
        raise GustformError(
            "GF2505",
            f"the wind file must have a number in every row; {missing} value{'s' if missing > 1 else ''} missing or "
            f"NaN in {_first_few(missing_lines, missing)}",
            hint="filling the gaps",
            place=Place(place.file, missing_lines[0]),
        )
    if backwards:
        raise GustformError(
            "GF2504",
            f"the times of the wind file must increase from row to row; {backwards} do{'' if backwards > 1 else 'es'} "
            f"not, at {_first_few(backwards_lines, backwards)}",
            hint="sorting the file and removing duplicates",
            place=Place(place.file, backwards_lines[0]),
        )
    if first > 0.0:
        raise GustformError(
            "GF2506",
            f"the wind file must cover the run from 0 s; it starts at {first:g} s",
            hint="times that count from the start of the run",
            place=place,
        )
    if last < until and not hold:
        raise GustformError(
            "GF2506",
            f"the wind file must cover the run, {until:g} s; it ends at {last:g} s",
            hint=f"run.until: {last:g} s, or on_end: hold",
            place=place,
        )
    return last


class CsvWind:
    """Reader of a runtime series: samples by number, normally asked for one after the other."""

    def __init__(self, columns: CsvColumns) -> None:
        self.columns = columns
        self._restart()

    def _restart(self) -> None:
        self._source = _blocks(self.columns)
        self._first = 0  # number of the first sample held
        self._times: NDArray[np.float64] = np.empty(0)
        self._speeds: NDArray[np.float64] = np.empty(0)

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end of the file."""
        if first < self._first:
            self._restart()
        while self._first + self._times.size < first + count:
            block = next(self._source, None)
            if block is None:
                break
            drop = min(max(first - self._first, 0), self._times.size)
            self._first += drop
            self._times = np.concatenate((self._times[drop:], block.times))
            self._speeds = np.concatenate((self._speeds[drop:], block.speeds))
        start = first - self._first
        return self._times[start : start + count], self._speeds[start : start + count]

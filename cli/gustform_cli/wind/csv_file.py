"""Wind from a CSV file, plain or compressed (.gz), with its columns by name or number.

The file is cut into blocks of whole lines and each block is parsed by pyarrow; a block in which something is no number
or no time is gone through cell by cell, to say where.
"""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import did_you_mean
from gustform_cli.wind.reading import reading
from gustform_cli.wind.stamps import NOT_A_TIME, Clock, Stamps, dated, nanoseconds, numbered, to_utc
from gustform_cli.wind.table import Position, Rows

_BLOCK = 1 << 20  # bytes
_LONGEST_LINE = 1 << 24
_MISSING = ("", "na", "n/a", "nan", "null", "none", "-")
_MISSING_SPELT = sorted({word for text in _MISSING for word in (text, text.upper(), text.title(), "NaN", "#N/A")})


@dataclass(frozen=True)
class Columns:
    """Which columns, by name or by number from 1, and the factor that turns the speeds into m/s."""

    time: str | int = "time"
    speed: str | int = "speed"
    speed_factor: float = 1.0
    header_rows: int = 1
    missing: tuple[float, ...] = ()  # numbers that stand for nothing measured


@contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """The bytes of a file, unpacked if it is a .gz; GF2501 and GF2508 for what goes wrong, now or while reading."""
    with reading(path):
        try:
            with gzip.open(path, "rb") if path.suffix == ".gz" else path.open("rb") as stream:
                yield stream  # type: ignore[misc]  # GzipFile reads like a file
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise GustformError(
                "GF2508",
                f"the wind file must be a whole .gz; {str(error) or type(error).__name__}",
                hint="copying it again",
                place=Place(str(path)),
            ) from None


def whole_lines(stream: IO[bytes], path: Path, offset: int, line: int) -> Iterator[tuple[int, int, bytes]]:
    """Blocks of whole lines from byte `offset` on, which is the beginning of line `line` (from 1): offset, line and
    text of each."""
    stream.seek(offset)
    rest = b""
    while True:
        data = stream.read(max(_BLOCK - len(rest), _BLOCK // 2))
        text = rest + data
        end = text.rfind(b"\n") + 1 if data else len(text)
        if end == 0 and data:
            if len(text) > _LONGEST_LINE:
                raise GustformError(
                    "GF2508",
                    f"the wind file must be text; this line has more than {_LONGEST_LINE >> 20} MiB",
                    hint="format: with the kind of file it is",
                    place=Place(str(path), line),
                )
            rest = text
            continue
        if end:
            yield offset, line, text[:end]
        if not data:
            return
        offset, line, rest = offset + end, line + text.count(b"\n", 0, end), text[end:]


class CsvFile:
    """A table in a text file. Raises GF2501 ... GF2505, GF2508, GF2511."""

    counted = "line"
    polyline = False
    warnings: tuple[str, ...] = ()

    def __init__(self, path: Path, columns: Columns, clock: Clock) -> None:
        self.path, self.columns, self.clock = path, columns, clock
        with opened(path) as stream:
            names = self._read_header(stream)
        self._width = len(names)
        self._wanted = [
            self._column(names, role, name) for role, name in (("time", columns.time), ("speed", columns.speed))
        ]
        self.stamps = self._read_first_stamp()

    def shown(self, time: float) -> str:
        """A time as the file writes it."""
        return self.stamps.shown(time)

    def blocks(self, position: Position | None = None) -> Iterator[Rows]:
        """The rows in blocks; a position is a byte, a line and the moment before it."""
        offset, line, before = position if position is not None else (*self._begin, NOT_A_TIME)
        any_rows = position is not None
        with opened(self.path) as stream:
            for offset, line, text in whole_lines(stream, self.path, offset, line):  # noqa: B020
                labels, raw, speeds = self._parse(text, line)
                if labels.size == 0:
                    continue
                here = (offset, line, before)
                if self.stamps.calendar:
                    moments = raw.astype(np.int64)
                    if self.stamps.local is not None:
                        moments = to_utc(moments, self.stamps.local, before)
                    before = int(moments[-1])
                    times = self.stamps.from_moments(moments)
                else:
                    times = self.stamps.from_numbers(raw.astype(np.float64))
                for missing in self.columns.missing:
                    speeds = np.where(speeds == missing, np.nan, speeds)
                any_rows = True
                yield Rows(here, labels, times, speeds * self.columns.speed_factor)
        if not any_rows:
            raise GustformError(
                "GF2502",
                "the wind file must have rows; it has a header only",
                hint="another file",
                place=Place(str(self.path)),
            )

    # ---- the beginning of the file ----------------------------------------------------------------------------------
    def _read_header(self, stream: IO[bytes]) -> list[str]:
        """Names of the columns, those of several header lines joined; sets where the rows begin."""
        header: list[str] = []
        offset = number = 0
        text = b""
        while len(header) < max(1, self.columns.header_rows):
            text = stream.readline(_LONGEST_LINE)
            if not text:
                raise GustformError(
                    "GF2502",
                    "the wind file must have a header line and rows; it is empty",
                    hint="another file",
                    place=Place(str(self.path)),
                )
            offset, number = offset + len(text), number + 1
            try:
                line = text.decode("utf-8-sig" if number == 1 else "utf-8")
            except UnicodeDecodeError:
                line = text.decode("latin-1")
            if "\0" in line:
                raise GustformError(
                    "GF2508",
                    f"the wind file must be text (CSV); line {number} has bytes that are none",
                    hint="format: with the kind of file it is",
                    place=Place(str(self.path), number),
                )
            if line.strip() and not line.startswith("#"):
                header.append(line)
        self._delimiter = max(",;\t", key=header[-1].count)
        cells = [[cell.strip() for cell in next(csv.reader([line], delimiter=self._delimiter))] for line in header]
        self._header_line = number
        if self.columns.header_rows == 0:
            self._begin = (offset - len(text), number)
            return [str(index + 1) for index in range(len(cells[0]))]
        self._begin = (offset, number + 1)
        return [" ".join(part for part in parts if part) for parts in zip(*cells, strict=False)]

    def _column(self, names: Sequence[str], role: str, wanted: str | int) -> int:
        """Index of a column."""
        problem = ""
        if isinstance(wanted, int):
            if 1 <= wanted <= len(names):
                return wanted - 1
            problem, hint = f"it has {len(names)}", f"a number from 1 to {len(names)}"
        elif wanted not in names:
            problem, hint = f"it has {', '.join(names[:20])}", did_you_mean(wanted, [name for name in names if name])
        elif names.count(wanted) > 1:
            at = [str(index + 1) for index, name in enumerate(names) if name == wanted]
            problem, hint = f"there are {len(at)} of them", f"the number of one: {' or '.join(at)}; or header_rows: 2"
        else:
            return names.index(wanted)
        raise GustformError(
            "GF2503",
            f"the wind file must have the column {wanted!r} (columns.{role}); {problem}",
            hint=hint,
            place=Place(str(self.path), self._header_line),
        )

    def _read_first_stamp(self) -> Stamps:
        """Whether times are numbers or moments, from the first that there is."""
        offset, line = self._begin
        with opened(self.path) as stream:
            for _, first, text in whole_lines(stream, self.path, offset, line):
                for number, cells in _cells(text, first, self._delimiter):
                    cell = cells[self._wanted[0]].strip() if self._wanted[0] < len(cells) else ""
                    if cell.lower() in _MISSING:
                        continue
                    if self.clock.form is None and _is_number(cell):
                        return numbered(self.clock)
                    moment = self._moment(cell, number)
                    first_moment = nanoseconds(moment)
                    offset_of = moment.utcoffset()
                    if offset_of is None and self.clock.zone is not None:
                        zone = dated(self.clock, 0, None).local
                        assert zone is not None
                        first_moment = int(to_utc(np.array([first_moment]), zone, NOT_A_TIME)[0])
                    return dated(self.clock, first_moment, offset_of)
        return numbered(self.clock)  # no row has a time: `blocks` and what reads them say so

    def _moment(self, cell: str, line: int) -> datetime:
        try:
            if self.clock.form is not None:
                return datetime.strptime(cell, self.clock.form)
            return datetime.fromisoformat(cell)
        except ValueError:
            raise GustformError(
                "GF2505",
                f"the wind file must have numbers or moments as times; got {cell!r}",
                hint=f"time_format: as for strptime, in place of {self.clock.form!r}"
                if self.clock.form
                else 'ISO 8601 (2015-04-01T00:00), or time_format: "%d.%m.%Y %H:%M"',
                place=Place(str(self.path), line),
            ) from None

    # ---- a block ----------------------------------------------------------------------------------------------------
    def _parse(
        self, text: bytes, line: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64] | NDArray[np.int64], NDArray[np.float64]]:
        """Lines, times (numbers, or ns on the clock of the file) and speeds of a block."""
        if b"#" in text or (self.clock.form is not None):
            return self._parse_cells(text, line)
        import pyarrow as pa
        from pyarrow import csv as arrow

        kind = pa.float64()
        if self.stamps.calendar:
            own_offset = self.stamps.local is None and self.stamps.zone is not None
            kind = pa.timestamp("ns", "UTC") if own_offset else pa.timestamp("ns")
        time, speed = (str(index) for index in self._wanted)
        try:
            table = arrow.read_csv(
                pa.BufferReader(text),
                read_options=arrow.ReadOptions(
                    use_threads=False, block_size=len(text) + 1, column_names=[str(k) for k in range(self._width)]
                ),
                parse_options=arrow.ParseOptions(delimiter=self._delimiter),
                convert_options=arrow.ConvertOptions(
                    include_columns=[time, speed] if time != speed else [time],
                    column_types={speed: pa.float64(), time: kind},
                    null_values=_MISSING_SPELT,
                ),
            )
        except pa.ArrowInvalid:
            return self._parse_cells(text, line)
        labels = np.arange(line, line + table.num_rows)
        if table.num_rows != text.count(b"\n") + (not text.endswith(b"\n")):
            labels = np.array([number for number, _ in _cells(text, line, self._delimiter)], dtype=np.int64)
        raw = table[time]
        if self.stamps.calendar:
            times = raw.cast(pa.int64()).fill_null(NOT_A_TIME).to_numpy()
        else:
            times = raw.to_numpy()
        return labels, times, table[speed].to_numpy()

    def _parse_cells(
        self, text: bytes, line: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64] | NDArray[np.int64], NDArray[np.float64]]:
        """The same cell by cell: GF2505 with the line of what is no number."""
        rows = list(_cells(text, line, self._delimiter))
        labels = np.array([number for number, _ in rows], dtype=np.int64)
        speeds = np.full(len(rows), np.nan)
        calendar = self.stamps.calendar
        times = np.full(len(rows), NOT_A_TIME, dtype=np.int64) if calendar else np.full(len(rows), np.nan)
        for row, (number, cells) in enumerate(rows):
            for column, target in zip(self._wanted, (times, speeds), strict=True):
                cell = cells[column].strip() if column < len(cells) else ""
                if cell.lower() in _MISSING:
                    continue
                if target is times and calendar:
                    times[row] = self._calendar(cell, number)
                elif _is_number(cell):
                    target[row] = float(cell)
                else:
                    raise GustformError(
                        "GF2505",
                        f"the wind file must have numbers in its columns; got {cell!r}",
                        hint="times in seconds or ISO 8601, and a point as decimal sign",
                        place=Place(str(self.path), number),
                    )
        return labels, times, speeds

    def _calendar(self, cell: str, line: int) -> int:
        moment = self._moment(cell, line)
        if (moment.tzinfo is None) == (self.stamps.local is None and self.stamps.zone is not None):
            raise GustformError(
                "GF2505",
                f"the stamps of the wind file must all have an offset, or none of them; got {cell!r}",
                hint="an offset (+01:00) for each, or time_zone: for all",
                place=Place(str(self.path), line),
            )
        return nanoseconds(moment)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _cells(text: bytes, line: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of each row that is neither empty nor a comment."""
    lines = text.decode("utf-8", errors="backslashreplace").split("\n")
    kept = [
        (number, row.rstrip("\r")) for number, row in enumerate(lines, line) if row.strip() and not row.startswith("#")
    ]
    reader = csv.reader((row for _, row in kept), delimiter=delimiter)
    return zip((number for number, _ in kept), reader, strict=False)


def first_bytes(path: Path, count: int = 16) -> bytes:
    """The beginning of a file, unpacked."""
    with opened(path) as stream:
        return stream.read(count)

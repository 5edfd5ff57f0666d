"""Wind from a Parquet file: two columns, read batch by batch, whatever the size of a row group."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import did_you_mean
from gustform_cli.wind.csv_file import Columns
from gustform_cli.wind.reading import reading
from gustform_cli.wind.stamps import NOT_A_TIME, Clock, Stamps, dated, numbered, to_utc
from gustform_cli.wind.table import Position, Rows

_ROWS = 1 << 15


class ParquetFile:
    """A table in a Parquet file. Raises GF2501, GF2502, GF2503, GF2505, GF2508, GF2511."""

    counted = "row"
    polyline = False
    warnings: tuple[str, ...] = ()

    def __init__(self, path: Path, columns: Columns, clock: Clock) -> None:
        import pyarrow as pa

        self.path, self.columns = path, columns
        with self._open() as file:
            schema = file.schema_arrow
            self._names = [
                self._column(schema.names, role, name)
                for role, name in (("time", columns.time), ("speed", columns.speed))
            ]
            groups = [file.metadata.row_group(k).num_rows for k in range(file.metadata.num_row_groups)]
            self._before = np.concatenate(([0], np.cumsum(groups, dtype=np.int64)))
            kind = schema.field(self._names[0]).type
            speed_kind = schema.field(self._names[1]).type
        for name, found, fits in (
            (self._names[0], kind, pa.types.is_timestamp(kind) or _is_numeric(kind)),
            (self._names[1], speed_kind, _is_numeric(speed_kind)),
        ):
            if not fits:
                raise GustformError(
                    "GF2505",
                    f"the column {name!r} of the wind file must hold numbers (or timestamps, for times); got {found}",
                    hint="writing the column as numbers",
                    place=Place(str(path)),
                )
        if self._before[-1] == 0:
            raise GustformError(
                "GF2502", "the wind file must have rows; it has none", hint="another file", place=Place(str(path))
            )
        self._zoned: bool | None = None if not pa.types.is_timestamp(kind) else kind.tz is not None
        self.stamps = self._stamps(clock)

    def shown(self, time: float) -> str:
        """A time as the file writes it."""
        return self.stamps.shown(time)

    def blocks(self, position: Position | None = None) -> Iterator[Rows]:
        """The rows in blocks; a position is a row and the moment before it."""
        first, before = position if position is not None else (0, NOT_A_TIME)
        for row, raw, speeds in self._batches(first):
            here = (row, before)
            if self.stamps.calendar:
                moments = raw if self.stamps.local is None else to_utc(raw, self.stamps.local, before)
                before = int(moments[-1])
                times = self.stamps.from_moments(moments)
            else:
                times = self.stamps.from_numbers(raw)
            for missing in self.columns.missing:
                speeds = np.where(speeds == missing, np.nan, speeds)
            yield Rows(here, np.arange(row + 1, row + 1 + times.size), times, speeds * self.columns.speed_factor)

    def _open(self) -> Any:
        import pyarrow as pa
        import pyarrow.parquet as pq

        with reading(self.path):
            try:
                # Buffered: pages are read as they are needed, not the columns of a row group at once.
                return pq.ParquetFile(self.path, buffer_size=1 << 20, pre_buffer=False)
            except pa.ArrowInvalid as error:
                raise GustformError(
                    "GF2508",
                    f"the wind file must be a whole Parquet file; {str(error).splitlines()[0].rstrip('. ')}",
                    hint="format: with the kind of file it is",
                    place=Place(str(self.path)),
                ) from None

    def _column(self, names: list[str], role: str, wanted: str | int) -> str:
        if isinstance(wanted, int) and 1 <= wanted <= len(names):
            return names[wanted - 1]
        if wanted in names:
            return str(wanted)
        raise GustformError(
            "GF2503",
            f"the wind file must have the column {wanted!r} (columns.{role}); it has {', '.join(names[:20])}",
            hint=did_you_mean(str(wanted), names),
            place=Place(str(self.path)),
        )

    def _stamps(self, clock: Clock) -> Stamps:
        if self._zoned is None:
            return numbered(clock)
        for _, moments, _ in self._batches(0):
            known = moments[moments != NOT_A_TIME]
            if known.size == 0:
                continue
            if self._zoned:
                return dated(clock, int(known[0]), timedelta(0))
            zone = dated(clock, 0, None).local
            first = known[:1] if zone is None else to_utc(known[:1], zone, NOT_A_TIME)
            return dated(clock, int(first[0]), None)
        return dated(clock, 0, None)

    def _batches(self, first: int) -> Iterator[tuple[int, Any, Any]]:
        """Number of the first row, times (numbers, or ns) and speeds of each batch from row `first` on."""
        import pyarrow as pa

        group = int(np.searchsorted(self._before, first, side="right")) - 1
        with self._open() as file:
            for number in range(group, self._before.size - 1):
                row = int(self._before[number])
                try:
                    for batch in file.iter_batches(_ROWS, row_groups=[number], columns=self._names, use_threads=False):
                        skip = min(max(first - row, 0), batch.num_rows)
                        row += batch.num_rows
                        if skip == batch.num_rows:
                            continue
                        part = batch.slice(skip)
                        yield row - part.num_rows, self._times(part[self._names[0]]), _floats(part[self._names[1]])
                except (pa.ArrowInvalid, OSError) as error:
                    raise GustformError(
                        "GF2508",
                        f"the wind file must be a whole Parquet file; after row {row}: {str(error).splitlines()[0]}",
                        hint="writing it again",
                        place=Place(str(self.path)),
                    ) from None

    def _times(self, column: Any) -> Any:
        import pyarrow as pa

        if self._zoned is None:
            return _floats(column)
        unit = pa.timestamp("ns", tz=column.type.tz)
        return column.cast(unit).cast(pa.int64()).fill_null(NOT_A_TIME).to_numpy(zero_copy_only=False)


def _is_numeric(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))


def _floats(column: Any) -> Any:
    import pyarrow as pa

    return column.cast(pa.float64()).to_numpy(zero_copy_only=False)

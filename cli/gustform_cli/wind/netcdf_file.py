"""Wind from a netCDF-4 (HDF5) file: two variables over one dimension, with the units that the file itself tells.

Times follow the CF conventions: `seconds since 2015-04-01 00:00` is a moment of the calendar, a plain unit a number.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import did_you_mean
from gustform_cli.quantity import conversion
from gustform_cli.wind.csv_file import Columns
from gustform_cli.wind.reading import reading
from gustform_cli.wind.stamps import Clock, Stamps, dated, nanoseconds, numbered, to_utc
from gustform_cli.wind.table import Position, Rows

if TYPE_CHECKING:
    import h5py

_ROWS = 1 << 15
_SINCE = re.compile(r"\s*(\w+)\s+since\s+(.+?)\s*")
_CALENDARS = ("", "standard", "gregorian", "proleptic_gregorian")


class NetcdfFile:
    """A table in a netCDF-4 file. Raises GF2501, GF2502, GF2503, GF2505, GF2508, GF2511.

    `time_unit`, `speed_unit` are those of the scenario, None to take the file's.
    """

    counted = "row"
    polyline = False
    warnings: tuple[str, ...] = ()

    def __init__(
        self, path: Path, columns: Columns, clock: Clock, *, time_unit: str | None, speed_unit: str | None
    ) -> None:
        self.path, self.columns = path, columns
        with self._open() as file:
            names = [name for name, data in file.items() if hasattr(data, "shape") and len(data.shape) == 1]
            self._names = [
                self._variable(names, role, name) for role, name in (("time", columns.time), ("speed", columns.speed))
            ]
            time, speed = (file[name] for name in self._names)
            self._rows = int(time.shape[0])
            if speed.shape != time.shape:
                raise self._wrong(
                    "GF2505",
                    f"{self._names[1]!r} must have a value for each time; it has {speed.shape[0]} for {self._rows}",
                    "a variable over the same dimension",
                )
            if self._rows == 0:
                raise self._wrong("GF2502", "the wind file must have rows; it has none", "another file")
            self._factor = columns.speed_factor if speed_unit else self._unit(speed, "m/s")
            self.stamps, self._tick = self._stamps(time, clock, time_unit)

    def shown(self, time: float) -> str:
        """A time as the file writes it."""
        return self.stamps.shown(time)

    def blocks(self, position: Position | None = None) -> Iterator[Rows]:
        """The rows in blocks; a position is a row."""
        before = 0
        with self._open() as file:
            time, speed = (file[name] for name in self._names)
            for row in range(position[0] if position is not None else 0, self._rows, _ROWS):
                try:
                    raw, speeds = _read(time, slice(row, row + _ROWS)), _read(speed, slice(row, row + _ROWS))
                except OSError as error:
                    raise self._wrong(
                        "GF2508", f"the wind file must be whole; after row {row}: {error}", "copying it again"
                    ) from None
                if self.stamps.calendar:
                    ticks = np.round(np.nan_to_num(raw) * self._tick[0])
                    moments = ticks.astype(np.int64) + self._tick[1]
                    if self.stamps.local is not None:
                        moments = to_utc(moments, self.stamps.local, before)
                    before = int(moments[-1])
                    times = np.where(np.isfinite(raw), self.stamps.from_moments(moments), np.nan)
                else:
                    times = self.stamps.from_numbers(raw)
                for missing in self.columns.missing:
                    speeds = np.where(speeds == missing, np.nan, speeds)
                yield Rows((row,), np.arange(row + 1, row + 1 + times.size), times, speeds * self._factor)

    def _wrong(self, code: str, message: str, hint: str) -> GustformError:
        return GustformError(code, message, hint=hint, place=Place(str(self.path)))

    def _open(self) -> h5py.File:
        import h5py

        with reading(self.path), self.path.open("rb") as stream:
            magic = stream.read(4)
        if magic[:3] == b"CDF":
            raise self._wrong("GF2508", "the wind file must be netCDF-4; it is netCDF-3", "nccopy -k nc4 IN.nc OUT.nc")
        try:
            return h5py.File(self.path, "r")
        except OSError as error:
            reason = re.split(r"[()]", str(error))[1] if "(" in str(error) else str(error)
            raise self._wrong(
                "GF2508",
                f"the wind file must be a whole netCDF-4 file; {reason}",
                "format: with the kind of file it is",
            ) from None

    def _variable(self, names: list[str], role: str, wanted: str | int) -> str:
        if wanted in names:
            return str(wanted)
        raise self._wrong(
            "GF2503",
            f"the wind file must have the variable {wanted!r} over one dimension (columns.{role}); "
            f"it has {', '.join(names[:20])}",
            did_you_mean(str(wanted), names),
        )

    def _unit(self, data: h5py.Dataset, declared: str) -> float:
        """Factor of the file's own unit; without one it is the declared unit."""
        unit = _text(data.attrs.get("units", declared))
        unit = {"m s-1": "m/s", "m s**-1": "m/s", "meter second-1": "m/s"}.get(unit, unit)
        try:
            factor = conversion(unit, declared)
        except ValueError:
            factor = None
        if factor is None:
            raise self._wrong(
                "GF2303",
                f"the variable {data.name.strip('/')!r} must be in a unit of {declared}; the file says {unit!r}",
                f"units: with its real unit, e.g. {declared}",
            )
        return factor

    def _stamps(self, data: h5py.Dataset, clock: Clock, unit: str | None) -> tuple[Stamps, tuple[float, int]]:
        """How times are read, and for moments the length of a tick and the moment of 0, ns."""
        said = _SINCE.fullmatch(_text(data.attrs.get("units", ""))) if unit is None else None
        if said is None:
            factor = clock.factor if unit is not None else self._unit(data, "s")
            return numbered(Clock(factor, None, clock.start)), (0.0, 0)
        calendar = _text(data.attrs.get("calendar", "")).lower()
        tick = _TICKS.get(said[1].lower().rstrip("s"))
        try:
            zero = datetime.fromisoformat(said[2].replace(" UTC", "").removesuffix(".0"))
        except ValueError:
            zero = None
        if calendar not in _CALENDARS or tick is None or zero is None:
            raise self._wrong(
                "GF2511",
                f"the times of {data.name.strip('/')!r} must be seconds to days since a moment of the usual calendar; "
                f"got {_text(data.attrs['units'])!r}{f' ({calendar})' if calendar else ''}",
                "units.time: s, and start: as a number",
            )
        first = nanoseconds(zero) + round(float(np.asarray(data[0], dtype=np.float64)) * tick)
        # CF: without an offset it is UTC, unless the scenario says whose clock it is.
        offset = timedelta(0) if clock.zone is None else zero.utcoffset()
        if offset is None:
            zone = dated(clock, 0, None).local
            assert zone is not None
            first = int(to_utc(np.array([first]), zone, 0)[0])
        return dated(clock, first, offset), (tick, nanoseconds(zero))


_TICKS = {"nanosecond": 1.0, "n": 1.0, "microsecond": 1e3, "millisecond": 1e6, "m": 1e6, "second": 1e9, "sec": 1e9,
          "": 1e9, "minute": 6e10, "min": 6e10, "hour": 3.6e12, "hr": 3.6e12, "h": 3.6e12, "day": 8.64e13,
          "d": 8.64e13}  # fmt: skip


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _read(data: h5py.Dataset, rows: slice) -> NDArray[np.float64]:
    """Values with CF's packing undone; NaN where there is none."""
    raw = data[rows]
    values = np.asarray(raw, dtype=np.float64)
    for name in ("_FillValue", "missing_value"):
        if name in data.attrs:
            values = np.where(raw == data.attrs[name], np.nan, values)
    scale, offset = (np.ravel(data.attrs.get(*pair))[0] for pair in (("scale_factor", 1.0), ("add_offset", 0.0)))
    result: NDArray[np.float64] = values * scale + offset
    return result

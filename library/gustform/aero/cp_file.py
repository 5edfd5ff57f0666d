"""Reader of rotor performance tables in the `Cp_Ct_Cq` text format of ROSCO.

The format: comment lines start with #; "Pitch angle vector" (deg), "TSR vector" and "Wind speed vector" (m/s) are each
followed by one line of numbers; "Power coefficient", "Thrust coefficient" and "Torque coefficient" by a block with one
row for each tip speed ratio and one column for each pitch angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform.language.table import TableData

Array = NDArray[np.float64]

# What a section's comment line begins with, and whether it must be there.
_SECTIONS = {
    "pitch angle vector": True,
    "tsr vector": True,
    "wind speed vector": False,
    "power coefficient": True,
    "thrust coefficient": False,
    "torque coefficient": False,
}
_SIZE_LIMIT = 64 * 1024 * 1024  # bytes; the largest known file has 33 000


@dataclass(frozen=True, eq=False)
class RotorPerformance:
    """Coefficients [tip speed ratio, pitch] on a grid; pitch in deg; thrust and torque may be missing."""

    name: str
    tip_speed_ratio: Array
    pitch: Array
    power: Array
    thrust: Array | None = None
    torque: Array | None = None

    def table(self, cp_floor: float) -> TableData:
        """Cp as a table with x = tip speed ratio, y = pitch in deg. Values below `cp_floor` are raised to it."""
        return TableData(self.tip_speed_ratio, self.pitch, np.maximum(self.power, cp_floor), self.name)

    def report(self, cp_floor: float) -> list[str]:
        """Sentences on the domain and on what `table` does to the data."""
        x, y = self.tip_speed_ratio, self.pitch
        best = np.unravel_index(int(np.argmax(self.power)), self.power.shape)
        domain = f"tip speed ratio {x[0]:g} ... {x[-1]:g}, pitch {y[0]:g} ... {y[-1]:g} deg"
        where = f"tip speed ratio {x[best[0]]:g}, pitch {y[best[1]]:g} deg"
        lines = [
            f"{self.name}: {domain}; Cp is held constant outside",
            f"{self.name}: highest Cp {self.power[best]:.4f} at {where}",
        ]
        low = int(np.count_nonzero(self.power < cp_floor))
        if low:
            lines.append(
                f"{self.name}: {low} of {self.power.size} values below {cp_floor:g} (lowest {self.power.min():.2f}) "
                f"are raised to {cp_floor:g}"
            )
        error = self.table(cp_floor).resampling_error
        if error > 1e-9:
            lines.append(f"{self.name}: the grid is not uniform; resampling changes Cp by at most {error:.1e}")
        return lines


def read_cp_file(path: str | Path) -> RotorPerformance:
    """Read a `Cp_Ct_Cq` file. GF2030 when it cannot be read, GF2031 with file and line when it is not one."""
    file = Path(path)
    try:
        if file.stat().st_size > _SIZE_LIMIT:
            raise GustformError("GF2030", f"{file} is too large for a rotor table ({file.stat().st_size} bytes)")
        text = file.read_text(encoding="utf-8")
    except OSError as failure:
        raise GustformError(
            "GF2030",
            f"the rotor table {str(file)!r} cannot be read: {failure.strerror}",
            hint="the path of a Cp_Ct_Cq file",
        ) from None
    except UnicodeDecodeError:
        raise GustformError("GF2030", f"the rotor table {str(file)!r} is not a text file") from None
    found = _sections(text, str(file))
    for title, needed in _SECTIONS.items():
        if needed and not found.get(title):
            raise _wrong(str(file), 0, f"there is no section '# {title.capitalize()}' with numbers")
    pitch, ratio = _vector(found["pitch angle vector"], str(file)), _vector(found["tsr vector"], str(file))
    blocks = [
        _block(found[title], ratio.size, pitch.size, str(file)) if found.get(title) else None
        for title in ("power coefficient", "thrust coefficient", "torque coefficient")
    ]
    power = blocks[0]
    assert power is not None
    return RotorPerformance(file.name, ratio, pitch, power, blocks[1], blocks[2])


Rows = list[tuple[int, list[float]]]


def _wrong(file: str, line: int, message: str) -> GustformError:
    return GustformError(
        "GF2031", f"not a rotor table: {message}", hint="a Cp_Ct_Cq file as ROSCO writes it", place=Place(file, line)
    )


def _sections(text: str, file: str) -> dict[str, Rows]:
    """Rows of numbers with their line numbers, by the section they stand in."""
    found: dict[str, Rows] = {}
    current: Rows | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if line.startswith("#"):
            title = line.lstrip("# ").lower()
            known = next((name for name in _SECTIONS if title.startswith(name)), None)
            if known in found:
                raise _wrong(file, number, f"the section {known!r} is there twice")
            if known is not None:
                current = found[known] = []
        elif line:
            if current is None:
                raise _wrong(file, number, f"{line[:40]!r} stands before the first section")
            try:
                row = [float(word) for word in line.split()]
            except ValueError:
                raise _wrong(file, number, f"{line[:40]!r} is not a row of numbers") from None
            if not np.all(np.isfinite(row)):
                raise _wrong(file, number, f"{line[:40]!r} has a value that is not finite")
            current.append((number, row))
    return found


def _vector(rows: Rows, file: str) -> Array:
    values = np.array([value for _, row in rows for value in row])
    if values.size < 4:
        raise _wrong(file, rows[0][0], f"a grid needs at least 4 points; got {values.size}")
    if not np.all(np.diff(values) > 0):
        raise _wrong(file, rows[0][0], "grid points must increase")
    return values


def _block(rows: Rows, n_rows: int, n_columns: int, file: str) -> Array:
    for number, row in rows:
        if len(row) != n_columns:
            raise _wrong(
                file, number, f"a row of {n_columns} coefficients was expected (one a pitch angle); got {len(row)}"
            )
    if len(rows) != n_rows:
        raise _wrong(file, rows[0][0], f"{n_rows} rows were expected (one a tip speed ratio); got {len(rows)}")
    return np.array([row for _, row in rows])

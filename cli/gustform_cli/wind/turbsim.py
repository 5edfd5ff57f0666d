"""Full-field files of TurbSim, .bts: a header with scales, then int16 planes (and tower points, left out here).

    speed = (number - intercept) / slope      of each component, m/s

id 7: the box ends; id 8: it is periodic (TurbSim user's guide, v2, "Binary full-field files").
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.wind.box import Box, check_size, tidy
from gustform_cli.wind.csv_file import first_bytes

_HEADER = struct.Struct("<h4i12fi")


def turbsim_box(path: Path) -> Box:
    """The box in a .bts file. GF2501, GF2508."""
    place = Place(str(path))
    head = first_bytes(path, _HEADER.size)
    if len(head) < _HEADER.size or struct.unpack("<h", head[:2])[0] not in (7, 8):
        got = f"it begins with {struct.unpack('<h', head[:2])[0]}" if len(head) >= 2 else "it is empty"
        raise GustformError(
            "GF2508",
            f"a TurbSim file (.bts) must begin with 7 or 8 and a header of {_HEADER.size} bytes; {got}",
            hint="format: with the kind of file it is",
            place=place,
        )
    kind, nz, ny, tower, planes, dz, dy, dt, mean, hub, bottom, slope, intercept, *_, text = _HEADER.unpack(head)
    numbers = 3 * (nz * ny + tower)
    sizes = min(nz, ny, planes) >= 1 and tower >= 0 and 0 <= text <= 10_000 and max(nz, ny, tower) <= 10_000
    if not (
        sizes and all(np.isfinite((dz, dy, dt, mean, hub, bottom, slope, intercept))) and dt > 0.0 and slope != 0.0
    ):
        raise GustformError(
            "GF2508",
            f"the header of the TurbSim file must make sense; got {ny} x {nz} points, {planes} planes, dt {dt:g} s",
            hint="making it again",
            place=place,
        )
    check_size(path, _HEADER.size + text + 2 * numbers * planes, f"{planes} planes of {ny} x {nz} points", place)

    def unpack(raw: NDArray[Any]) -> NDArray[np.float64]:
        grid = raw[:, : 3 * nz * ny].reshape(-1, nz, ny, 3)[..., 0]
        result: NDArray[np.float64] = (grid - float(intercept)) / float(slope)
        return result

    return Box(
        path, _HEADER.size + text, "<i2", numbers, planes, tidy(dt), tidy(mean),
        y=(np.arange(ny) - 0.5 * (ny - 1)) * dy, z=bottom + np.arange(nz) * dz, hub=hub, periodic=kind == 8,
        unpack=unpack,
    )  # fmt: skip

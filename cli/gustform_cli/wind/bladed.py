"""Full-field files of Bladed, .wnd with id -99 and the "improved von Karman" header (4), which TurbSim writes too.

    u = U (1 + TI / 100 * number / 1000)      TI of the longitudinal component in %

dt = dx / U. Only this header tells the intensity; others keep it in a project file and are refused. The planes go from
the bottom upwards; which side a plane begins at is of no account for the hub and the mean over the disc.
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

BLADED = struct.pack("<h", -99)
_IMPROVED_VON_KARMAN = 4
# id, kind, components; latitude, roughness, reference height, 3 intensities; dz, dy, dx; half the planes; U;
# 3 length scales; unused, seed; nz, ny
_HEADER = struct.Struct("<2hi6f3fif3f2i2i")


def bladed_box(path: Path) -> Box:
    """The box in a Bladed .wnd file. GF2501, GF2508."""
    place = Place(str(path))
    head = first_bytes(path, _HEADER.size)
    if head[:2] != BLADED or len(head) < _HEADER.size:
        raise GustformError(
            "GF2508",
            f"a Bladed wind file must begin with -99 and a header of {_HEADER.size} bytes; "
            f"{f'it begins with {head[:8]!r}' if len(head) >= _HEADER.size else f'it has {len(head)} bytes'}",
            hint="format: with the kind of file it is",
            place=place,
        )
    fields = _HEADER.unpack(head)
    kind, components = fields[1:3]
    if kind != _IMPROVED_VON_KARMAN:
        raise GustformError(
            "GF2508",
            f"a Bladed wind file must be of kind 4, whose header tells the intensity; got kind {kind}",
            hint="writing it as TurbSim .bts",
            place=place,
        )
    height, intensity = fields[5], fields[6]
    dz, dy, dx, half, mean = fields[9:14]
    nz, ny = fields[19:21]
    offset = _HEADER.size + (24 if components == 3 else 0)  # length scales of v and w
    numbers, planes = components * nz * ny, 2 * half
    sane = components in (1, 2, 3) and 1 <= nz <= 10_000 and 1 <= ny <= 10_000 and half >= 1
    if not (sane and np.isfinite((dz, dy, dx, mean, intensity, height)).all() and dx > 0.0 and mean > 0.0):
        raise GustformError(
            "GF2508",
            f"the header of the Bladed file must make sense; got {ny} x {nz} points, {planes} planes, U {mean:g} m/s",
            hint="making it again",
            place=place,
        )
    check_size(path, offset + 2 * numbers * planes, f"{planes} planes of {ny} x {nz} points", place)
    scale = 1e-5 * intensity

    def unpack(raw: NDArray[Any]) -> NDArray[np.float64]:
        grid = raw.reshape(-1, nz, ny, components)[..., 0]
        result: NDArray[np.float64] = mean * (1.0 + scale * grid)
        return result

    z = (np.arange(nz) - 0.5 * (nz - 1)) * dz + height
    return Box(
        path, offset, "<i2", numbers, planes, tidy(dx / mean), tidy(mean),
        y=(np.arange(ny) - 0.5 * (ny - 1)) * dy, z=z, hub=height, periodic=False, unpack=unpack,
    )  # fmt: skip

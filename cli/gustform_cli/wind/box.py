"""Full-field wind: planes of the longitudinal speed that pass the rotor one after the other (Taylor's hypothesis).

A box is a file of equal planes behind a header. Plane n passes at n dt, dt = dx / U. What a turbine feels is either
the speed at the hub or the mean over the points of the grid within the rotor disc, all with the same weight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.wind.clean import LOWEST_SPEED
from gustform_cli.wind.reading import reading

_BLOCK = 1 << 21  # bytes read at a time


@dataclass(frozen=True, eq=False)
class Box:
    """A file of planes. Lengths in m, times in s, speeds in m/s.

    `numbers` of type `kind` make a plane, from byte `offset` on; `unpack` turns (planes, numbers) of them into the
    longitudinal speed (planes, z, y).
    """

    path: Path
    offset: int
    kind: str
    numbers: int
    planes: int
    dt: float
    mean: float
    y: NDArray[np.float64]  # of the columns of a plane, 0 in the middle
    z: NDArray[np.float64]  # of its rows, above ground or above the bottom of the box
    hub: float  # z of the hub
    periodic: bool  # the last plane goes before the first
    unpack: Callable[[NDArray[Any]], NDArray[np.float64]]

    @property
    def duration(self) -> float:
        """Time of the last plane, or of the first one's return."""
        return (self.planes if self.periodic else self.planes - 1) * self.dt

    @property
    def samples(self) -> int:
        """Samples of a series: a periodic box closes with its first plane."""
        return self.planes + self.periodic


def check_size(path: Path, needed: int, what: str, place: Place) -> None:
    """GF2508 if a file is shorter than its header says."""
    size = path.stat().st_size
    if size < needed:
        raise GustformError(
            "GF2508",
            f"the wind file must be whole: {what} are {needed} bytes; it has {size}",
            hint="copying or making it again",
            place=place,
        )


def tidy(value: float) -> float:
    """The decimal number that a 4-byte float was made from: 0.05 and not 0.0500000007, which is off by 1 ms in 20 h."""
    return float(f"{value:.7g}")


def hub_weights(box: Box) -> NDArray[np.float64]:
    """Bilinear interpolation at the hub as weights of the points of a plane, (z, y)."""
    z, y = _between(box.z, box.hub), _between(box.y, 0.0)
    return np.outer(z, y)


def _between(axis: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    weights = np.zeros(axis.size)
    upper = int(np.clip(np.searchsorted(axis, at), 1, max(1, axis.size - 1)))
    if axis.size == 1:
        weights[0] = 1.0
        return weights
    share = float(np.clip((at - axis[upper - 1]) / (axis[upper] - axis[upper - 1]), 0.0, 1.0))
    weights[upper - 1], weights[upper] = 1.0 - share, share
    return weights


def disc_weights(box: Box, radius: float) -> tuple[NDArray[np.float64], list[str]]:
    """The mean over the rotor disc as weights of the points of a plane, and what is to be said about it."""
    distance = np.hypot(*np.meshgrid(box.y, box.z - box.hub))
    inside = distance <= radius * (1.0 + 1e-9)
    if not inside.any():
        inside = distance <= distance.min() * (1.0 + 1e-9)
    steps = [float(np.diff(axis).max()) if axis.size > 1 else np.inf for axis in (box.y, box.z)]
    reach = [
        min(abs(float(axis[0])), abs(float(axis[-1]))) + 0.5 * step
        for axis, step in zip((box.y, box.z - box.hub), steps, strict=True)
    ]
    warnings = []
    if min(reach) < radius:
        warnings.append(
            f"the grid, {np.ptp(box.y):.4g} m x {np.ptp(box.z):.4g} m, does not cover the rotor of {radius:g} m "
            f"radius: averaged over the {int(inside.sum())} points that there are"
        )
    elif inside.sum() < 5:
        warnings.append(f"only {int(inside.sum())} points of the grid lie within the rotor of {radius:g} m radius")
    return inside / inside.sum(), warnings


class BoxWind:
    """Speeds of a box as the rotor feels them: the reader of a uniform runtime series, at any place at once."""

    def __init__(self, box: Box, weights: NDArray[np.float64]) -> None:
        self._box, self._weights = box, weights
        itemsize = np.dtype(box.kind).itemsize
        self._plane = box.numbers * itemsize
        self._per_block = max(1, _BLOCK // self._plane)
        self._kept: dict[int, NDArray[np.float64]] = {}

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end."""
        count = max(0, min(count, self._box.samples - first))
        times = np.arange(first, first + count, dtype=np.float64) * self._box.dt
        speeds = np.empty(count)
        done = 0
        while done < count:
            plane = (first + done) % self._box.planes
            block, offset = divmod(plane, self._per_block)
            part = self._block(block)[offset : offset + count - done]
            speeds[done : done + part.size] = part
            done += part.size
        return times, np.maximum(speeds, LOWEST_SPEED)

    def _block(self, number: int) -> NDArray[np.float64]:
        """Speeds of a block of planes; the last few blocks are kept."""
        if number not in self._kept:
            while len(self._kept) >= 3:
                del self._kept[next(iter(self._kept))]
            self._kept[number] = self._read(number)
        return self._kept[number]

    def _read(self, number: int) -> NDArray[np.float64]:
        box, first = self._box, number * self._per_block
        planes = min(self._per_block, box.planes - first)
        place = Place(str(box.path))
        with reading(box.path):
            raw = np.fromfile(box.path, box.kind, planes * box.numbers, offset=box.offset + first * self._plane)
        check_size(box.path, box.offset + (first + planes) * self._plane, f"{first + planes} planes", place)
        speeds = np.tensordot(box.unpack(raw.reshape(planes, box.numbers)), self._weights, axes=2)
        wrong = np.flatnonzero(~np.isfinite(speeds))
        if wrong.size:
            raise GustformError(
                "GF2505",
                f"the wind file must have numbers; one of plane {first + int(wrong[0]) + 1} of {box.planes} is none",
                hint="making the box again",
                place=place,
            )
        result: NDArray[np.float64] = np.asarray(speeds, dtype=np.float64)
        return result

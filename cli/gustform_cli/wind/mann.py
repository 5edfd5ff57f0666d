"""Mann boxes: files as HAWC2 takes them (.bin, float32, one component, no header), and boxes made by hipersim.

A file says nothing of itself: its shape, spacing and mean wind stand in the scenario. It holds the fluctuation u' with
z running fastest, then y, then x; the planes pass in the order of the file, as InflowWind reads them. (hipersim has the
first plane pass last: the same statistics, backwards.) Mann boxes are periodic in x.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError, Place
from gustform_cli.wind.box import Box
from gustform_cli.wind.clean import LOWEST_SPEED
from gustform_cli.wind.reading import reading


def mann_box(
    path: Path, shape: tuple[int, int, int], spacing: tuple[float, float, float], mean: float, scale: float
) -> Box:
    """The box in a file of the longitudinal component. GF2501, GF2509 if the file has another size."""
    nx, ny, nz = shape
    dx, dy, dz = spacing
    with reading(path):
        size = path.stat().st_size
    if size != 4 * nx * ny * nz:
        planes, rest = divmod(size, 4 * ny * nz)
        raise GustformError(
            "GF2509",
            f"a Mann box of shape [{nx}, {ny}, {nz}] must have {4 * nx * ny * nz} bytes; the file has {size}",
            hint=f"shape: [{planes}, {ny}, {nz}]" if rest == 0 and planes else "the shape that it was made with",
            place=Place(str(path)),
        )

    def unpack(raw: NDArray[Any]) -> NDArray[np.float64]:
        grid = raw.reshape(-1, ny, nz).transpose(0, 2, 1).astype(np.float64)
        result: NDArray[np.float64] = mean + scale * grid
        return result

    return Box(
        path, 0, "<f4", ny * nz, nx, dx / mean, mean,
        y=np.asarray((np.arange(ny) - 0.5 * (ny - 1)) * dy, dtype=np.float64),
        z=np.arange(nz, dtype=np.float64) * dz, hub=0.5 * (nz - 1) * dz, periodic=True,
        unpack=unpack,
    )  # fmt: skip


# ---- made by hipersim -----------------------------------------------------------------------------------------------
ANISOTROPY = 3.9  # IEC 61400-1 ed. 3, annex B.1: gamma = 3.9, l = 0.8 Lambda_1
_POINTS = 16  # across the rotor, for the mean over the disc


def check_hipersim() -> None:
    """GF2512 if hipersim is not installed."""
    try:
        import hipersim  # noqa: F401
    except ImportError as error:
        raise GustformError(
            "GF2512",
            f"turbulence with model: mann needs the package hipersim; {error}",
            hint="pip install gustform[mann], or model: kaimal",
        ) from None


class MannTurbulence:
    """A Mann box as one turbine feels it, made when the first sample is asked for: the reader of a uniform series.

    Its size is `duration` rounded up to a power of two of planes, and it is periodic. `deviation` scales it, so that
    its points have this standard deviation on average, m/s. `radius` None: the wind at the hub.
    """

    def __init__(
        self,
        *,
        mean: float,
        deviation: float,
        length: float,
        step: float,
        duration: float,
        seed: int,
        radius: float | None,
    ) -> None:
        check_hipersim()
        self.dt, self.mean, self._radius = step, mean, radius
        self._deviation, self._length, self._seed = deviation, length, seed
        self.planes = 1 << max(6, math.ceil(math.log2(duration / step * (1.0 - 1e-12))))
        self._speeds: NDArray[np.float64] | None = None

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end of the box."""
        if self._speeds is None:
            self._speeds = self._make()
        count = max(0, min(count, self.planes + 1 - first))
        numbers = np.arange(first, first + count)
        return numbers.astype(np.float64) * self.dt, self._speeds[numbers % self.planes]

    def _make(self) -> NDArray[np.float64]:
        from hipersim import MannTurbulenceField

        across = 2.0 * self._radius / (_POINTS - 1) if self._radius is not None else 4.0
        points = _POINTS if self._radius is not None else 4
        field = MannTurbulenceField.generate(
            alphaepsilon=1.0, L=self._length, Gamma=ANISOTROPY, Nxyz=(self.planes, points, points),
            dxyz=(self.mean * self.dt, across, across), seed=self._seed, double_xyz=(False, True, True),
        )  # fmt: skip
        u = np.asarray(field.uvw[0], dtype=np.float64)
        u *= self._deviation / math.sqrt(float(np.mean(np.var(u, axis=0))))
        if self._radius is None:
            speeds = u[:, points // 2, points // 2]
        else:
            axis = (np.arange(points) - 0.5 * (points - 1)) * across
            inside = np.hypot(*np.meshgrid(axis, axis)) <= self._radius
            speeds = u[:, inside].mean(axis=1)
        result: NDArray[np.float64] = np.maximum(self.mean + speeds, LOWEST_SPEED)
        return result

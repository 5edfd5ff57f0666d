"""Two-dimensional table data and its resampling to a uniform bicubic B-spline.

The runtime evaluates a C2 spline on a uniform grid (a few nanoseconds); data on a non-uniform grid is resampled and
the largest difference at the given points is kept in `resampling_error`, for the report.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError

_MAX_GRID = 512


@dataclass(frozen=True, eq=False)
class TableData:
    """value[i, j] at x[i], y[j], in the units of the declaration. Outside the grid arguments are clamped."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    value: NDArray[np.float64]
    name: str = "table"
    _spline: dict[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        for label, grid in (("x", self.x), ("y", self.y)):
            if grid.ndim != 1 or grid.size < 4:
                raise GustformError("GF2010", f"{self.name}: {label} needs at least 4 grid points; got {grid.size}")
            if not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0):
                raise GustformError("GF2010", f"{self.name}: {label} must be finite and increasing")
        if self.value.shape != (self.x.size, self.y.size):
            raise GustformError(
                "GF2010", f"{self.name}: values are {self.value.shape}, the grid is {(self.x.size, self.y.size)}"
            )
        if not np.all(np.isfinite(self.value)):
            bad = int(np.argmin(np.isfinite(self.value)))
            raise GustformError("GF2010", f"{self.name}: value number {bad} is not finite")

    @property
    def resampling_error(self) -> float:
        """Largest difference at the given points between the data and the spline."""
        return float(self.spline()["error"])

    def spline(self) -> dict[str, Any]:
        """Uniform grid and B-spline coefficients: x_start, x_step, n_x, y_start, y_step, n_y, coefficient, error."""
        if not self._spline:
            self._spline.update(_uniform_spline(self.x, self.y, self.value))
        return self._spline

    def evaluate(
        self, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Value and both partial derivatives of the spline at points; the same formula as the C runtime."""
        return evaluate_spline(self.spline(), x, y)


def evaluate_spline(
    s: dict[str, Any], x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Value and both partial derivatives of a spline as `TableData.spline` gives it."""
    width = s["n_y"] + 2
    i, wa, da = _weights(x, s["x_start"], s["x_step"], s["n_x"])
    j, wb, db = _weights(y, s["y_start"], s["y_step"], s["n_y"])
    value, dx, dy = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for a in range(4):
        for b in range(4):
            c = s["coefficient"][(i + a) * width + j + b]
            value += wa[a] * wb[b] * c
            dx += da[a] * wb[b] * c
            dy += wa[a] * db[b] * c
    return value, dx, dy


def _weights(x: NDArray[np.float64], start: float, step: float, n: int) -> tuple[NDArray[np.int64], Any, Any]:
    s = (x - start) / step
    slope = np.where((s < 0) | (s > n - 1), 0.0, 1.0 / step)
    s = np.clip(s, 0.0, n - 1.0)
    i = np.minimum(s.astype(np.int64), n - 2)
    a = s - i
    b = 1.0 - a
    weights = [b**3 / 6, (4 + a * a * (3 * a - 6)) / 6, (4 + b * b * (3 * b - 6)) / 6, a**3 / 6]
    slopes = [-b * b / 2 * slope, a * (1.5 * a - 2) * slope, b * (2 - 1.5 * b) * slope, a * a / 2 * slope]
    return i, weights, slopes


def _natural_second_derivatives(x: NDArray[np.float64], f: NDArray[np.float64]) -> NDArray[np.float64]:
    """Second derivatives of the natural cubic spline through f[i, ...] at x[i]."""
    n = x.size
    h = np.diff(x)
    a = np.eye(n)
    r = np.zeros_like(f)
    for k in range(1, n - 1):
        a[k, k - 1 : k + 2] = h[k - 1], 2 * (h[k - 1] + h[k]), h[k]
        r[k] = 6 * ((f[k + 1] - f[k]) / h[k] - (f[k] - f[k - 1]) / h[k - 1])
    return np.asarray(np.linalg.solve(a, r), dtype=np.float64)


def _resample(x: NDArray[np.float64], f: NDArray[np.float64], onto: NDArray[np.float64]) -> NDArray[np.float64]:
    m = _natural_second_derivatives(x, f)
    i = np.clip(np.searchsorted(x, onto, side="right") - 1, 0, x.size - 2)
    h = (x[i + 1] - x[i])[:, None]
    a, b = (x[i + 1] - onto)[:, None] / h, (onto - x[i])[:, None] / h
    bend = ((a**3 - a) * m[i] + (b**3 - b) * m[i + 1]) * h * h / 6
    return np.asarray(a * f[i] + b * f[i + 1] + bend)


def _uniform_grid(x: NDArray[np.float64]) -> NDArray[np.float64]:
    steps = np.diff(x)
    if np.allclose(steps, steps.mean(), rtol=1e-6):
        return x
    count = min(round(float((x[-1] - x[0]) / steps.min())) + 1, _MAX_GRID)
    return np.linspace(x[0], x[-1], count)


def _coefficients(f: NDArray[np.float64]) -> NDArray[np.float64]:
    """B-spline coefficients (n + 2 rows) of the natural spline through f[i, ...] on a uniform grid."""
    n = f.shape[0]
    a = np.zeros((n + 2, n + 2))
    right = np.zeros((n + 2, *f.shape[1:]))
    for k in range(n):
        a[k, k : k + 3] = 1 / 6, 4 / 6, 1 / 6
        right[k] = f[k]
    a[n, 0:3] = 1.0, -2.0, 1.0
    a[n + 1, n - 1 : n + 2] = 1.0, -2.0, 1.0
    return np.asarray(np.linalg.solve(a, right), dtype=np.float64)


def _uniform_spline(x: NDArray[np.float64], y: NDArray[np.float64], value: NDArray[np.float64]) -> dict[str, Any]:
    gx, gy = _uniform_grid(x), _uniform_grid(y)
    on_x = value if gx is x else _resample(x, value, gx)
    on_grid = on_x if gy is y else _resample(y, on_x.T.copy(), gy).T
    coefficient = _coefficients(_coefficients(on_grid).T.copy()).T
    spline: dict[str, Any] = {
        "x_start": float(gx[0]),
        "x_step": float((gx[-1] - gx[0]) / (gx.size - 1)),
        "n_x": int(gx.size),
        "y_start": float(gy[0]),
        "y_step": float((gy[-1] - gy[0]) / (gy.size - 1)),
        "n_y": int(gy.size),
        "coefficient": np.ascontiguousarray(coefficient).ravel(),
        "error": 0.0,
    }
    xx, yy = np.meshgrid(x, y, indexing="ij")
    spline["error"] = float(np.max(np.abs(evaluate_spline(spline, xx.ravel(), yy.ravel())[0] - value.ravel())))
    return spline

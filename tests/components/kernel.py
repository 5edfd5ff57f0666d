"""A compiled kernel, called from Python at one point: what gust_kernel.h declares, by ctypes."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.table import TableData

Array = NDArray[np.float64]
_Doubles = ctypes.POINTER(ctypes.c_double)


class _Table(ctypes.Structure):
    _fields_ = [
        ("x_start", ctypes.c_double), ("x_step_inverse", ctypes.c_double),
        ("y_start", ctypes.c_double), ("y_step_inverse", ctypes.c_double),
        ("n_x", ctypes.c_int32), ("n_y", ctypes.c_int32), ("coefficient", _Doubles),
    ]  # fmt: skip


class _Point(ctypes.Structure):
    _fields_ = [
        ("t", ctypes.c_double), ("cj", ctypes.c_double),
        *((name, _Doubles) for name in ("y", "yp", "w", "u", "d", "p", "c")),
        ("tables", ctypes.POINTER(ctypes.POINTER(_Table))),
    ]  # fmt: skip


_Evaluate = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Point), _Doubles)
_Residual = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Point), _Doubles, _Doubles)
_Prepare = ctypes.CFUNCTYPE(None, _Doubles, _Doubles)

_COUNTS = (
    "n_unknowns", "n_external", "n_inputs", "n_parameters", "n_constants", "n_discrete", "n_tables", "n_flows",
    "n_nonzeros", "n_outputs", "n_roots", "n_whens",
)  # fmt: skip


class _Kernel(ctypes.Structure):
    _fields_ = [
        ("abi", ctypes.c_uint32), ("type_name", ctypes.c_char_p),
        *((name, ctypes.c_int32) for name in _COUNTS),
        ("jacobian_row", ctypes.POINTER(ctypes.c_int32)), ("jacobian_column", ctypes.POINTER(ctypes.c_int32)),
        ("prepare", _Prepare), ("residual", _Residual), ("jacobian", _Evaluate), ("outputs", _Evaluate),
        ("roots", _Evaluate), ("when", ctypes.c_void_p),
    ]  # fmt: skip


@dataclass
class Point:
    """Where a kernel is evaluated."""

    y: Array
    yp: Array
    w: Array
    u: Array
    d: Array
    p: Array
    tables: list[TableData] = field(default_factory=list)


class CompiledKernel:
    """The kernel of one shared library."""

    def __init__(self, path: Path) -> None:
        self._library = ctypes.CDLL(str(path))
        getter = self._library.gust_kernel_get
        getter.restype = ctypes.POINTER(_Kernel)
        self.struct: Any = getter().contents
        self._kept: list[Any] = []

    def count(self, name: str) -> int:
        return int(getattr(self.struct, name))

    def _point(self, at: Point, cj: float) -> Any:
        kept: list[Any] = []

        def pointer(values: Array) -> Any:
            array = np.ascontiguousarray(values, dtype=np.float64)
            kept.append(array)
            return array.ctypes.data_as(_Doubles)

        constants = np.zeros(max(self.count("n_constants"), 1))
        self.struct.prepare(pointer(at.p), constants.ctypes.data_as(_Doubles))
        tables = (ctypes.POINTER(_Table) * max(len(at.tables), 1))()
        for k, data in enumerate(at.tables):
            s = data.spline()
            table = _Table(
                s["x_start"], 1.0 / s["x_step"], s["y_start"], 1.0 / s["y_step"], s["n_x"], s["n_y"],
                pointer(s["coefficient"]),
            )  # fmt: skip
            kept.append(table)
            tables[k] = ctypes.pointer(table)
        point = _Point(0.0, cj, *(pointer(v) for v in (at.y, at.yp, at.w, at.u, at.d, at.p, constants)), tables)
        self._kept = kept  # ctypes does not hold what it points at
        return point

    def _evaluate(self, function: str, at: Point, cj: float, n: int) -> Array:
        value = np.zeros(max(n, 1))
        getattr(self.struct, function)(ctypes.byref(self._point(at, cj)), value.ctypes.data_as(_Doubles))
        return value[:n]

    def residual(self, at: Point) -> Array:
        """Rows, then flows."""
        n, m = self.count("n_unknowns"), self.count("n_flows")
        rows, flows = np.zeros(max(n, 1)), np.zeros(max(m, 1))
        point = self._point(at, 0.0)
        self.struct.residual(ctypes.byref(point), rows.ctypes.data_as(_Doubles), flows.ctypes.data_as(_Doubles))
        return np.concatenate([rows[:n], flows[:m]])

    def jacobian(self, at: Point, cj: float) -> Array:
        """d(rows, flows)/d(y, w) + cj d(rows, flows)/dy', dense."""
        values = self._evaluate("jacobian", at, cj, self.count("n_nonzeros"))
        shape = (
            self.count("n_unknowns") + self.count("n_flows"),
            self.count("n_unknowns") + self.count("n_external"),
        )
        dense = np.zeros(shape)
        for k, value in enumerate(values):
            dense[self.struct.jacobian_row[k], self.struct.jacobian_column[k]] = value
        return dense

    def roots(self, at: Point) -> Array:
        return self._evaluate("roots", at, 0.0, self.count("n_roots"))

    def outputs(self, at: Point) -> Array:
        return self._evaluate("outputs", at, 0.0, self.count("n_outputs"))

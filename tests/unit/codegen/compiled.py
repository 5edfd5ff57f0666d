"""Compiled kernels called from Python, straight through the structs of gust_kernel.h."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.table import TableData

Array = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[3]
INCLUDE = ROOT / "runtime" / "include"

# What generated C must survive, as an error.
STRICT = ("-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror")

Double = ctypes.POINTER(ctypes.c_double)


class TableStruct(ctypes.Structure):
    _fields_ = [
        ("x_start", ctypes.c_double), ("x_step_inverse", ctypes.c_double),
        ("y_start", ctypes.c_double), ("y_step_inverse", ctypes.c_double),
        ("n_x", ctypes.c_int32), ("n_y", ctypes.c_int32), ("coefficient", Double),
    ]  # fmt: skip


class PointStruct(ctypes.Structure):
    _fields_ = [
        ("t", ctypes.c_double), ("cj", ctypes.c_double),
        *[(name, Double) for name in ("y", "yp", "w", "u", "d", "p", "c")],
        ("tables", ctypes.POINTER(ctypes.POINTER(TableStruct))),
    ]  # fmt: skip


COUNTS = (
    "n_unknowns", "n_external", "n_inputs", "n_parameters", "n_constants", "n_discrete", "n_tables", "n_flows",
    "n_nonzeros", "n_outputs", "n_roots", "n_whens",
)  # fmt: skip
At = ctypes.POINTER(PointStruct)


class KernelStruct(ctypes.Structure):
    _fields_ = [
        ("abi", ctypes.c_uint32), ("type_name", ctypes.c_char_p), *[(name, ctypes.c_int32) for name in COUNTS],
        ("jacobian_row", ctypes.POINTER(ctypes.c_int32)), ("jacobian_column", ctypes.POINTER(ctypes.c_int32)),
        ("prepare", ctypes.CFUNCTYPE(None, Double, Double)),
        ("residual", ctypes.CFUNCTYPE(None, At, Double, Double)),
        *[(name, ctypes.CFUNCTYPE(None, At, Double)) for name in ("jacobian", "outputs", "roots")],
        ("when", ctypes.CFUNCTYPE(None, At, ctypes.c_int32, Double, Double)),
    ]  # fmt: skip


def compile_strictly(text: str, folder: Path, *flags: str) -> Path:
    """Compile a kernel with every warning an error; the compiler's words are the assertion's message."""
    source, library = folder / "kernel.c", folder / "kernel.so"
    source.write_text(text, encoding="utf-8")
    run = subprocess.run(
        ["gcc", *STRICT, "-O2", *flags, "-fPIC", "-shared", f"-I{INCLUDE}", str(source), "-o", str(library), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return library


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(Double)


class CompiledKernel:
    """A kernel library with one set of parameters and tables."""

    def __init__(self, library: Path, parameters: Sequence[float] | Array, tables: Sequence[TableData] = ()) -> None:
        self._library = ctypes.CDLL(str(library))
        getter = self._library.gust_kernel_get
        getter.restype = ctypes.POINTER(KernelStruct)
        self.kernel = getter().contents
        self.counts = {name: int(getattr(self.kernel, name)) for name in COUNTS}
        assert len(parameters) == self.counts["n_parameters"]
        self.p = np.array([*parameters, 0.0], dtype=np.float64)
        # One more than needed, as a tripwire: what a kernel must not write stays NaN.
        self.c = np.full(self.counts["n_constants"] + 1, np.nan)
        self.kernel.prepare(_pointer(self.p), _pointer(self.c))
        assert np.isnan(self.c[-1])
        assert not np.isnan(self.c[:-1]).any()
        self._coefficients = [np.array(t.spline()["coefficient"]) for t in tables]
        self._tables = [
            TableStruct(s["x_start"], 1 / s["x_step"], s["y_start"], 1 / s["y_step"], s["n_x"], s["n_y"], _pointer(c))
            for s, c in zip((t.spline() for t in tables), self._coefficients, strict=True)
        ]
        pointers = [ctypes.pointer(t) for t in self._tables]
        self._pointers = (ctypes.POINTER(TableStruct) * max(len(pointers), 1))(*pointers)

    @property
    def pattern(self) -> tuple[list[int], list[int]]:
        n = self.counts["n_nonzeros"]
        return self.kernel.jacobian_row[:n], self.kernel.jacobian_column[:n]

    def _call(self, sizes: Sequence[int], point: Sequence[Array], cj: float, call: Callable[..., None]) -> list[Array]:
        arrays = [np.array([*a, np.nan], dtype=np.float64) for a in point]  # NaN after the end: reading it shows
        at = PointStruct(0.0, cj, *[_pointer(a) for a in arrays], _pointer(self.p), _pointer(self.c), self._pointers)
        outputs = [np.full(size + 1, np.nan) for size in sizes]
        call(ctypes.byref(at), *[_pointer(o) for o in outputs])
        assert all(np.isnan(o[-1]) for o in outputs)
        return [o[:-1] for o in outputs]

    def residual(self, *point: Array) -> Array:
        """Rows, then flows, at (y, yp, w, u, d)."""
        sizes = (self.counts["n_unknowns"], self.counts["n_flows"])
        return np.concatenate(self._call(sizes, point, 0.0, self.kernel.residual))

    def jacobian(self, *point: Array, cj: float) -> Array:
        return self._call([self.counts["n_nonzeros"]], point, cj, self.kernel.jacobian)[0]

    def outputs(self, *point: Array) -> Array:
        return self._call([self.counts["n_outputs"]], point, 0.0, self.kernel.outputs)[0]

    def roots(self, *point: Array) -> Array:
        return self._call([self.counts["n_roots"]], point, 0.0, self.kernel.roots)[0]

    def when(self, clause: int, *point: Array) -> tuple[Array, Array]:
        """y and d after the clause; NaN where it writes nothing."""
        sizes = (self.counts["n_unknowns"], self.counts["n_discrete"])
        y, d = self._call(sizes, point, 0.0, lambda at, *out: self.kernel.when(at, clause, *out))
        return y, d

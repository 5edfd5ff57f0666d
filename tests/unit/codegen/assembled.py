"""A linked system evaluated through its table and its compiled kernels, the way the runtime reads them.

Only the arrays of the SystemTable are used: what is wrong in them shows in the numbers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.language.table import TableData
from gustform_codegen.link import Linked
from gustform_codegen.table import SystemTable
from tests.unit.codegen.compiled import CompiledKernel

Array = NDArray[np.float64]


class Assembled:
    """Residual, sparse Jacobian and outputs of a linked system. Table data of instances is given by hand."""

    def __init__(self, linked: Linked, table: SystemTable | None = None, data: list[TableData] | None = None) -> None:
        self.table = table or linked.table
        self.n = self.table.n_unknowns
        self.kernels = [
            [
                CompiledKernel(
                    Path(t.kernel_path), t.parameters[k], [(data or [])[i] for i in t.table[k]] if t.table.size else []
                )
                for k in range(len(t.instance_names))
            ]
            for t in self.table.types
        ]

    def _points(self, y: Array, yp: Array) -> list[tuple[int, int, CompiledKernel, list[Array]]]:
        result = []
        for number, t in enumerate(self.table.types):
            for k, kernel in enumerate(self.kernels[number]):
                own = slice(int(t.first_unknown[k]), int(t.first_unknown[k]) + kernel.counts["n_unknowns"])
                first = int(t.first_input[k])
                u = self.table.input_value[first : first + kernel.counts["n_inputs"]]
                point = [y[own], yp[own], y[t.external[k]], u, t.discrete[k]]
                result.append((number, k, kernel, point))
        return result

    def residual(self, y: Array, yp: Array) -> Array:
        result = np.zeros(self.n)
        for number, k, kernel, point in self._points(y, yp):
            t, n = self.table.types[number], kernel.counts["n_unknowns"]
            values = kernel.residual(*point)
            first = int(t.first_unknown[k])
            result[first : first + n] = values[:n]
            np.add.at(result, t.flow_row[k], values[n:])
        return result

    def values(self, y: Array, yp: Array, cj: float) -> Array:
        """CSC values of the Jacobian."""
        result = np.zeros(self.table.row_index.size)
        for number, k, kernel, point in self._points(y, yp):
            np.add.at(result, self.table.types[number].jacobian_position[k], kernel.jacobian(*point, cj=cj))
        return result

    def jacobian(self, y: Array, yp: Array, cj: float) -> Array:
        """Dense."""
        columns = np.repeat(np.arange(self.n), np.diff(self.table.column_start))
        dense = np.zeros((self.n, self.n))
        dense[self.table.row_index, columns] = self.values(y, yp, cj)
        return dense

    def differences(self, y: Array, yp: Array, cj: float) -> Array:
        """The same by central differences of the residual along (1, cj)."""
        h = 1e-6
        dense = np.zeros((self.n, self.n))
        for k in range(self.n):
            step = np.zeros(self.n)
            step[k] = h
            above, below = (self.residual(y + s * step, yp + s * cj * step) for s in (1, -1))
            dense[:, k] = (above - below) / (2 * h)
        return dense

    def rest(self) -> Array:
        """The point where everything stands still, by Newton's method with y' = 0."""
        y, zero = self.table.start.copy(), np.zeros(self.n)
        for _ in range(50):
            residual = self.residual(y, zero)
            if np.max(np.abs(residual)) < 1e-12:
                break
            y -= np.linalg.solve(self.jacobian(y, zero, 0.0), residual)
        return y

    def channels(self, y: Array, yp: Array) -> dict[str, float]:
        """Every channel's value by name."""
        points = self._points(y, yp)
        outputs: dict[int, Array] = {}
        result = {}
        for c in self.table.channels:
            if c.kind == 0:
                result[c.name] = float(y[c.a])
                continue
            if c.a not in outputs:
                outputs[c.a] = points[c.a][2].outputs(*points[c.a][3])
            result[c.name] = float(outputs[c.a][c.b])
        return result

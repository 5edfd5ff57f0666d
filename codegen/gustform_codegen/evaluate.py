"""Numeric evaluation of unit types through CasADi's own virtual machine, for all instances at once.

Used where no compiled code is wanted: the steady-state start, linearisation, and tests that compare the compiled
kernels with CasADi.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.language.table import evaluate_spline
from gustform_codegen.column_function import ColumnFunction
from gustform_codegen.emit.kernel import pattern_and_jacobian
from gustform_codegen.unit_type import UnitType

Array = NDArray[np.float64]
Ints = NDArray[np.int32]


class TypeEvaluator:
    """Residual rows, flows and initial equations of one type, with derivatives; arguments are (n, instances).

    `table` holds the number of each instance's tables (instances, tables) among `splines`; both are data of the
    instances, not of the type.
    """

    def __init__(self, unit: UnitType, table: Ints | None = None, splines: Sequence[dict[str, Any]] = ()) -> None:
        self.unit = unit
        self.table = table
        self.splines = splines
        self.y = ca.SX.sym("y", 0) if not unit.unknowns else ca.vertcat(*[u.symbol for u in unit.unknowns])
        self.yp = ca.vertcat(*[u.der if u.der is not None else ca.SX.sym("no_der") for u in unit.unknowns])
        self.w = ca.vertcat(*[x.symbol for x in unit.externals])
        self.u = ca.vertcat(*[s.symbol for s in unit.inputs])
        self.d = ca.vertcat(*[s.symbol for s in unit.discretes])
        self.p = ca.vertcat(*[s.symbol for s in unit.parameters])
        self._cj = ca.SX.sym("cj")
        self._values = ca.vertcat(
            *[r.expression for r in unit.rows],
            *[f.expression for f in unit.flows],
            *[r.expression for r in unit.initial],
        )
        call_symbols = [s for c in unit.calls for s in (c.value, c.x_slope, c.y_slope)]
        self._calls = ca.vertcat(*call_symbols) if call_symbols else ca.SX.sym("calls", 0)
        self._arguments = [self.y, self.yp, self.w, self.u, self.d, self.p, self._calls]
        self._residual = self._function("residual", [self._values])
        self._call_arguments = [self._function(f"call{k}", [c.x, c.y]) for k, c in enumerate(unit.calls)]
        self._jacobian: ColumnFunction | None = None
        self._initial_pattern: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None

    def over(self, table: Ints, splines: Sequence[dict[str, Any]]) -> TypeEvaluator:
        """The same functions over the tables of other instances."""
        other = copy.copy(self)
        other.table, other.splines = table, splines
        return other

    def _function(self, name: str, expressions: list[Any]) -> ColumnFunction:
        return ColumnFunction(name, self._arguments, expressions)

    def _call_values(self, arguments: list[Array]) -> Array:
        n = arguments[0].shape[1]
        values = np.zeros((3 * len(self.unit.calls), n))
        for k, call in enumerate(self.unit.calls):
            x, y = self._call_arguments[k]([*arguments, values])
            assert self.table is not None
            numbers = self.table[:, call.table]
            for number in np.unique(numbers):
                some = np.flatnonzero(numbers == number)
                values[3 * k : 3 * k + 3, some] = evaluate_spline(self.splines[number], x[0, some], y[0, some])
        return values

    def residual(self, y: Array, yp: Array, w: Array, u: Array, d: Array, p: Array) -> Array:
        """Rows, then flows, then initial equations, for each instance (columns)."""
        arguments = [y, yp, w, u, d, p]
        return self._residual([*arguments, self._call_values(arguments)])[0]

    def total_jacobian(self, values: Any, columns: Any) -> Any:
        """The derivative of `values` with respect to the symbols in `columns`, also through the tables."""
        total = ca.jacobian(values, columns)
        gradients: list[Any] = []
        for number, call in enumerate(self.unit.calls):

            def whole(e: Any, number: int = number) -> Any:
                g = ca.jacobian(e, columns)
                for c, previous in zip(self.unit.calls[:number], gradients, strict=True):
                    g = g + ca.jacobian(e, c.value) @ previous
                return g

            gradient = call.x_slope * whole(call.x) + call.y_slope * whole(call.y)
            total = total + ca.jacobian(values, call.value) @ gradient
            gradients.append(gradient)
        return total

    def initial_pattern(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of `initial_jacobian`: columns are y, then w, then yp, then the free parameters."""
        if self._initial_pattern is None:
            unit = self.unit
            free = [unit.parameters[k].symbol for k in unit.free_parameters]
            columns = ca.vertcat(self.y, self.w, self.yp, *free)
            if self._values.numel() == 0 or columns.numel() == 0:
                self._initial_pattern = (np.zeros(0, int), np.zeros(0, int))
                return self._initial_pattern
            total = ca.sparsify(self.total_jacobian(self._values, columns))
            rows, cols = total.sparsity().get_triplet()
            self._jacobian = self._function("jacobian", [ca.vertcat(*[total.nz[k] for k in range(total.nnz())])])
            self._initial_pattern = (np.array(rows, int), np.array(cols, int))
        return self._initial_pattern

    def initial_jacobian(self, y: Array, yp: Array, w: Array, u: Array, d: Array, p: Array) -> Array:
        """Nonzeros (pattern order) for each instance (columns)."""
        self.initial_pattern()
        if self._jacobian is None:
            return np.zeros((0, y.shape[1]))
        arguments = [y, yp, w, u, d, p]
        return self._jacobian([*arguments, self._call_values(arguments)])[0]

    def kernel_jacobian(self, y: Array, yp: Array, w: Array, u: Array, d: Array, p: Array, cj: float) -> Array:
        """What the compiled kernel's `jacobian` gives, by CasADi (for tests)."""
        _, _, entries = pattern_and_jacobian(self.unit, self._cj)
        expression = ca.substitute(ca.vertcat(*entries), self._cj, ca.SX(cj))
        arguments = [y, yp, w, u, d, p]
        return self._function("kernel", [expression])([*arguments, self._call_values(arguments)])[0]

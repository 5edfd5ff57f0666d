"""The steady-state start: all derivatives zero, solved by Newton's method or else by Ipopt with the declared bounds.

Unknowns are the system's unknowns, the derivatives of `fixed` states (whose values are kept) and the free parameters;
equations are the residual rows, the flow sums and the initial equations. Residuals and the sparse Jacobian come from
the unit types, evaluated for all instances at once, so a thousand turbines cost a thousand evaluations, not a larger
symbolic problem.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any
from weakref import WeakSet

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_codegen.evaluate import Array, TypeEvaluator
from gustform_codegen.link import Linked, LinkedType
from gustform_codegen.newton import newton
from gustform_codegen.sampled_start import held_start
from gustform_codegen.table import SystemTable
from gustform_codegen.unit_type import UnitType

_ACCEPT = 1e-7  # largest scaled residual that still counts as solved


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Start values and free parameters in place, with how they were reached."""

    table: SystemTable
    iterations: int
    largest_residual: float
    free: dict[str, float]


@lru_cache(maxsize=128)
def _evaluator(unit: UnitType) -> TypeEvaluator:
    """The evaluator of a unit type with its derivatives; made once in a process."""
    evaluator = TypeEvaluator(unit)
    evaluator.initial_pattern()
    return evaluator


class _Problem:
    """Maps between Ipopt's vector and the arguments of each type."""

    def __init__(self, linked: Linked) -> None:
        self.linked = linked
        splines = [lookup.spline for lookup in linked.table.tables]
        self.evaluators = [_evaluator(t.unit).over(t.table.table, splines) for t in linked.types]
        n = linked.table.n_unknowns
        self.n = n
        scale: list[float] = list(linked.table.nominal)
        start: list[float] = list(linked.table.start)
        low, high = [-np.inf] * n, [np.inf] * n
        self.fixed: list[int] = []  # global indices of fixed states
        self.der_column: list[NDArray[np.int64]] = []  # per type (instances, unknowns): column or -1
        self.free_column: list[NDArray[np.int64]] = []
        n_rows = n
        self.initial_row: list[NDArray[np.int64]] = []
        self.row_texts: dict[int, str] = {}
        position = n
        for t in linked.types:
            ni = len(t.names)
            der = np.full((ni, len(t.unit.unknowns)), -1)
            for j, u in enumerate(t.unit.unknowns):
                declared: Any = u.declared.declaration
                where = t.table.first_unknown + j
                for k in where:
                    low[k] = -np.inf if getattr(declared, "min", None) is None else declared.min
                    high[k] = np.inf if getattr(declared, "max", None) is None else declared.max
                if u.der is not None and getattr(declared, "fixed", False):
                    self.fixed += [int(k) for k in where]
                    der[:, j] = position + np.arange(ni)
                    position += ni
                    scale += [1.0] * ni
                    start += [0.0] * ni
                    low += [-np.inf] * ni
                    high += [np.inf] * ni
            self.der_column.append(der)
            free = np.zeros((ni, len(t.unit.free_parameters)), int)
            for j, index in enumerate(t.unit.free_parameters):
                declaration: Any = t.unit.parameters[index].declaration
                free[:, j] = position + np.arange(ni)
                position += ni
                values = t.table.parameters[:, index]
                scale += [max(abs(float(v)), 1e-3) for v in values]
                start += [float(v) for v in values]
                bound = declaration.min if declaration.min is not None else declaration.above
                low += [-np.inf if bound is None else bound] * ni
                high += [np.inf if declaration.max is None else declaration.max] * ni
            self.free_column.append(free)
            rows = n_rows + np.arange(ni * len(t.unit.initial)).reshape(ni, len(t.unit.initial))
            n_rows += rows.size
            self.initial_row.append(rows)
        self.n_columns, self.n_rows = position, n_rows
        self.scale, self.start = np.array(scale), np.array(start)
        self.low, self.high = np.array(low), np.array(high)
        fixed = np.array(self.fixed, int)
        self.low[fixed] = self.high[fixed] = self.start[fixed]
        self._maps()

    def _maps(self) -> None:
        """Row and column of every local Jacobian entry, per type (entries, instances)."""
        self.rows: list[NDArray[np.int64]] = []
        self.columns: list[NDArray[np.int64]] = []
        self.row_map: list[NDArray[np.int64]] = []
        for t, evaluator, der, free, initial in zip(
            self.linked.types, self.evaluators, self.der_column, self.free_column, self.initial_row, strict=True
        ):
            own = t.table.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
            row_map = np.concatenate([own, t.table.flow_row, initial], axis=1).astype(int)
            column_map = np.concatenate([own, t.table.external, der, free], axis=1).astype(int)
            r, c = evaluator.initial_pattern()
            self.rows.append(row_map[:, r].T)
            self.columns.append(column_map[:, c].T)
            self.row_map.append(row_map.T)
        rows = np.concatenate([r.ravel() for r in self.rows])
        columns = np.concatenate([c.ravel() for c in self.columns])
        self.used = columns >= 0  # derivatives of states that are not fixed are zero, not unknown
        keys = columns[self.used].astype(np.int64) * self.n_rows + rows[self.used]
        unique, self.position = np.unique(keys, return_inverse=True)
        self.pattern = ca.Sparsity(
            self.n_rows,
            self.n_columns,
            [int(v) for v in np.searchsorted(unique // self.n_rows, np.arange(self.n_columns + 1))],
            [int(v) for v in unique % self.n_rows],
        )
        self.entry_row, self.entry_column = unique % self.n_rows, unique // self.n_rows
        self.n_entries = unique.size

    def _arguments(self, x: Array) -> list[tuple[Array, Array, Array, Array, Array, Array]]:
        result = []
        for t, der, free in zip(self.linked.types, self.der_column, self.free_column, strict=True):
            own = t.table.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
            y = x[own].T
            yp = np.where(der.T >= 0, x[np.maximum(der.T, 0)], 0.0)
            p = t.table.parameters.T.copy()
            for j, index in enumerate(t.unit.free_parameters):
                p[index] = x[free[:, j]]
            inputs = t.table.first_input[:, None] + np.arange(len(t.unit.inputs))
            u = self.linked.operating_input[inputs].T if t.unit.inputs else np.zeros((0, len(t.names)))
            result.append((y, yp, x[t.table.external].T, u, t.table.discrete.T, p))
        return result

    def residual(self, x: Array) -> Array:
        result = np.zeros(self.n_rows)
        for evaluator, rows, arguments in zip(self.evaluators, self.row_map, self._arguments(x), strict=True):
            if rows.size:
                np.add.at(result, rows, evaluator.residual(*arguments))
        return result

    def jacobian(self, x: Array) -> Array:
        entries = np.concatenate(
            [e.initial_jacobian(*a).ravel() for e, a in zip(self.evaluators, self._arguments(x), strict=True)]
        )
        result = np.zeros(self.n_entries)
        np.add.at(result, self.position, entries[self.used])
        return result

    def not_finite(self, x: Array) -> list[str]:
        """Rows, flows and initial equations of instances that are no number at x."""
        found = []
        for t, evaluator, arguments in zip(self.linked.types, self.evaluators, self._arguments(x), strict=True):
            texts = [r.text for r in t.unit.rows] + [f"the flow {f.path}" for f in t.unit.flows]
            texts += [f"initial {r.text}" for r in t.unit.initial]
            for row, k in np.argwhere(~np.isfinite(evaluator.residual(*arguments)))[:5]:
                found.append(f"{t.names[k]}: {texts[row]}")
        return found

    def column_name(self, column: int) -> str:
        if column < self.n:
            return self.linked.unknown_name(column)
        for t, der, free in zip(self.linked.types, self.der_column, self.free_column, strict=True):
            for array, names in (
                (der, [f"der({u.path})" for u in t.unit.unknowns]),
                (free, [t.unit.parameters[k].path for k in t.unit.free_parameters]),
            ):
                hit = np.argwhere(array == column)
                if hit.size:
                    return f"{t.names[hit[0][0]]}.{names[hit[0][1]]}"
        return f"unknown {column}"

    def row_text(self, row: int) -> str:
        if row < self.n:
            return self.linked.row_text(row)
        for t, rows in zip(self.linked.types, self.initial_row, strict=True):
            hit = np.argwhere(rows == row)
            if hit.size:
                return f"{t.names[hit[0][0]]}: initial {t.unit.initial[hit[0][1]].text}"
        return f"row {row}"


class _Residual(ca.Callback):
    def __init__(self, problem: _Problem, row_scale: Array) -> None:
        ca.Callback.__init__(self)
        self.problem, self.row_scale = problem, row_scale
        self.construct("g", {"enable_fd": False})

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 1

    # CasADi builds reverse derivatives of the problem for parameter sensitivities that nobody asks for here; they
    # must exist but are never called.
    def has_reverse(self, n: int) -> bool:
        return True

    def get_reverse(self, n: int, name: str, inames: Any, onames: Any, options: Any) -> Any:
        x, p = ca.MX.sym("x", self.problem.n_columns), ca.MX.sym("p", 0)
        g, seed = ca.MX.sym("g", self.problem.n_rows), ca.MX.sym("seed", self.problem.n_rows, n)
        return ca.Function(
            name, [x, p, g, seed], [ca.MX(self.problem.n_columns, n), ca.MX(0, n)], inames, onames, options
        )

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity.dense(self.problem.n_columns if i == 0 else 0, 1)

    def get_sparsity_out(self, i: int) -> Any:
        return ca.Sparsity.dense(self.problem.n_rows, 1)

    def eval(self, arg: Any) -> list[Any]:
        x = np.asarray(arg[0]).ravel() * self.problem.scale
        return [ca.DM(self.problem.residual(x) * self.row_scale)]


class _Jacobian(ca.Callback):
    def __init__(self, problem: _Problem, row_scale: Array) -> None:
        ca.Callback.__init__(self)
        self.problem, self.row_scale = problem, row_scale
        self.construct("jac_g", {"enable_fd": False})

    def get_n_in(self) -> int:
        return 2

    def get_n_out(self) -> int:
        return 2

    def get_sparsity_in(self, i: int) -> Any:
        return ca.Sparsity.dense(self.problem.n_columns if i == 0 else 0, 1)

    def get_sparsity_out(self, i: int) -> Any:
        return ca.Sparsity.dense(self.problem.n_rows, 1) if i == 0 else self.problem.pattern

    def eval(self, arg: Any) -> list[Any]:
        p = self.problem
        x = np.asarray(arg[0]).ravel() * p.scale
        values = p.jacobian(x) * self.row_scale[p.entry_row] * p.scale[p.entry_column]
        return [ca.DM(p.residual(x) * self.row_scale), ca.DM(p.pattern, values)]


def steady_state(linked: Linked, max_iterations: int = 300) -> SteadyState:
    """Solve for the steady state; GF5001 with the worst rows and the bounds that are hit when there is none. With
    sampled controllers it is that of the continuous ones."""
    if linked.twin is not None:
        steady = steady_state(linked.twin, max_iterations)
        return replace(steady, table=held_start(linked, steady.table, steady.free))
    for t in linked.types:
        if t.unit not in _looked_at:
            _refuse_computed_from_free(t)
            _looked_at.add(t.unit)
    problem = _Problem(linked)
    if problem.n_rows != problem.n_columns - len(problem.fixed):
        raise GustformError(
            "GF5002",
            f"the start has {problem.n_rows} equations for {problem.n_columns - len(problem.fixed)} unknowns",
            hint="one initial equation for each free parameter, and one reference angle",
        )
    x0 = problem.start / problem.scale
    entries = np.abs(problem.jacobian(problem.start) * problem.scale[problem.entry_column])
    row_size = np.zeros(problem.n_rows)
    np.maximum.at(row_size, problem.entry_row, np.nan_to_num(entries))
    row_scale = 1.0 / np.where(row_size > 0, row_size, 1.0)

    def slopes(scaled: Array) -> Array:
        dense = np.zeros((problem.n_rows, problem.n_columns))
        values = problem.jacobian(scaled * problem.scale)
        dense[problem.entry_row, problem.entry_column] = (
            values * row_scale[problem.entry_row] * problem.scale[problem.entry_column]
        )
        return dense

    found = newton(
        lambda scaled: problem.residual(scaled * problem.scale) * row_scale,
        slopes,
        x0,
        problem.low / problem.scale,
        problem.high / problem.scale,
    )
    if found is not None:
        solution, iterations, status = found[0] * problem.scale, found[1], ""
    else:
        solution, iterations, status = _by_ipopt(problem, x0, row_scale, max_iterations)
    left = problem.residual(solution) * row_scale
    largest = float(np.max(np.abs(left))) if left.size else 0.0
    if not np.isfinite(largest) or largest > _ACCEPT:
        _report_failure(problem, solution, left, status)
    return _in_place(linked, problem, solution, iterations, largest)


def _by_ipopt(problem: _Problem, x0: Array, row_scale: Array, max_iterations: int) -> tuple[Array, int, str]:
    """What Ipopt comes to from the scaled start x0, with its iterations and how it ended."""
    residual, jacobian = _Residual(problem, row_scale), _Jacobian(problem, row_scale)
    x = ca.MX.sym("x", problem.n_columns)
    sigma_and_multipliers = [
        ca.MX.sym("x", problem.n_columns), ca.MX.sym("p", 0), ca.MX.sym("s"), ca.MX.sym("l", problem.n_rows),
    ]  # fmt: skip
    no_curvature = ca.Function(
        "hess_lag", sigma_and_multipliers, [ca.MX(ca.Sparsity(problem.n_columns, problem.n_columns))],
        ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"],
    )  # fmt: skip
    solver = ca.nlpsol(
        "steady_state",
        "ipopt",
        {"x": x, "f": ca.MX(0), "g": residual(x, ca.MX(0, 1))},
        {
            "print_time": False,
            "show_eval_warnings": False,
            "jac_g": jacobian,
            # The objective is zero and so are the multipliers at a solution: the iteration is Newton's.
            "hess_lag": no_curvature,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "tol": 1e-10,
                "constr_viol_tol": 1e-10,
                "max_iter": max_iterations,
                "bound_relax_factor": 0.0,
                "nlp_scaling_method": "none",
            },
        },
    )
    answer = solver(x0=x0, lbx=problem.low / problem.scale, ubx=problem.high / problem.scale, lbg=0, ubg=0)
    solution = np.asarray(answer["x"]).ravel() * problem.scale
    return solution, int(solver.stats()["iter_count"]), str(solver.stats()["return_status"])


_looked_at: WeakSet[UnitType] = WeakSet()  # types of which no parameter is computed from a free one


def _refuse_computed_from_free(t: LinkedType) -> None:
    """GF5003 if a parameter is computed from a free one: it would keep the value from before the start."""
    component = t.components[0]
    before = component.parameter_values()
    for index in t.unit.free_parameters:
        path = t.unit.parameters[index].path
        step = 1e-6 * max(abs(before[path]), 1.0)
        try:
            after = component.with_value(path, before[path] + step).parameter_values()
        except GustformError:  # beyond its bound
            after = component.with_value(path, before[path] - step).parameter_values()
        dependent = [other for other in before if other != path and after[other] != before[other]]
        if dependent:
            raise GustformError(
                "GF5003",
                f"{t.unit.name}: {dependent[0]} is computed from {path}, which only the start determines",
                hint=f"a variable with an equation instead of the parameter {dependent[0]}",
            )


def _in_place(linked: Linked, problem: _Problem, x: Array, iterations: int, largest: float) -> SteadyState:
    derivative = np.zeros(problem.n)
    free_values: dict[str, float] = {}
    types = []
    for t, der, free in zip(linked.types, problem.der_column, problem.free_column, strict=True):
        own = t.table.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
        if own.size:
            derivative[own] = np.where(der >= 0, x[np.maximum(der, 0)], 0.0)
        parameters = t.table.parameters.copy()
        for j, index in enumerate(t.unit.free_parameters):
            parameters[:, index] = x[free[:, j]]
            free_values.update(
                {
                    f"{name}.{t.unit.parameters[index].path}": float(v)
                    for name, v in zip(t.names, x[free[:, j]], strict=True)
                }
            )
        types.append(replace(t.table, parameters=parameters))
    table = replace(linked.table, types=types, start=x[: problem.n].copy(), start_derivative=derivative)
    return SteadyState(table, iterations, largest, free_values)


def _report_failure(problem: _Problem, x: Array, residual: Array, status: str) -> None:
    worst = np.argsort(-np.abs(np.nan_to_num(residual, nan=np.inf)))[:3]
    rows = "; ".join(f"{problem.row_text(int(k))} is off by {residual[k]:.3g} (scaled)" for k in worst)
    at_bound = [
        problem.column_name(k)
        for k in range(problem.n_columns)
        if problem.low[k] < problem.high[k]
        and (x[k] - problem.low[k] < 1e-6 * problem.scale[k] or problem.high[k] - x[k] < 1e-6 * problem.scale[k])
    ]
    broken = problem.not_finite(x)
    infinite = f" Not a number at all: {'; '.join(broken[:3])}." if broken else ""
    bounds = f" At a bound: {', '.join(at_bound[:5])}." if at_bound else ""
    raise GustformError(
        "GF5001",
        f"no steady state was found (Ipopt: {status}). Worst equations: {rows}.{infinite}{bounds}",
        hint="a feasible operating point (wind, load, curtailment), or better start values",
    )

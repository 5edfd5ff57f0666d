"""Numbers for flattened types: a point that satisfies the rows, and the residuals of the equations as written there.

The equations are elaborated anew and read by path, so nothing of what flattening did to them is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.language.component import Component
from gustform.language.declare import Variable
from gustform.language.operators import constants, table_calls
from gustform.language.scope import Elaborated, elaborate
from gustform_codegen.unit_type import UnitType

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """A value for every declared quantity by path, and for the derivatives ("der(x)")."""

    unit: UnitType
    values: dict[str, float]

    def __getitem__(self, path: str) -> float:
        return self.values[path]


def _symbols(unit: UnitType) -> list[Any]:
    """y, der y, w, u, d, p of a type in one list."""
    symbols = [u.symbol for u in unit.unknowns] + [u.der for u in unit.unknowns if u.der is not None]
    symbols += [x.symbol for x in unit.externals] + [s.symbol for s in unit.inputs]
    return symbols + [s.symbol for s in unit.discretes] + [s.symbol for s in unit.parameters]


def _evaluate(unit: UnitType, component: Component, expressions: list[Any], values: Array) -> Array:
    """Expressions of a type at one point, tables included."""
    symbols = _symbols(unit)
    known = list(values)
    for call in unit.calls:
        arguments = ca.Function("arguments", [ca.vertcat(*symbols)], [call.x, call.y])
        x, y = (np.array([float(a)]) for a in arguments(known))
        reference = unit.tables[call.table]
        value = component.at(reference.owner.path).table(reference.declaration.name).evaluate(x, y)[0]
        symbols, known = [*symbols, call.value], [*known, float(value[0])]
    return np.array(ca.Function("f", [ca.vertcat(*symbols)], [ca.vertcat(*expressions)])(known)).ravel()


def solved_point(unit: UnitType, component: Component, seed: int = 0, given: dict[str, float] | None = None) -> Point:
    """A random point that satisfies the rows: derivatives, iteration variables and, where a row needs it, connector
    potentials are found by Newton steps of least length; states, inputs and discretes are random, or `given`."""
    random = np.random.default_rng(seed)
    n_y, n_der = len(unit.unknowns), unit.n_states
    numbers = component.parameter_values()
    fixed = np.array([numbers[p.path] for p in unit.parameters])
    other = len(unit.externals) + len(unit.inputs) + len(unit.discretes)
    values = np.concatenate([random.uniform(0.5, 2.0, n_y + n_der + other), fixed])
    paths = [u.path for u in unit.unknowns] + [f"der({u.path})" for u in unit.unknowns if u.der is not None]
    paths += [x.path for x in unit.externals] + [s.path for s in (*unit.inputs, *unit.discretes, *unit.parameters)]
    for k, u in enumerate(unit.unknowns):
        declaration: object = u.declared.declaration
        if isinstance(declaration, Variable):  # a declared start leads Newton to the solution that is meant
            values[k] = component.at(u.declared.owner.path).start_value(declaration) or values[k]
    for path, value in (given or {}).items():
        values[paths.index(path)] = value
    rows = [r.expression for r in unit.rows]
    if rows:
        free = np.array([k >= unit.n_states and p not in (given or {}) for k, p in enumerate(paths)])
        free[n_y + n_der + len(unit.externals) :] = False
        for _ in range(60):
            residual = _evaluate(unit, component, rows, values)
            if np.max(np.abs(residual)) < 1e-13:
                break
            where = np.flatnonzero(free)
            jacobian = np.zeros((residual.size, where.size))
            for column, moving in enumerate(where):  # central differences: exact enough for Newton to converge
                for sign in (1, -1):
                    moved = values.copy()
                    moved[moving] += sign * 1e-6
                    jacobian[:, column] += sign * _evaluate(unit, component, rows, moved) / 2e-6
            values[where] -= np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        assert np.max(np.abs(_evaluate(unit, component, rows, values))) < 1e-9, "the rows have no solution"
    found = dict(zip(paths, values.tolist(), strict=True))
    recorded = [r.expression for r in unit.recorded]
    if recorded:
        found.update(zip((r.path for r in unit.recorded), _evaluate(unit, component, recorded, values), strict=True))
    for path, (target, sign) in unit.aliases.items():
        found[path] = sign * found[target]
        if f"der({target})" in found:
            found[f"der({path})"] = sign * found[f"der({target})"]
    flows = _evaluate(unit, component, [f.expression for f in unit.flows], values) if unit.flows else np.zeros(0)
    for flow, value in zip(unit.flows, flows, strict=True):
        assert abs(found[flow.path] - value) < 1e-9, flow.path
    return Point(unit, found)


def equation_residuals(component: Component, point: Point) -> dict[str, float]:
    """lhs - rhs of every equation as written, at a point."""
    e = elaborate(component)
    return {f"{k}: {eq}": _value(e, component, eq.lhs - eq.rhs, point) for k, eq in enumerate(e.equations)}


def _value(e: Elaborated, component: Component, expression: Any, point: Point) -> float:
    values: dict[int, tuple[Any, float]] = {}
    for key, s in e.symbols.items():
        if s.path in point.values:
            values[key] = (s.symbol, point[s.path])
    for key, der in e.derivatives.items():
        values[der.element_hash()] = (der, point[f"der({e.symbols[key].path})"])

    def number(expression: Any) -> float:
        symbols = ca.symvar(expression)
        numbers = []
        for symbol in symbols:
            key = symbol.element_hash()
            if key in constants:
                numbers.append(constants[key].value)
            elif key in table_calls:
                call = table_calls[key]
                data = component.at(call.owner.path).table(call.table.name)
                numbers.append(float(data.evaluate(np.array([number(call.x)]), np.array([number(call.y)]))[0][0]))
            else:
                numbers.append(values[key][1])
        return float(ca.Function("f", [ca.vertcat(*symbols)], [expression])(numbers))

    return number(expression)


def assert_solves(component: Component, point: Point, tolerance: float = 1e-8) -> None:
    """Every equation as written holds. Tolerance: values are of order 1 to 100, rows hold to 1e-13."""
    bad = {text: value for text, value in equation_residuals(component, point).items() if abs(value) > tolerance}
    assert not bad, bad

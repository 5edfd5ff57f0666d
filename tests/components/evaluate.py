"""A component's equations evaluated at one point, by name."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from gustform.language import Component
from gustform_codegen.flatten import flatten
from gustform_codegen.unit_type import UnitType


def evaluate(
    component: Component, given: Mapping[str, float], free: Mapping[str, float] | None = None
) -> dict[str, float]:
    """All flows, algebraic variables and, as "der(x)", derivatives of a component standing alone.

    `given` must name every state, every connector potential and every input; `free` sets free parameters.
    """
    unit = flatten(component)
    assert not unit.calls, "components with tables are evaluated elsewhere"
    symbols = {u.path: u.symbol for u in unit.unknowns} | {x.path: x.symbol for x in unit.externals}
    symbols |= {s.path: s.symbol for s in unit.inputs}
    assert set(given) == set(symbols), f"give {sorted(symbols)}, not {sorted(given)}"
    parameters = component.parameter_values() | dict(free or {})
    values = {symbol: given[path] for path, symbol in symbols.items()}
    values |= {p.symbol: parameters[p.path] for p in unit.parameters}
    values |= {u.der: 0.0 for u in unit.unknowns if u.der is not None}
    wanted = {f.path: f.expression for f in unit.flows} | {r.path: r.expression for r in unit.recorded}
    wanted |= {f"der({path})": expression for path, expression in _derivatives(unit).items()}
    function = ca.Function("values", [ca.vertcat(*values)], [ca.vertcat(*wanted.values())])
    results = np.asarray(function(ca.DM(list(values.values())))).ravel()
    found = dict(zip(wanted, (float(v) for v in results), strict=True))
    for alias, (target, sign) in unit.aliases.items():
        source = found | dict(given)
        if target in source:
            found[alias] = sign * source[target]
    return found


def _derivatives(unit: UnitType) -> dict[str, ca.SX]:
    """f in y' = f, from the residual rows y' - f = 0."""
    found = {}
    for row in unit.rows:
        for u in unit.unknowns:
            if u.der is not None and ca.depends_on(row.expression, u.der):
                found[u.path] = -row.expression / ca.jacobian(row.expression, u.der)
    return found

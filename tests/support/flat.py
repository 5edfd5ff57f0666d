"""The linked system as one flat CasADi problem: the peer that gustform is checked and measured against.

Every instance's rows are written out with its parameters as numbers and its unknowns as elements of one vector, the
way a tool that flattens the whole system does it. Nothing of the linker's index tables is used beyond who is who.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gustform_codegen.link import Linked
from gustform_codegen.table import SystemTable


@dataclass(frozen=True)
class Flat:
    """0 = residual(y, yp, u); `changing` are parameters that scheduled events change, with symbols in order."""

    y: Any
    yp: Any
    u: Any
    changing: Any
    residual: Any
    differential: np.ndarray[Any, Any]
    changing_start: list[float]
    changes: list[tuple[float, int, float]]  # time, position in `changing`, value


def flatten_system(linked: Linked, table: SystemTable) -> Flat:
    """The flat problem of a linked system, with the parameters that `table` holds (after the steady state)."""
    n = table.n_unknowns
    y = ca.SX.sym("y", n)
    yp = ca.SX.sym("yp", n)
    u = ca.SX.sym("u", table.input_value.size)
    residual: list[Any] = [ca.SX(0)] * n
    targets = table.schedule_target.reshape(-1, 3).tolist()
    keys = sorted({tuple(t) for t in targets})
    changing = ca.SX.sym("changing", len(keys))
    for number, (t, arrays) in enumerate(zip(linked.types, table.types, strict=True)):
        unit = t.unit
        assert not unit.calls, "the flat peer has no tables"
        symbols = [x.symbol for x in unit.unknowns]
        symbols += [x.der for x in unit.unknowns if x.der is not None]
        symbols += [x.symbol for x in unit.externals] + [s.symbol for s in unit.inputs]
        symbols += [s.symbol for s in unit.discretes] + [s.symbol for s in unit.parameters]
        expressions = [r.expression for r in unit.rows] + [f.expression for f in unit.flows]
        function = ca.Function("type", [ca.vertcat(*symbols)], [ca.vertcat(*expressions)])
        for k in range(len(t.names)):
            first = int(arrays.first_unknown[k])
            values = [y[first + j] for j in range(len(unit.unknowns))]
            values += [yp[first + j] for j, x in enumerate(unit.unknowns) if x.der is not None]
            values += [y[int(i)] for i in arrays.external[k]]
            values += [u[int(arrays.first_input[k]) + j] for j in range(len(unit.inputs))]
            values += [ca.SX(float(v)) for v in arrays.discrete[k]]
            for j, value in enumerate(arrays.parameters[k]):
                if (number, k, j) in keys:
                    values.append(changing[keys.index((number, k, j))])
                else:
                    values.append(ca.SX(float(value)))
            rows = function(ca.vertcat(*values))
            for j in range(len(unit.rows)):
                residual[first + j] = rows[j]
            for j in range(len(unit.flows)):
                row = int(arrays.flow_row[k, j])
                residual[row] = residual[row] + rows[len(unit.rows) + j]
    order = {key: k for k, key in enumerate(keys)}
    in_order = [0.0] * len(keys)
    for key in keys:
        in_order[order[key]] = float(table.types[key[0]].parameters[key[1], key[2]])
    changes = [
        (float(at), order[tuple(target)], float(value))
        for at, target, value in zip(table.schedule_time, targets, table.schedule_value, strict=True)
    ]
    return Flat(y, yp, u, changing, ca.vertcat(*residual), table.differential.astype(bool), in_order, changes)


@dataclass(frozen=True)
class SemiExplicit:
    """x' = ode(x, z, u, c), 0 = alg(x, z, u, c), with the positions of x and z among the flat unknowns."""

    x: Any
    z: Any
    u: Any
    changing: Any
    ode: Any
    alg: Any
    x_index: np.ndarray[Any, Any]
    z_index: np.ndarray[Any, Any]


def semi_explicit(flat: Flat, nominal: np.ndarray[Any, Any] | None = None) -> SemiExplicit:
    """For solvers that want ODE + algebraic equations; every state's row must read yp - f = 0.

    With `nominal`, x and z are in units of it, for solvers that know one absolute tolerance only.
    """
    scale = np.ones(flat.y.numel()) if nominal is None else nominal
    x_index, z_index = np.flatnonzero(flat.differential), np.flatnonzero(~flat.differential)
    x, z = ca.SX.sym("x", x_index.size), ca.SX.sym("z", z_index.size)
    slope = ca.jacobian(flat.residual, flat.yp)
    assert np.array_equal(np.array(ca.evalf(slope[x_index.tolist(), x_index.tolist()])), np.eye(x_index.size))
    full = ca.SX.zeros(flat.y.numel())
    for k, i in enumerate(x_index):
        full[int(i)] = x[k] * scale[i]
    for k, i in enumerate(z_index):
        full[int(i)] = z[k] * scale[i]
    value = ca.substitute(flat.residual, ca.vertcat(flat.y, flat.yp), ca.vertcat(full, ca.SX.zeros(flat.yp.numel())))
    return SemiExplicit(
        x,
        z,
        flat.u,
        flat.changing,
        -value[x_index.tolist()] / scale[x_index],
        value[z_index.tolist()],
        x_index,
        z_index,
    )

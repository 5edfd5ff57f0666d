"""The whole load-step trajectory against other integrators on the same equations: CasADi's idas and scipy's Radau."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.support.case import Case, open_case
from tests.support.flat import Flat, flatten_system, semi_explicit

_EVERY = 0.1  # s; the nadir is seconds wide, so 0.1 s sees the whole shape
_RTOL = 1e-6
# Design page: another solver on the same DAE agrees to 10 x rtol (of nominal).
_TOLERANCE = 10 * _RTOL


@cache
def _case() -> tuple[Case, Flat]:
    case = open_case("load_step_8ms", f"run.rtol={_RTOL}")
    return case, flatten_system(case.model.built.linked, case.table)


@cache
def _ours() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and all unknowns in units of their nominal, from the runtime."""
    case, _ = _case()
    with case.simulation(rtol=_RTOL) as simulation:
        simulation.initialise(0.0)
        times = np.arange(0.0, case.until + _EVERY / 2, _EVERY)
        rows = []
        for t in times:
            simulation.advance(float(t))
            rows.append(simulation.state()[1].copy())
    return times, np.array(rows) / case.table.nominal


def _pieces(flat: Flat, until: float) -> list[tuple[float, float, list[float]]]:
    """(begin, end, changing parameters) between scheduled changes."""
    edges = [0.0, *sorted({at for at, _, _ in flat.changes}), until]
    values = list(flat.changing_start)
    result = []
    for begin, end in itertools.pairwise(edges):
        for at, index, value in flat.changes:
            if at == begin:
                values[index] = value
        result.append((begin, end, list(values)))
    return result


def _compare(x: NDArray[np.float64], names: NDArray[Any], ours: NDArray[np.float64]) -> None:
    error = np.max(np.abs(x - ours), axis=0)
    worst = int(np.argmax(error))
    assert error[worst] < _TOLERANCE, f"{names[worst]} differs by {error[worst]:.2e} of nominal"


def test_casadi_idas_gives_the_same_trajectory() -> None:
    case, flat = _case()
    times, ours = _ours()
    s = semi_explicit(flat, case.table.nominal)
    problem = {"x": s.x, "z": s.z, "p": ca.vertcat(s.u, s.changing), "ode": s.ode, "alg": s.alg}
    start = case.table.start / case.table.nominal
    x, z = start[s.x_index], start[s.z_index]
    rows = [x]
    for begin, end, changing in _pieces(flat, case.until):
        grid = times[(times > begin + 1e-9) & (times < end + 1e-9)]
        options = {"reltol": 1e-9, "abstol": 1e-9, "max_num_steps": 1_000_000}
        solver = ca.integrator("peer", "idas", problem, begin, grid.tolist(), options)
        answer = solver(x0=x, z0=z, p=[*case.table.input_value, *changing])
        trajectory, z = np.asarray(answer["xf"]), np.asarray(answer["zf"])[:, -1]
        rows += list(trajectory.T)
        x = trajectory[:, -1]
    names = np.array([case.model.built.linked.unknown_name(int(i)) for i in s.x_index])
    _compare(np.array(rows), names, ours[:, s.x_index])


def test_scipy_radau_gives_the_same_trajectory() -> None:
    """Radau wants an ODE: the two algebraic unknowns are solved for inside by Newton's method."""
    case, flat = _case()
    times, ours = _ours()
    s = semi_explicit(flat, case.table.nominal)
    p = ca.vertcat(s.u, s.changing)
    newton = ca.rootfinder("z", "newton", {"x": s.z, "p": ca.vertcat(s.x, p), "g": s.alg}, {"abstol": 1e-13})
    right = ca.Function("ode", [s.x, s.z, p], [s.ode])
    inverse = ca.inv(ca.jacobian(s.alg, s.z))
    jacobian = ca.Function(
        "jacobian",
        [s.x, s.z, p],
        [ca.jacobian(s.ode, s.x) - ca.jacobian(s.ode, s.z) @ inverse @ ca.jacobian(s.alg, s.x)],
    )
    start = case.table.start / case.table.nominal
    x, z = start[s.x_index], start[s.z_index]
    rows = [x]
    for begin, end, changing in _pieces(flat, case.until):
        parameters = [*case.table.input_value, *changing]
        guess = [z]

        def algebraic(x: Any, parameters: list[float] = parameters, guess: list[Any] = guess) -> Any:
            guess[0] = np.asarray(newton(guess[0], ca.vertcat(x, parameters))).ravel()
            return guess[0]

        def ode(_t: float, x: Any, parameters: list[float] = parameters, solve: Any = algebraic) -> Any:
            return np.asarray(right(x, solve(x), parameters)).ravel()

        def slope(_t: float, x: Any, parameters: list[float] = parameters, solve: Any = algebraic) -> Any:
            return np.asarray(jacobian(x, solve(x), parameters))

        grid = times[(times > begin + 1e-9) & (times < end + 1e-9)]
        answer = solve_ivp(ode, (begin, end), x, method="Radau", t_eval=grid, jac=slope, rtol=1e-8, atol=1e-9)
        assert answer.success, answer.message
        rows += list(answer.y.T)
        x, z = answer.y[:, -1], guess[0]
    names = np.array([case.model.built.linked.unknown_name(int(i)) for i in s.x_index])
    _compare(np.array(rows), names, ours[:, s.x_index])

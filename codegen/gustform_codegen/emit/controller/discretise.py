"""From dx/dt = f(x, u) to the step of a sampled controller.

A state x becomes one word of memory m. With h the period, in each step

    tustin   x - h/2 f(x, u) = m,      m+ = x + h/2 f(x, u)
    euler    x - h f(x, u)   = m,      m+ = x                      backward Euler
    zoh      x = m,                    m+ = x + h phi(h A) f(x, u),      phi(z) = (e^z - 1)/z,  A = df/dx

then y = g(x, u): the outputs are those of the same sample, without a delay. `tustin` is the transfer function at
s = 2/h (z - 1)/(z + 1) exactly, with one word per state. The states are solved group by group (the strongly connected
ones together, in the order of their dependence), each group linear in its states: a fixed, explicit formula.

Where a group oscillates (damping below 0.7 at the parameters of the export) h/2 is replaced by tan(w h/2)/w, w its
natural frequency: pre-warped, exact at w.

An integral with a clamp, dI/dt = limit(r, (a - I)/T, (b - I)/T), is the continuous form of I staying within [a, b];
T_release has no part in the sampled one, which is exact:

    I = limit(I_r, a, b),      m+ = limit(I + h/2 r, a, b)

I_r: the step of dI/dt = r. The integral is within its limits, also when they move, after each step, and comes off in
the very sample in which r changes its sign. All other limiters are part of g or of u, and evaluated as they are; a
limiter in the rate of a state that is no such clamp is refused (GF4102).

A rate that looks up a table bends with its state. Its step is the one above for the rate's tangent at m,

    d = h/2 f(m)/(1 - h/2 f'(m)),      x = m + d,      m+ = x + d                  (tustin)

one look-up of the value and one of the slope, of second order, and exact where f is linear. A slope above zero counts
as zero, so that the divisor is never less than one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import casadi as ca
import numpy as np

from gustform.language.errors import GustformError
from gustform.language.operators import limit
from gustform_codegen.emit.controller.block import Block
from gustform_codegen.emit.controller.look_up import Evaluations, expanded, slope_of
from gustform_codegen.emit.controller.signals import Signal
from gustform_codegen.symbolic import Substitution, key_of, keys_in, solve_for, solve_linear
from gustform_codegen.unit_type import Call

_DAMPED = 0.7  # a group with a smaller damping ratio is pre-warped
_HALVINGS, _DEGREE = 6, 12  # phi(z): Taylor of z/64, then doubled
_MOST = 32.0  # |h df/dx| of a single state; e^-32 is no more than round-off, and phi(z) = -1/z beyond


class Method(StrEnum):
    """How the dynamic part is discretised."""

    tustin = "tustin"
    euler = "euler"
    zoh = "zoh"


@dataclass(frozen=True, eq=False)
class Step:
    """memory+ and outputs as SX in the memory, the inputs and the parameters of a block, and in what is looked up.

    `calls` are made in this order; the arguments of each are in the same symbols and the values of those before it.
    """

    block: Block
    method: Method
    period: float
    memory: list[Any]
    memory_next: list[Any]
    results: list[Any]
    parameters: list[Signal]  # those that the step depends on
    prewarped: dict[str, float]  # states of a pre-warped group and its frequency, rad/s
    calls: list[Call]


@dataclass(frozen=True, eq=False)
class Clamp:
    """An integral stays within [lower, upper]."""

    lower: Any
    upper: Any


def discretise(block: Block, period: float, method: Method = Method.tustin) -> Step:
    """The step of a block. GF4102 if the rate of a state is neither linear in the states nor a clamped integral."""
    if not (math.isfinite(period) and period > 0.0):
        raise GustformError("GF2070", f"the sample period must be greater than 0 s; got {period:g}", hint="1e-3")
    symbols = [s.symbol for s in block.states]
    rates, clamps = [], []
    for signal, rate in zip(block.states, block.rates, strict=True):
        free, clamp = unclamped(rate, signal.symbol)
        rates.append(free)
        clamps.append(clamp)
    memory = [ca.SX.sym(f"m_{s.name}") for s in block.states]
    known = Substitution()
    following: list[Any] = [None] * len(memory)
    prewarped: dict[str, float] = {}
    look_ups = Evaluations(block.calls)
    for group in groups(symbols, rates, clamps, block.calls):
        x = [symbols[k] for k in group]
        if any(
            key_of(c.value) in keys_in(e) for k in group for e in expanded(rates[k], block.calls) for c in block.calls
        ):
            _by_tangent(block, group, clamps, look_ups, known, memory, following, period, method)
            continue
        f = known.apply([rates[k] for k in group])
        jacobian = ca.jacobian(ca.vertcat(*f), ca.vertcat(*x))
        if ca.depends_on(jacobian, ca.vertcat(*x)):
            names = ", ".join(block.states[k].name for k in group)
            raise GustformError(
                "GF4102",
                f"{block.name} cannot be exported as a sampled controller: the rate of {names} bends with the state",
                hint="limit(rate, (lower - x)/T, (upper - x)/T) for an integral within limits",
            )
        half: float = period / 2.0
        if method is Method.tustin:
            frequency = _resonance(block, jacobian)
            if frequency is not None and 0.0 < frequency * period < math.pi:
                half = math.tan(frequency * period / 2.0) / frequency
                prewarped |= {block.states[k].name: frequency for k in group}
        elif method is Method.euler:
            half = period
        m = [memory[k] for k in group]
        change = [ca.SX(0)] * len(m) if method is Method.zoh else _increments(x, f, m, half)
        solved = [_kept(a + d, clamps[k], known) for k, a, d in zip(group, m, change, strict=True)]
        at = Substitution()
        for symbol, value in zip(x, solved, strict=True):
            at.add(symbol, value)
        f_now = at.apply(f)
        if method is Method.tustin:
            free = all(clamps[k] is None for k in group)  # then h/2 f(x) is x - m
            ahead = [v + (d if free else half * r) for v, d, r in zip(solved, change, f_now, strict=True)]
        elif method is Method.euler:
            ahead = list(solved)
        else:
            moved = period * _phi(period * jacobian) @ ca.vertcat(*f_now)
            ahead = [v + moved[i] for i, v in enumerate(solved)]
        for k, value in zip(group, ahead, strict=True):
            following[k] = _kept(value, clamps[k], known)
        for symbol, value in zip(x, solved, strict=True):
            known.add(symbol, value)
    results = look_ups.place(block.results, known)
    calls = _called(look_ups.made, [*following, *results])
    used = {key for e in [*following, *results, *(a for c in calls for a in (c.x, c.y))] for key in keys_in(e)}
    parameters = [p for p in block.parameters if key_of(p.symbol) in used]
    return Step(block, method, period, memory, following, results, parameters, prewarped, calls)


def _called(calls: list[Call], expressions: list[Any]) -> list[Call]:
    """The look-ups that are needed for expressions."""
    used = {key for e in expressions for part in expanded(e, calls) for key in keys_in(part)}
    return [c for c in calls if not used.isdisjoint(key_of(s) for s in (c.value, c.x_slope, c.y_slope))]


def _by_tangent(
    block: Block,
    group: list[int],
    clamps: list[Clamp | None],
    look_ups: Evaluations,
    known: Substitution,
    memory: list[Any],
    following: list[Any],
    period: float,
    method: Method,
) -> None:
    """The step of a state whose rate looks up a table. GF4102 if it is not alone, or clamped."""
    if len(group) > 1 or clamps[group[0]] is not None:
        names = ", ".join(block.states[k].name for k in group)
        raise GustformError(
            "GF4102",
            f"{block.name} cannot be exported as a sampled controller: {names} look up a table together or within "
            "limits",
            hint="a look-up in a rate that depends on one state",
        )
    k = group[0]
    x, m, rate = block.states[k].symbol, memory[k], block.rates[k]
    at_m = known.and_also(x, m)
    f, slope = look_ups.place([rate, slope_of(rate, x, block.calls)], at_m)
    slope = ca.fmin(slope, ca.SX(0))
    if method is Method.zoh:
        solved, following[k] = m, m + period * _phi(period * slope)[0, 0] * f
    else:
        step = period / 2.0 if method is Method.tustin else period
        d = step * f / (1.0 - step * slope)
        solved = m + d
        following[k] = solved + d if method is Method.tustin else solved
    known.add(x, solved)


def groups(symbols: list[Any], rates: list[Any], clamps: list[Any], calls: list[Call]) -> list[list[int]]:
    """States that depend on each other, group by group, each after those it depends on."""
    n = len(symbols)
    reach = np.eye(n, dtype=bool)
    for i in range(n):
        bounds = [] if clamps[i] is None else [clamps[i].lower, clamps[i].upper]
        parts = [part for e in (rates[i], *bounds) for part in expanded(e, calls)]
        expression = ca.vertcat(*parts)
        for j in range(n):
            reach[i, j] |= bool(ca.depends_on(expression, symbols[j]))
    for k in range(n):
        reach |= reach[:, [k]] & reach[[k], :]
    order = sorted(range(n), key=lambda i: (int(reach[i].sum()), i))
    result: list[list[int]] = []
    for i in order:
        for group in result:
            if reach[i, group[0]] and reach[group[0], i]:
                group.append(i)
                break
        else:
            result.append([i])
    return result


def _kept(value: Any, clamp: Clamp | None, known: Substitution) -> Any:
    return value if clamp is None else limit(value, *known.apply([clamp.lower, clamp.upper]))


def unclamped(rate: Any, x: Any) -> tuple[Any, Clamp | None]:
    """r and [a, b] of rate = limit(r, (a - x)/T, (b - x)/T); the rate itself and no clamp for anything else."""
    if rate.is_op(ca.OP_FMIN) and rate.dep(0).is_op(ca.OP_FMAX):
        inner, upper = rate.dep(0), _zero(rate.dep(1), x)
        lower = _zero(inner.dep(1), x)
        if lower is not None and upper is not None:
            return inner.dep(0), Clamp(lower, upper)
    return rate, None


def _zero(expression: Any, x: Any) -> Any | None:
    """Where a bound of a rate is zero, without round-off: a of (a - x)/T."""
    while expression.is_op(ca.OP_NEG):
        expression = expression.dep(0)
    if not expression.is_op(ca.OP_DIV) or ca.depends_on(expression.dep(1), x):
        return None
    numerator = expression.dep(0)
    slope = ca.jacobian(numerator, x)
    if slope.is_zero() or not slope.is_constant():
        return None
    zero = solve_for(numerator, x)
    return None if ca.depends_on(zero, x) else zero


def _increments(x: list[Any], f: list[Any], m: list[Any], step: float) -> list[Any]:
    """d of d - step f(m + d) = 0, linear in d. Near a steady state d is small, and with it the round-off."""
    if len(x) == 1:
        slope = ca.jacobian(f[0], x[0])
        return [(step / (1.0 - step * slope)) * ca.substitute(f[0], x[0], m[0])]
    d = [ca.SX.sym(f"d_{symbol}") for symbol in x]
    moved = ca.substitute(f, x, [a + b for a, b in zip(m, d, strict=True)])
    solved = solve_linear([a - step * r for a, r in zip(d, moved, strict=True)], d)
    if solved is None:
        raise GustformError("GF4102", f"the states {x} have no step of their own", hint="another sample period")
    return solved


def _resonance(block: Block, jacobian: Any) -> float | None:
    """Natural frequency, rad/s, of a poorly damped pair of eigenvalues at the block's parameters and starts."""
    if jacobian.shape[0] < 2:
        return None
    known = [*block.parameters, *block.inputs]
    symbols = [s.symbol for s in known]
    free = [s for s in ca.symvar(jacobian) if not any(ca.is_equal(s, k) for k in symbols)]
    if free:
        return None
    value = ca.Function("a", [ca.vertcat(*symbols)], [ca.densify(jacobian)])(ca.DM([s.value for s in known]))
    for eigenvalue in np.linalg.eigvals(np.asarray(value)):
        if eigenvalue.imag > 0.0 and -eigenvalue.real < _DAMPED * abs(eigenvalue):
            return float(abs(eigenvalue))
    return None


def _phi(z: Any) -> Any:
    """(e^z - 1)/z of a square matrix, by scaling and doubling: phi(2 z) = (e^z + 1) phi(z)/2."""
    n = z.shape[0]
    one = ca.SX.eye(n)
    z = ca.densify(z)
    beyond = ca.SX(1)
    if n == 1 and not z.is_zero():
        beyond = _MOST / ca.fmax(-z, _MOST)
        z = ca.fmax(z, -_MOST)
    z = z / 2.0**_HALVINGS
    phi = ca.SX(one)
    for k in range(_DEGREE, 1, -1):
        phi = one + z @ phi / k
    for _ in range(_HALVINGS):
        phi = (one + one + z @ phi) @ phi / 2.0
        z = 2.0 * z
    return ca.densify(beyond * phi)

"""Frequency response of the discrete controller beside the continuous one.

Both are linearised at one point: inputs and states at their start values, integrals with limits at a quarter between
them, so that no limiter acts; tables by their tangent planes. G(jw) = C (jw - A)^-1 B + D of the equations,
G_d(e^jwh) of the step; the error is |G_d - G| over the largest |G| of the same pair. Frequencies: eight per decade from
0.1 Hz to 0.4 of the sampling frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform_codegen.emit.controller.discretise import Step, unclamped
from gustform_codegen.emit.controller.look_up import Grid, spline_at
from gustform_codegen.symbolic import Substitution, key_of, keys_in
from gustform_codegen.unit_type import Call

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

_QUARTER = 0.25  # of the way from the lower to the upper limit of an integral
_PER_DECADE = 8


@dataclass(frozen=True)
class Pair:
    """One path from an input to an output: both responses at each frequency, Hz."""

    input: str
    output: str
    frequency: Array
    continuous: Complex
    discrete: Complex

    def error(self, up_to: float) -> float:
        """Largest difference up to a frequency, as a share of the largest gain of the continuous one."""
        some = self.frequency <= up_to
        return float(np.max(np.abs(self.discrete - self.continuous)[some]) / np.max(np.abs(self.continuous)))


def frequency_response(step: Step) -> list[Pair]:
    """All pairs of an input and an output between which there is a path."""
    block = step.block
    x = ca.vertcat(*[s.symbol for s in block.states])
    u = ca.vertcat(*[s.symbol for s in block.inputs])
    p = ca.vertcat(*[s.symbol for s in block.parameters])
    m = ca.vertcat(*step.memory)
    numbers = {key_of(s.symbol): s.value for s in [*block.inputs, *block.parameters, *block.states]}
    rates = []
    for s, rate in zip(block.states, block.rates, strict=True):
        free, clamp = unclamped(rate, s.symbol)
        rates.append(free)
        if clamp is not None:
            low, high = (_number(e, numbers) for e in (clamp.lower, clamp.upper))
            numbers[key_of(s.symbol)] = low + _QUARTER * (high - low)
    at_x = ca.DM([numbers[key_of(s.symbol)] for s in block.states])
    at_u = ca.DM([s.value for s in block.inputs])
    at_p = ca.DM([s.value for s in block.parameters])

    def at_point(expressions: list[Any], calls: list[Call], state: Any) -> list[Any]:
        return _tangent(expressions, calls, block.tables, ca.vertcat(state, u, p), ca.vertcat(at_x, at_u, at_p))

    n = len(rates)
    smooth = at_point([*rates, *block.results], block.calls, x)
    continuous = _state_space(smooth[:n], smooth[n:], x, u, p, at_x, at_u, at_p)
    # An integral off its limits, and m = x: by half a step of f beside the point, where all is linear.
    smooth = at_point([*step.memory_next, *step.results], step.calls, m)
    discrete = _state_space(smooth[:n], smooth[n:], m, u, p, at_x, at_u, at_p)
    top = math.log10(0.4 / step.period)
    frequency = np.logspace(-1.0, top, max(2, math.ceil(_PER_DECADE * (top + 1.0)) + 1))
    jw: Complex = 2j * np.pi * frequency
    G = _response(continuous, jw)
    G_d = _response(discrete, np.exp(jw * step.period))
    pairs = []
    for i, output in enumerate(block.outputs):
        for j, source in enumerate(block.inputs):
            if np.any(G[:, i, j] != 0.0):
                pairs.append(Pair(source.name, output.name, frequency, G[:, i, j], G_d[:, i, j]))
    return pairs


def _tangent(expressions: list[Any], calls: list[Call], tables: list[Grid], symbols: Any, at: Any) -> list[Any]:
    """Expressions with each look-up replaced by its tangent plane at a point; slopes count as constants."""
    known = Substitution()
    for call in calls:
        x, y = known.apply([call.x, call.y])
        x_0, y_0 = (float(v) for v in ca.Function("place", [symbols], [x, y])(at))
        value, x_slope, y_slope = (
            spline_at(tables[call.table], x_0, y_0, *slopes)
            for slopes in ((False, False), (True, False), (False, True))
        )
        known.add(call.value, value + x_slope * (x - x_0) + y_slope * (y - y_0))
        known.add(call.x_slope, ca.SX(x_slope))
        known.add(call.y_slope, ca.SX(y_slope))
    return known.apply(expressions)


def _number(expression: Any, numbers: dict[int, float]) -> float:
    symbols = ca.symvar(expression)
    values = ca.DM([numbers[key] for key in keys_in(expression)])
    return float(ca.Function("value", [ca.vertcat(*symbols)], [expression])(values)) if symbols else float(expression)


def _state_space(
    ahead: list[Any], results: list[Any], x: Any, u: Any, p: Any, at_x: Any, at_u: Any, at_p: Any
) -> tuple[Array, Array, Array, Array]:
    f, g = ca.vertcat(*ahead), ca.vertcat(*results)
    matrices = [ca.densify(ca.jacobian(e, v)) for e in (f, g) for v in (x, u)]
    A, B, C, D = (np.asarray(v) for v in ca.Function("abcd", [x, u, p], matrices)(at_x, at_u, at_p))
    return A, B, C, D


def _response(system: tuple[Array, Array, Array, Array], z: Complex) -> Complex:
    A, B, C, D = system
    one = np.eye(len(A))
    return np.array([C @ np.linalg.solve(v * one - A, B) + D for v in z])


def as_text(step: Step, pairs: list[Pair]) -> str:
    """A table of the largest errors, below a twentieth and a fifth of the sampling frequency."""
    low, high = 0.05 / step.period, 0.2 / step.period
    lines = [
        f"{step.block.name}, {step.method.value} at {step.period:g} s: largest |G_d - G| as a share of the largest |G|",
        "",
        f"{'from':<12}{'to':<12}{f'to {low:.4g} Hz':>14}{f'to {high:.4g} Hz':>14}",
    ]
    lines += [f"{q.input:<12}{q.output:<12}{q.error(low):>14.2e}{q.error(high):>14.2e}" for q in pairs]
    return "\n".join(lines) + "\n"


def as_csv(pairs: list[Pair]) -> str:
    """Each pair and frequency: gains and phases of both."""
    lines = ["input,output,frequency_hz,gain,phase_deg,gain_discrete,phase_discrete_deg"]
    for q in pairs:
        for f, G, G_d in zip(q.frequency, q.continuous, q.discrete, strict=True):
            values = (f, abs(G), np.degrees(np.angle(G)), abs(G_d), np.degrees(np.angle(G_d)))
            lines.append(",".join([q.input, q.output, *(f"{v:.9g}" for v in values)]))
    return "\n".join(lines) + "\n"

"""Look-ups in tables: where a block makes them, how they are evaluated, how they are printed.

A table is a C2 bicubic spline on a uniform grid, as `language.table` makes it; outside of the grid its edge counts, and
the error signal says so. `spline_at` does the operations of the printed C in its order.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gustform.language.declare import Table
from gustform_codegen.symbolic import Substitution, key_of, keys_in
from gustform_codegen.unit_type import Call

_SIXTH = 1.0 / 6.0
_PER_LINE = 6
_DIGITS, _TINY = 11, 1e-300


@dataclass(frozen=True, eq=False)
class Grid:
    """A table of an exported controller: its name in C and the numbers of its spline."""

    name: str
    declared: Table
    spline: dict[str, Any]

    @cached_property
    def coefficient(self) -> list[float]:
        """The coefficients, to a digit that no solver of linear equations decides: 1e-11 of the largest."""
        values = self.spline["coefficient"]
        digits = _DIGITS - math.ceil(math.log10(max(float(np.max(np.abs(values))), _TINY)))
        return [float(v) + 0.0 for v in np.round(values, digits)]

    @property
    def x_scale(self) -> float:
        """Steps for a unit of x."""
        return float(1.0 / self.spline["x_step"])

    @property
    def y_scale(self) -> float:
        """Steps for a unit of y."""
        return float(1.0 / self.spline["y_step"])

    @property
    def x_end(self) -> float:
        """The last x."""
        return float(self.spline["x_start"] + (self.spline["n_x"] - 1) * self.spline["x_step"])

    @property
    def y_end(self) -> float:
        """The last y."""
        return float(self.spline["y_start"] + (self.spline["n_y"] - 1) * self.spline["y_step"])


def expanded(expression: Any, calls: list[Call]) -> list[Any]:
    """An expression and the arguments of the look-ups in it, and of those in them."""
    found, result = {key_of(c.value): c for c in calls}, [expression]
    pending, seen = [expression], set()
    while pending:
        for key in keys_in(pending.pop()):
            if key in found and key not in seen:
                seen.add(key)
                pending += [found[key].x, found[key].y]
                result += [found[key].x, found[key].y]
    return result


def slope_of(expression: Any, x: Any, calls: list[Call]) -> Any:
    """The derivative by a symbol, through the look-ups: in symbols for their values and slopes."""
    slopes: list[tuple[Call, Any]] = []

    def total(e: Any) -> Any:
        result = ca.jacobian(e, x)
        for call, inner in slopes:
            if ca.depends_on(e, call.value):
                result += ca.jacobian(e, call.value) * inner
        return result

    for call in calls:  # in an order in which they can be evaluated
        inner = ca.SX(0)
        for argument, slope in ((call.x, call.x_slope), (call.y, call.y_slope)):
            of_argument = total(argument)
            if not of_argument.is_zero():
                inner += slope * of_argument
        slopes.append((call, inner))
    return total(expression)


class Evaluations:
    """The look-ups of a step, one for each place in time at which their arguments are known."""

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls
        self.made: list[Call] = []

    def place(self, expressions: list[Any], known: Substitution) -> list[Any]:
        """Expressions in terms of what is known, their look-ups replaced by evaluations there."""
        wanted = {key for e in expressions for part in expanded(e, self._calls) for key in keys_in(part)}
        swap = Substitution()
        for call in self._calls:
            symbols = (call.value, call.x_slope, call.y_slope)
            if wanted.isdisjoint(key_of(s) for s in symbols):
                continue
            x, y = swap.apply(known.apply([call.x, call.y]))
            fresh = [ca.SX.sym(f"look_up_{len(self.made)}{suffix}") for suffix in ("", "_dx", "_dy")]
            self.made.append(Call(fresh[0], fresh[1], fresh[2], call.table, x, y))
            for symbol, new in zip(symbols, fresh, strict=True):
                swap.add(symbol, new)
        return swap.apply(known.apply(expressions))


# ---- evaluation -----------------------------------------------------------------------------------------------------
def spline_at(grid: Grid, x: float, y: float, x_slope: bool, y_slope: bool) -> float:
    """Value of the spline, or one of its derivatives."""
    s = grid.spline
    i, wx = _weights(x, s["x_start"], grid.x_scale, s["n_x"], x_slope)
    j, wy = _weights(y, s["y_start"], grid.y_scale, s["n_y"], y_slope)
    width, coefficient = s["n_y"] + 2, grid.coefficient
    total = 0.0
    for a in range(4):
        row = 0.0
        for b in range(4):
            row += wy[b] * coefficient[(i + a) * width + j + b]
        total += wx[a] * row
    return total


def _weights(x: float, start: float, scale: float, n: int, slope: bool) -> tuple[int, list[float]]:
    s, inside = (x - start) * scale, scale
    if not s >= 0.0:
        s, inside = 0.0, 0.0
    elif s > n - 1:
        s, inside = float(n - 1), 0.0
    i = min(int(s), n - 2)
    a = s - i
    b = 1.0 - a
    if slope:
        half = 0.5 * inside
        return i, [
            -(half * (b * b)),
            inside * (a * (1.5 * a - 2.0)),
            inside * (b * (2.0 - 1.5 * b)),
            half * (a * a),
        ]
    return i, [
        _SIXTH * (b * b * b),
        _SIXTH * (4.0 + a * a * (3.0 * a - 6.0)),
        _SIXTH * (4.0 + b * b * (3.0 * b - 6.0)),
        _SIXTH * (a * a * a),
    ]


# ---- C --------------------------------------------------------------------------------------------------------------
FUNCTIONS = """
/* A table on a uniform grid: a C2 bicubic spline, whose coefficients stand in rows of n_y + 2. */
typedef struct grid {
    real x_start;
    real x_scale; /* steps for a unit */
    real y_start;
    real y_scale;
    int32_t n_x;
    int32_t n_y;
} grid;

/* Weights of four coefficients, or their derivatives; returns which is the first. */
static int32_t weights(real x, real start, real scale, int32_t n, bool slope, real w[4], uint32_t *errors)
{
    const int32_t steps = n - 1;
    const real last = (real)steps;
    real s = (x - start) * scale;
    real inside = scale;
    real a = R(0.0);
    real b = R(0.0);
    int32_t i = 0;

    if (!(s >= R(-0.001)) || (s > (last + R(0.001)))) { /* round-off at the edge is no error */
        *errors |= @UPPER@_TABLE_RANGE;
    }
    if (!(s >= R(0.0))) {
        s = R(0.0);
        inside = R(0.0);
    } else if (s > last) {
        s = last;
        inside = R(0.0);
    } else {
        /* on the grid */
    }
    i = (int32_t)s;
    if (i == steps) {
        i = steps - 1;
    }
    a = s - (real)i;
    b = R(1.0) - a;
    if (slope) {
        const real half = R(0.5) * inside;
        w[0] = -(half * (b * b));
        w[1] = inside * (a * ((R(1.5) * a) - R(2.0)));
        w[2] = inside * (b * (R(2.0) - (R(1.5) * b)));
        w[3] = half * (a * a);
    } else {
        const real sixth = R(0.16666666666666666);
        w[0] = sixth * ((b * b) * b);
        w[1] = sixth * (R(4.0) + ((a * a) * ((R(3.0) * a) - R(6.0))));
        w[2] = sixth * (R(4.0) + ((b * b) * ((R(3.0) * b) - R(6.0))));
        w[3] = sixth * ((a * a) * a);
    }
    return i;
}

/* The value of a table, or one of its derivatives. */
static real look_up(const real coefficient[], const grid *g, real x, real y, bool x_slope, bool y_slope,
                    uint32_t *errors)
{
    real wx[4] = { 0 };
    real wy[4] = { 0 };
    const int32_t i = weights(x, g->x_start, g->x_scale, g->n_x, x_slope, wx, errors);
    const int32_t j = weights(y, g->y_start, g->y_scale, g->n_y, y_slope, wy, errors);
    const int32_t width = g->n_y + 2;
    real total = R(0.0);
    int32_t a = 0;
    int32_t b = 0;

    for (a = 0; a < 4; a++) {
        real row = R(0.0);
        for (b = 0; b < 4; b++) {
            row += wy[b] * coefficient[((i + a) * width) + j + b];
        }
        total += wx[a] * row;
    }
    return total;
}
"""
"""@UPPER@ stands for the prefix of macros."""


def printed(grids: list[Grid], literal: Callable[[float], str], upper: str) -> str:
    """C of the tables and of the functions that look them up; `literal` prints a number."""
    if not grids:
        return ""
    text = FUNCTIONS.replace("@UPPER@", upper)
    for g in grids:
        s = g.spline
        rows, columns = s["n_x"] + 2, s["n_y"] + 2
        numbers = [literal(v) for v in g.coefficient]
        lines = [
            "    " + ", ".join(numbers[k : min(k + _PER_LINE, row + columns)]) + ","
            for row in range(0, rows * columns, columns)
            for k in range(row, row + columns, _PER_LINE)
        ]
        d = g.declared
        text += f"""
/* {d.description}: {d.unit}
 * over the first from {s["x_start"]:g} to {g.x_end:g}, and the second from {s["y_start"]:g} to {g.y_end:g}. */
static const grid {g.name}_grid = {{
    {literal(s["x_start"])}, {literal(g.x_scale)}, {literal(s["y_start"])}, {literal(g.y_scale)}, {s["n_x"]}, {s["n_y"]}
}};

static const real {g.name}[{rows * columns}] = {{
{chr(10).join(lines)}
}};
"""
    return text

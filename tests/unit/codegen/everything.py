"""A component that uses every operation, for comparing compiled kernels with CasADi."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from gustform.interfaces import DcPort
from gustform.language import (
    Component,
    Discrete,
    Input,
    Output,
    Parameter,
    Table,
    Variable,
    dead_band,
    limit,
    maximum,
    minimum,
    table2,
)
from gustform.language.table import TableData

# One state each; x, y > 0 are other states, p, q parameters, u an input, w a wired signal, d a discrete value.
OPERATIONS: dict[str, Callable[[Any], Any]] = {
    "sum": lambda c: c.x + c.y - c.p + 1.5,
    "product": lambda c: c.x * c.y * c.p * c.q,
    "quotient": lambda c: c.x / c.y + c.x / c.p + c.p / c.x + c.p / c.q + 1 / c.y + 1 / c.p,
    "negative": lambda c: -c.x - (-c.p) * -3.0,
    "twice_and_square": lambda c: 2 * c.x + c.y**2 + c.p**2 + 2 * c.p,
    "sin": lambda c: ca.sin(c.x) * ca.sin(c.p),
    "cos": lambda c: ca.cos(c.x * c.y),
    "tan": lambda c: ca.tan(0.3 * c.x),
    "asin": lambda c: ca.asin(0.1 * c.x),
    "acos": lambda c: ca.acos(0.1 * c.y),
    "atan": lambda c: ca.atan(c.x - c.y),
    "atan2": lambda c: ca.atan2(c.x, c.y) + ca.atan2(c.p, c.x),
    "hypot": lambda c: ca.hypot(c.x, c.y),
    "sinh": lambda c: ca.sinh(c.x),
    "cosh": lambda c: ca.cosh(c.y),
    "tanh": lambda c: ca.tanh(c.x),
    "asinh": lambda c: ca.asinh(c.x),
    "acosh": lambda c: ca.acosh(1.5 + c.x),
    "atanh": lambda c: ca.atanh(0.1 * c.x),
    "exp": lambda c: ca.exp(-c.x) * ca.exp(c.p),
    "expm1": lambda c: ca.expm1(0.1 * c.x),
    "log": lambda c: ca.log(c.x) + ca.log(c.p),
    "log1p": lambda c: ca.log1p(c.y),
    "sqrt": lambda c: ca.sqrt(c.x + c.y**2),
    "erf": lambda c: ca.erf(c.x - 1),
    "pow": lambda c: c.x**c.y,
    "pow_parameter": lambda c: c.x**c.p + c.p**c.x,
    "pow_constant": lambda c: c.x**1.7 + c.y**3 + c.x**-2.5 + c.p**0.3,
    "min": lambda c: minimum(c.x, c.y) + minimum(c.x, c.p) + minimum(c.p, c.q),
    "max": lambda c: maximum(c.x, c.y) + maximum(c.q, c.x),
    "abs": lambda c: ca.fabs(c.x - c.y) + ca.fabs(c.p),
    "limit": lambda c: limit(3 * (c.x - c.y), -c.p, c.q),
    "dead_band": lambda c: dead_band(c.x - c.y, 0.1),
    "signals": lambda c: c.u * c.x + c.w * c.y + c.d * c.u - c.d2,
    "potential": lambda c: c.pin.v * c.x + c.pin.v**2,
    "iterated": lambda c: c.z * c.x,
    "table": lambda c: table2(c.cp, c.x, c.y),
    "table_of_parameters": lambda c: table2(c.cp, c.p, c.q),
    "table_of_table": lambda c: table2(c.cp, 2 * table2(c.ct, c.x, c.pin.v), c.y * table2(c.cp, c.y, c.z)),
    "table_outside": lambda c: table2(c.ct, 100 * c.x, c.y),
    "reused": lambda c: ca.sin(c.x) * ca.exp(c.y) + ca.sin(c.x),
    "large_and_small": lambda c: 1e30 * c.x * 1e-30 + 1e-7 * c.y + 123456789.0 * 1e-9 * c.x,
}
_GRID = np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 3.5, 4.0])
CP = TableData(_GRID, _GRID, np.sin(_GRID)[:, None] * np.cos(0.5 * _GRID)[None, :], name="cp")
CT = TableData(
    np.linspace(-1, 4, 12), np.linspace(0, 3, 5), np.exp(-0.1 * np.add.outer(np.arange(12.0), np.arange(5.0))), "ct"
)


class Everything(Component):
    T = Parameter("s", "time constant", default=0.7)
    p = Parameter("1", "a parameter", default=1.3)
    q = Parameter("1", "another", default=0.6)
    G = Parameter("S", "conductance", default=2.5)
    C = Parameter("F", "capacitance", default=0.2)
    one_volt = Parameter("V", "base", default=1.0)
    x = Variable("1", "a state", start=1.1)
    y = Variable("1", "another", start=0.8)
    z = Variable("1", "iterated on", start=0.5)
    shown = Output("1", "explicit")
    u = Input("1", "an input")
    w = Input("1", "a wired signal")
    d = Discrete("1", "discrete", start=0.4)
    d2 = Discrete("1", "discrete", start=-0.3)
    cp = Table("1", "1", "1", "a table")
    ct = Table("1", "1", "1", "another")
    pin = DcPort("terminal")

    def equations(self) -> None:
        view = _View(self)
        self.eq(self.T * self.der(self.x), self.u - self.x)
        self.eq(self.T * self.der(self.y) + self.y * self.T * self.der(self.x), self.x)
        self.eq(ca.exp(self.z) + self.z * self.x, self.p + 2)
        self.eq(self.shown, ca.sin(self.x) + self.z)
        for name, operation in OPERATIONS.items():
            self.eq(self.T * self.der(getattr(self, f"s_{name}")), operation(view))
        self.eq(self.pin.i, self.G * (self.pin.v - self.x * self.one_volt) + self.C * self.one_volt * self.der(self.x))
        self.when(
            ca.logic_and(self.x > self.p, self.shown < self.q),
            {self.d: self.d2 + ca.floor(10 * self.x) + ca.sign(self.y), self.d2: self.d},
            reinit={self.x: self.x / 2, self.y: table2(self.cp, self.x, self.z)},
        )
        self.when(self.z > 1, {self.d: ca.if_else(self.x > self.y, self.x, -self.y) + ca.fmod(self.x, 0.3)})
        self.when(
            ca.logic_or(self.u > 0, ca.logic_not(self.x > 2)), {self.d2: ca.ceil(self.u) + ca.copysign(self.x, self.u)}
        )
        self.sample(self.T, {self.d: self.d + 1})


class _View:
    """What the operations read: numbers without a unit, the potential among them."""

    def __init__(self, component: Everything) -> None:
        self.component = component
        self.pin = self
        self.v = component.pin.v / component.one_volt

    def __getattr__(self, name: str) -> Any:
        return getattr(self.component, name)


Complete: type[Component] = type(
    "Complete", (Everything,), {f"s_{name}": Variable("1", f"state of {name}") for name in OPERATIONS}
)


def everything() -> Component:
    return Complete(cp=CP, ct=CT)

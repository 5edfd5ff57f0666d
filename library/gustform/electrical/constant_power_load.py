"""Load that takes constant power."""

from __future__ import annotations

from gustform.conventions import active_power, magnitude, reactive_power
from gustform.interfaces import AcPort
from gustform.language import Component, Parameter, Variable, maximum


class ConstantPowerLoad(Component):
    """Constant active and reactive power, as long as the voltage is not too low.

        i = conj(S / v)                     for |v| >= V_min V_n
        i = conj(S) v / (V_min V_n)^2       below: the constant impedance that takes S at V_min V_n

    Both are i = conj(S) v / max(|v|^2, (V_min V_n)^2). Power and current are continuous, their slopes bend: an
    impedance that takes S at the threshold has no freedom left for the slope. P and Q fall with |v|^2 below it, so that
    the network keeps a solution in a deep voltage dip. At and above V_min nothing changes. P, Q > 0 into the load.
    SI units.

    Source: Kundur, Power System Stability and Control, 1994, 7.1 (static load models, low-voltage fallback).
    """

    voltage = Parameter("V", "nominal line-to-line RMS voltage V_n", default=33e3, above=0.0)
    active = Parameter("W", "active power of one load", default=100e6)
    reactive = Parameter("var", "reactive power of one load, > 0 inductive", default=0.0)
    aggregate = Parameter("1", "number of identical loads", default=1.0, min=1.0)
    V_min = Parameter("pu", "voltage below which the load is a constant impedance, base V_n", default=0.7, above=0.0)

    terminal = AcPort(
        "terminals of the load",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    P = Variable("W", "active power taken", start=lambda self: self.active, nominal=1e6)
    Q = Variable("var", "reactive power taken", start=lambda self: self.reactive, nominal=1e6)
    V = Variable("pu", "voltage magnitude, base V_n", start=1.0)

    def equations(self) -> None:
        v = self.terminal
        threshold = self.V_min * self.voltage
        square = maximum(v.vr * v.vr + v.vi * v.vi, threshold * threshold)
        P, Q = self.aggregate * self.active, self.aggregate * self.reactive
        self.eq(v.ir, (P * v.vr + Q * v.vi) / square)
        self.eq(v.ii, (P * v.vi - Q * v.vr) / square)
        self.eq(self.P, active_power(v))
        self.eq(self.Q, reactive_power(v))
        self.eq(self.V, magnitude(v.vr, v.vi) / self.voltage)

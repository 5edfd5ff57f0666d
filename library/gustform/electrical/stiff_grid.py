"""A strong network as a voltage source behind an impedance."""

from __future__ import annotations

from gustform.conventions import NOMINAL_FREQUENCY, active_power, reactive_power
from gustform.interfaces import AcPort
from gustform.language import Component, Output, Parameter, Variable


class StiffGrid(Component):
    """Network equivalent: a voltage source of constant magnitude, angle 0 and constant frequency behind r + jx.

        E V_n - v = (r + jx) Z_b i        i out of the grid,  Z_b = V_n^2 / S_n
        omega = speed

    Take its omega as the phasor frame: its source stands at angle 0 of that frame. P, Q are what it delivers. r, x in
    pu of S_n at V_n; with r + jx of magnitude 1, S_n is the short-circuit power.
    Source: Kundur, Power System Stability and Control, 1994, 12.3 (infinite bus).
    """

    voltage = Parameter("V", "nominal line-to-line RMS voltage V_n", default=33e3, above=0.0)
    rating = Parameter("VA", "base S_n of r and x", default=1e9, above=0.0)
    r = Parameter("pu", "series resistance, base S_n", default=0.1, min=0.0)
    x = Parameter("pu", "series reactance, base S_n", default=1.0, above=0.0)
    E = Parameter("pu", "voltage of the source, base V_n", default=1.0, above=0.0)
    speed = Parameter("pu", "frequency of the source, base f0", default=1.0, above=0.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)

    terminal = AcPort(
        "terminals of the network",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    omega = Output("pu", "speed of the frame, base f0", start=1.0)
    frequency = Variable("Hz", "frequency", start=NOMINAL_FREQUENCY, nominal=NOMINAL_FREQUENCY)
    P = Variable("W", "active power delivered", nominal=1e6)
    Q = Variable("var", "reactive power delivered", nominal=1e6)

    def equations(self) -> None:
        v = self.terminal
        Z_b = self.voltage * self.voltage / self.rating
        R, X = self.r * Z_b, self.x * Z_b
        self.eq(self.E * self.voltage - v.vr, X * v.ii - R * v.ir)
        self.eq(0 - v.vi, -X * v.ir - R * v.ii)
        self.eq(self.omega, self.speed)
        self.eq(self.frequency, self.f0 * self.omega)
        self.eq(self.P, -active_power(v))
        self.eq(self.Q, -reactive_power(v))

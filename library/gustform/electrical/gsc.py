"""Grid-side converter, averaged."""

from __future__ import annotations

import casadi as ca

from gustform.conventions import NOMINAL_FREQUENCY, TWO_PI
from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, Input, Parameter, Variable


class GridSideConverter(Component):
    """Averaged, lossless converter that imposes a voltage behind its filter.

        d(theta)/dt = w0 (omega - frame)          w0 = 2 pi f0
        e = V V_b e^{j theta}
        e - v = (r + jx) Z_b i                    i out of the converter,  Z_b = V_b^2 / S_b
        P + jQ = e conj(i)                        measured at the converter, before the filter
        v_dc i_dc = P

    Base: rating, nominal voltage. The filter's capacitor is left out at phasor fidelity. Ports in V and A.
    Source: Lyu, Subotic, Gross 2022, II-B, eqs. (3), (7); filter .01 + j.1 pu: Table I and project notes.
    """

    rating = Parameter("VA", "base S_b of r and x", default=5e6, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage V_b", default=3.3e3, above=0.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    r = Parameter("pu", "resistance of the filter", default=0.01, min=0.0)
    x = Parameter("pu", "reactance of the filter at nominal frequency", default=0.1, above=0.0)

    V = Input("pu", "magnitude of the voltage, base V_b", start=1.0)
    omega = Input("pu", "frequency of the voltage, base f0", start=1.0)
    frame = Input("pu", "speed of the phasor frame, base f0", start=1.0)
    grid = AcPort(
        "grid side of the filter",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    dc = DcPort("DC link", start={"v": 7920.0}, nominal={"v": 7920.0})
    theta = Variable("rad", "angle of the voltage against the phasor frame", start=0.1)
    P = Variable("W", "active power out of the converter", start=1e6, nominal=1e6)
    Q = Variable("var", "reactive power out of the converter", nominal=1e6)

    def equations(self) -> None:
        v = self.grid
        Z_b = self.voltage * self.voltage / self.rating
        R, X = self.r * Z_b, self.x * Z_b
        E = self.voltage * self.V
        e_r, e_i = E * ca.cos(self.theta), E * ca.sin(self.theta)
        self.eq(self.der(self.theta), TWO_PI * self.f0 * (self.omega - self.frame))
        self.eq(e_r - v.vr, X * v.ii - R * v.ir)
        self.eq(e_i - v.vi, -X * v.ir - R * v.ii)
        self.eq(self.P, -(e_r * v.ir + e_i * v.ii))
        self.eq(self.Q, e_r * v.ii - e_i * v.ir)
        self.eq(self.dc.i, self.P / self.dc.v)

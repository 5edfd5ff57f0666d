"""What every grid-side converter has: its angle, the voltage it sees, its power balance."""

from __future__ import annotations

from typing import Any

import casadi as ca

from gustform.conventions import NOMINAL_FREQUENCY, TWO_PI
from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, Input, Parameter, Variable


class GridSide(Component):
    """Base of averaged, lossless grid-side converters with a filter towards the grid.

        d(theta)/dt = w0 (omega - frame)          w0 = 2 pi f0
        v_d + j v_q = v/V_b e^{-j theta}          at the grid side of the filter
        v_dc i_dc = P                             P + jQ out of the converter, before the filter

    The control gives the frequency `omega` of the converter's own frame, and what to impose in it. Base: rating,
    nominal voltage. Ports in V and A. Source: Lyu, Subotic, Gross 2022, II-B, eq. (3).
    """

    lossless = Parameter("1", "whether the filter's resistance is left out", default=False, structural=True)
    rating = Parameter("VA", "base S_b of r and x", default=5e6, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage V_b", default=3.3e3, above=0.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    r = Parameter("pu", "resistance of the filter", default=0.01, min=0.0)
    x = Parameter("pu", "reactance of the filter at nominal frequency", default=0.1, above=0.0)

    omega = Input("pu", "frequency of the converter's frame, base f0", start=1.0)
    frame = Input("pu", "speed of the phasor frame, base f0", start=1.0)
    grid = AcPort(
        "grid side of the filter",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    dc = DcPort("DC link", start={"v": 7920.0}, nominal={"v": 7920.0})
    theta = Variable("rad", "angle of the converter's frame against the phasor frame", start=0.1)
    v_d = Variable("pu", "voltage at the grid side of the filter along the converter's frame", start=1.0)
    v_q = Variable("pu", "voltage at the grid side of the filter across the converter's frame")
    P = Variable("W", "active power out of the converter", start=1e6, nominal=1e6)
    Q = Variable("var", "reactive power out of the converter", nominal=1e6)

    @property
    def resistance(self) -> Any:
        """The filter's resistance that counts, pu."""
        return 0.0 if self.lossless else self.r

    def equations(self) -> None:
        self.eq(self.der(self.theta), TWO_PI * self.f0 * (self.omega - self.frame))
        self.eq(self.dc.i, self.P / self.dc.v)
        self.port_equations()

    def port_equations(self) -> None:
        """Between the phasors of the port and the converter's own frame."""
        v = self.grid
        c, s = ca.cos(self.theta), ca.sin(self.theta)
        self.eq(self.v_d, (v.vr * c + v.vi * s) / self.voltage)
        self.eq(self.v_q, (v.vi * c - v.vr * s) / self.voltage)

"""Proportional-integral limiter that acts only above a maximum."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable, maximum


class PiLimiter(Component):
    """PI controller whose integral and whose output stay at or above zero.

        e = x - x_max
        d(I)/dt = max(k_i e, -I/T_release)        keeps the integral I >= 0 without an event, and is continuous
        u = max(k_p e + I, 0)

    T_release is far below k_p/k_i, so the clamp acts only while the output is zero already. I starts at zero and keeps
    that value in a steady state. x in pu, u in deg (pitch demand).
    Source: Lyu, Subotic, Gross 2022, IV-E, Fig. 7; clamp: tests/reference/README.md.
    """

    x_max = Parameter("pu", "value above which the limiter acts", default=1.0)
    k_p = Parameter("deg", "proportional gain, deg/pu", default=1.0, min=0.0)
    k_i = Parameter("deg/s", "integral gain, deg/pu/s", default=2.0, min=0.0)
    T_release = Parameter("s", "time constant with which the integral falls back", default=0.05, above=0.0)

    x = Input("pu", "quantity to limit")
    u = Output("deg", "pitch demand of the limiter", nominal=10.0)
    integral = Variable("deg", "integral part I", nominal=10.0, fixed=True)

    def equations(self) -> None:
        e = self.x - self.x_max
        self.eq(self.der(self.integral), maximum(self.k_i * e, -self.integral / self.T_release))
        self.eq(self.u, maximum(self.k_p * e + self.integral, 0))

"""Proportional-integral limiter that acts only above a maximum."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable, limit


class PiLimiter(Component):
    """PI controller whose integral and whose output stay between zero and u_max.

        e = x - x_max
        d(I)/dt = limit(k_i e, -I/T_release, (u_max - I)/T_release)
        u = limit(k_p e + I, 0, u_max)

    so 0 <= I <= u_max without an event, and continuous. T_release is far below k_p/k_i, so the clamp acts only while
    the output is at its limit already. I keeps its start value, zero unless given, in a steady state. x in pu, u in deg
    (pitch demand).
    Source: Lyu, Subotic, Gross 2022, IV-E, Fig. 7; clamp: tests/reference/README.md.
    """

    x_max = Parameter("pu", "value above which the limiter acts", default=1.0)
    k_p = Parameter("deg", "proportional gain, deg/pu", default=1.0, min=0.0)
    k_i = Parameter("deg/s", "integral gain, deg/pu/s", default=2.0, min=0.0)
    u_max = Parameter("deg", "largest demand", default=90.0, above=0.0)
    T_release = Parameter("s", "time constant with which the integral falls back", default=0.05, above=0.0)

    x = Input("pu", "quantity to limit")
    u = Output("deg", "pitch demand of the limiter", nominal=10.0)
    integral = Variable("deg", "integral part I", nominal=10.0, fixed=True)

    def equations(self) -> None:
        e, I, T = self.x - self.x_max, self.integral, self.T_release  # noqa: E741
        self.eq(self.der(I), limit(self.k_i * e, -I / T, (self.u_max - I) / T))
        self.eq(self.u, limit(self.k_p * e + I, 0, self.u_max))

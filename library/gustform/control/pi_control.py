"""Proportional-integral controller with limits and without windup."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable, limit


class PiControl(Component):
    """PI controller within limits that may move.

        u = limit(k_p e + I, lower, upper)
        d(I)/dt = limit(k_i e, (lower - I)/T_release, (upper - I)/T_release)

    The integral stays within the limits, without an event: so with I at a limit, u comes off it in the moment in which
    e changes its sign. T_release is far below k_p/k_i. All in pu; time in s.
    Source: Astrom, Hagglund, Advanced PID Control, 2006, 3.5 (integral clamping).
    """

    k_p = Parameter("pu", "proportional gain", default=4.0, min=0.0)
    k_i = Parameter("1/s", "integral gain, pu/pu/s", default=20.0, above=0.0)
    T_release = Parameter(
        "s", "time constant with which the integral comes back into the limits", default=0.01, above=0.0
    )

    e = Input("pu", "control error")
    lower = Input("pu", "lower limit")
    upper = Input("pu", "upper limit", start=1.0)
    u = Output("pu", "controller output", start=0.5)
    integral = Variable("pu", "integral part I", start=0.5)

    def equations(self) -> None:
        I, T = self.integral, self.T_release  # noqa: E741
        self.eq(self.der(I), limit(self.k_i * self.e, (self.lower - I) / T, (self.upper - I) / T))
        self.eq(self.u, limit(self.k_p * self.e + I, self.lower, self.upper))

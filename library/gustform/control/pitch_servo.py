"""Pitch servo."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable, limit


class PitchServo(Component):
    """First-order pitch actuator with a rate limit.

        rate = d(beta)/dt = limit((beta_ref - beta)/T, -rate_max, rate_max)

    deg, s. Source: Lyu, Subotic, Gross 2022, IV-E, Fig. 7; values: project notes.
    """

    T = Parameter("s", "time constant", default=0.3, above=0.0)
    rate_max = Parameter("deg/s", "largest pitch rate", default=8.0, above=0.0)

    beta_ref = Input("deg", "pitch demand", nominal=10.0)
    beta = Output("deg", "pitch angle", nominal=10.0)
    rate = Variable("deg/s", "pitch rate", nominal=1.0)

    def equations(self) -> None:
        self.eq(self.rate, limit((self.beta_ref - self.beta) / self.T, -self.rate_max, self.rate_max))
        self.eq(self.der(self.beta), self.rate)

"""A frame of constant speed, for systems without a machine that could give one."""

from __future__ import annotations

from gustform.conventions import NOMINAL_FREQUENCY
from gustform.language import Component, Output, Parameter, Variable


class StiffFrame(Component):
    """Gives the phasor frame a constant speed.

        omega = speed,      frequency = f0 omega

    For systems that hold 1 pu by themselves. In a system whose frequency moves, take a machine's speed instead:
    otherwise all angles turn for ever. Base of omega: f0.
    """

    speed = Parameter("pu", "speed of the frame, base f0", default=1.0, above=0.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)

    omega = Output("pu", "speed of the frame, base f0", start=1.0)
    frequency = Variable("Hz", "frequency of the frame", start=NOMINAL_FREQUENCY, nominal=NOMINAL_FREQUENCY)

    def equations(self) -> None:
        self.eq(self.omega, self.speed)
        self.eq(self.frequency, self.f0 * self.omega)

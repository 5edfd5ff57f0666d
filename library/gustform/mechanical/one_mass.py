"""Drive train as one rotating mass."""

from __future__ import annotations

from gustform.interfaces import Shaft
from gustform.language import Component, Parameter, Variable


class OneMass(Component):
    """Rotor, hub, shaft and generator as one stiff mass.

        J d(omega)/dt = tau         tau = sum of the torques INTO the mass at its shaft

    SI units: rad/s, N m. Everything that turns with it is connected to the one shaft.
    Source: Lyu, Subotic, Gross 2022, eq. (2b), divided by omega.
    """

    J = Parameter("kg*m^2", "moment of inertia of everything that turns", default=35.328e6, above=0.0)

    shaft = Shaft("the mass", start={"w": 1.3})
    w = Variable("1/s", "speed, rad/s", start=1.3, min=0.0)

    def equations(self) -> None:
        self.eq(self.w, self.shaft.w)
        self.eq(self.J * self.der(self.w), self.shaft.tau)

"""What every drive train has: a shaft towards the rotor, one towards the generator."""

from __future__ import annotations

from gustform.interfaces import Shaft
from gustform.language import Component, Parameter, Variable


class DriveTrain(Component):
    """Base of drive trains without gears. SI units; torques at the ports are INTO the drive train.

    J is the moment of inertia of everything that turns; w the speed of the generator's rotor, which is what the control
    measures.
    """

    J = Parameter("kg*m^2", "moment of inertia of everything that turns", default=35.328e6, above=0.0)

    rotor = Shaft("towards the rotor", start={"w": 1.3})
    generator = Shaft("towards the generator", start={"w": 1.3})
    w = Variable("1/s", "speed of the generator's rotor, rad/s", start=1.3, min=0.0)

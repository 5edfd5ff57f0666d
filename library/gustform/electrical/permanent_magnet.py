"""What every model of the permanent-magnet synchronous generator has: data, shaft, terminals."""

from __future__ import annotations

from gustform.interfaces import AcPort, Shaft
from gustform.language import Component, Parameter, Variable


class PermanentMagnetMachine(Component):
    """Base of models of the PMSG without saliency.

        omega = omega_shaft / omega_base,      E = psi omega,  X = L omega

    pu: base rating, voltage, omega_base (mechanical speed); X at speed omega is L omega. P is delivered at the
    terminals, which stand in V and A. Source: stator reactance 0.4 pu at 1.2 pu speed, 100 pole pairs: project notes.
    """

    rating = Parameter("VA", "base of power", default=5e6, above=0.0)
    voltage = Parameter("V", "line-to-line RMS voltage that is 1 pu (EMF at nominal speed)", default=3.3e3, above=0.0)
    omega_base = Parameter("1/s", "mechanical speed that is 1 pu, rad/s", default=1.1417, above=0.0)
    pole_pairs = Parameter("1", "pole pairs p", default=100.0, min=1.0)
    psi = Parameter("pu", "EMF at 1 pu speed", default=1.0 / 1.2, above=0.0)
    L = Parameter("pu", "stator reactance at 1 pu speed", default=0.4 / 1.2, above=0.0)

    shaft = Shaft("rotor of the machine", start={"w": lambda self: self.omega_base})
    terminal = AcPort(
        "stator terminals",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    omega = Variable("pu", "speed, base omega_base", start=1.2)
    P = Variable("W", "active power delivered", start=1e6, nominal=1e6)

    def equations(self) -> None:
        v = self.terminal
        self.eq(self.omega, self.shaft.w / self.omega_base)
        self.eq(self.P, -(v.vr * v.ir + v.vi * v.ii))

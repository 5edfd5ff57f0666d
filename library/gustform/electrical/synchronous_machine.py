"""What every model of a synchronous machine shares: swing, angle, terminals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gustform.conventions import NOMINAL_FREQUENCY, TWO_PI
from gustform.electrical.dq import DqPort
from gustform.language import Component, Input, Output, Parameter, Variable


@dataclass(frozen=True)
class MachineRest:
    """A machine at rest at nominal frequency: angle in rad, the rest in pu."""

    delta: float
    i_d: float
    i_q: float
    P_m: float
    E_fd: float


class SynchronousMachine(Component):
    """Base of synchronous machines: the swing equation and the terminals in the rotor's d-q frame.

        2 H omega d(omega)/dt = P_m - T_e - D (omega - 1)      d(delta)/dt = w0 (omega - frame)

    A machine derived from it adds its stator (v_d, v_q and the air-gap power T_e from i_d, i_q) and its windings.
    Currents i_d, i_q are out of the machine (the port's flows are into it), pu of the rating. The swing equation is in
    its power form, which belongs to a stator without speed voltages: T_e is then the air-gap power. Base of powers: the
    rating; of omega: w0 = 2 pi f0; time in s.

    delta is the angle of the q axis against the phasor frame and keeps its start value in a steady state: the machine
    is the system's reference angle.
    """

    excited: ClassVar[bool] = True  # whether E_fd has an effect while the model runs

    lossless = Parameter("1", "whether the stator resistance is left out", default=False, structural=True)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    H = Parameter("s", "inertia constant, base the rating", default=6.0, above=0.0)
    D = Parameter("pu", "damping: power per pu of speed off nominal", default=0.0, min=0.0)
    ra = Parameter("pu", "stator resistance", default=0.003, min=0.0)

    P_m = Input("pu", "mechanical power, base the rating", start=0.4)
    E_fd = Input("pu", "field voltage; 1 gives rated voltage at no load", start=1.3)
    frame = Input("pu", "speed of the phasor frame, base w0", start=1.0)
    stator = DqPort("stator terminals")

    omega = Output("pu", "rotor speed, base w0", start=1.0, min=0.5, max=1.5)
    delta = Output("rad", "angle of the q axis against the phasor frame", start=0.6, fixed=True)
    i_d = Variable("pu", "stator current out of the machine, d axis", start=0.25)
    i_q = Variable("pu", "stator current out of the machine, q axis", start=0.32)
    T_e = Variable("pu", "air-gap power", start=0.4)
    V_t = Output("pu", "terminal voltage", start=1.0)

    @property
    def resistance(self) -> float:
        """The stator resistance that counts, pu."""
        return 0.0 if self.lossless else self.ra

    def rest(self, power: complex, voltage: complex) -> MachineRest:
        """The machine at rest, delivering `power` at the terminal phasor `voltage` (pu)."""
        raise NotImplementedError(f"{type(self).__name__} must say how it stands at rest")

    def equations(self) -> None:
        v = self.stator
        self.eq(v.id, -self.i_d)
        self.eq(v.iq, -self.i_q)
        power = self.P_m - self.T_e - self.D * (self.omega - 1.0)
        self.eq(2.0 * self.H * self.der(self.omega), power / self.omega)
        self.eq(self.der(self.delta), TWO_PI * self.f0 * (self.omega - self.frame))
        self.eq(self.V_t, (v.vd * v.vd + v.vq * v.vq) ** 0.5)

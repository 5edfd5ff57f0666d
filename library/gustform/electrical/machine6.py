"""Synchronous machine of sixth order."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

from gustform.conventions import NOMINAL_FREQUENCY, TWO_PI
from gustform.electrical.dq import DqPort
from gustform.language import Component, Input, Output, Parameter, Variable


@dataclass(frozen=True)
class MachineRest:
    """A machine at rest at nominal frequency: angle in rad, the rest in pu."""

    delta: float
    E1q: float
    E1d: float
    psi_1d: float
    psi_2q: float
    psi_d: float
    psi_q: float
    i_d: float
    i_q: float
    P_m: float
    E_fd: float


class Machine6(Component):
    """Synchronous machine with field and damper on d and two dampers on q.

    States: delta, omega, E'q, E'd, psi_1d, psi_2q.

    Currents i_d, i_q out of the machine (generator convention inside; the port's flows are into it), pu of the rating:

        2 H omega d(omega)/dt = P_m - T_e            d(delta)/dt = w0 (omega - frame)
        T_e   = psi_d i_q - psi_q i_d
        v_d   = -r_a i_d - psi_q                     v_q   = -r_a i_q + psi_d
        psi_d = -xd'' i_d + (xd''-xl)/(xd'-xl) E'q + (xd'-xd'')/(xd'-xl) psi_1d
        psi_q = -xq'' i_q - (xq''-xl)/(xq'-xl) E'd + (xq'-xq'')/(xq'-xl) psi_2q
        T'd0 dE'q/dt = -E'q - (xd-xd')(i_d - (xd'-xd'')/(xd'-xl)^2 (psi_1d + (xd'-xl) i_d - E'q)) + E_fd
        T'q0 dE'd/dt = -E'd + (xq-xq')(i_q - (xq'-xq'')/(xq'-xl)^2 (psi_2q + (xq'-xl) i_q + E'd))
        T''d0 dpsi_1d/dt = -psi_1d + E'q - (xd'-xl) i_d
        T''q0 dpsi_2q/dt = -psi_2q - E'd - (xq'-xl) i_q

    The swing equation is in its power form, which belongs to a stator without speed voltages: T_e is then the air-gap
    power. Base of powers: the rating; of omega: w0 = 2 pi f0; time in s. No saturation.

    delta is the angle of the q axis against the phasor frame and keeps its start value in a steady state: the machine
    is the system's reference angle.

    Source: Sauer and Pai, Power System Dynamics and Stability, 1998, chapter 3; data: project notes, set A.
    """

    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    H = Parameter("s", "inertia constant, base the rating", default=6.0, above=0.0)
    xd = Parameter("pu", "synchronous reactance, d axis", default=1.81, above=0.0)
    xq = Parameter("pu", "synchronous reactance, q axis", default=1.76, above=0.0)
    xd1 = Parameter("pu", "transient reactance xd'", default=0.30, above=0.0)
    xq1 = Parameter("pu", "transient reactance xq'", default=0.65, above=0.0)
    xd2 = Parameter("pu", "subtransient reactance xd''", default=0.23, above=0.0)
    xq2 = Parameter("pu", "subtransient reactance xq''", default=0.25, above=0.0)
    xl = Parameter("pu", "leakage reactance", default=0.15, min=0.0)
    ra = Parameter("pu", "stator resistance", default=0.003, min=0.0)
    Td0_1 = Parameter("s", "open-circuit transient time constant T'd0", default=8.0, above=0.0)
    Tq0_1 = Parameter("s", "open-circuit transient time constant T'q0", default=1.0, above=0.0)
    Td0_2 = Parameter("s", "open-circuit subtransient time constant T''d0", default=0.03, above=0.0)
    Tq0_2 = Parameter("s", "open-circuit subtransient time constant T''q0", default=0.07, above=0.0)

    P_m = Input("pu", "mechanical power, base the rating", start=0.4)
    E_fd = Input("pu", "field voltage; 1 gives rated voltage at no load", start=1.3)
    frame = Input("pu", "speed of the phasor frame, base w0", start=1.0)
    stator = DqPort("stator terminals")

    omega = Output("pu", "rotor speed, base w0", start=1.0, min=0.5, max=1.5)
    delta = Output("rad", "angle of the q axis against the phasor frame", start=0.6, fixed=True)
    E1q = Variable("pu", "E'q, transient voltage of the field winding", start=0.92)
    E1d = Variable("pu", "E'd, transient voltage of the q-axis damper", start=0.34)
    psi_1d = Variable("pu", "flux linkage of the d-axis damper", start=0.88)
    psi_2q = Variable("pu", "flux linkage of the second q-axis damper", start=-0.5)
    psi_d = Variable("pu", "stator flux linkage, d axis", start=0.89)
    psi_q = Variable("pu", "stator flux linkage, q axis", start=-0.47)
    i_d = Variable("pu", "stator current out of the machine, d axis", start=0.25)
    i_q = Variable("pu", "stator current out of the machine, q axis", start=0.32)
    T_e = Variable("pu", "air-gap power", start=0.4)
    V_t = Output("pu", "terminal voltage", start=1.0)

    def rest(self, power: complex, voltage: complex) -> MachineRest:
        """The machine at rest, delivering `power` at the terminal phasor `voltage` (pu)."""
        v, i = voltage, (power / voltage).conjugate()
        delta = cmath.phase(v + complex(self.ra, self.xq) * i)
        turn = cmath.exp(-1j * (delta - cmath.pi / 2))  # network to d + jq
        v_d, v_q, i_d, i_q = (v * turn).real, (v * turn).imag, (i * turn).real, (i * turn).imag
        psi_d, psi_q = v_q + self.ra * i_q, -(v_d + self.ra * i_d)
        E1q, E1d = psi_d + self.xd1 * i_d, (self.xq - self.xq1) * i_q
        return MachineRest(
            delta=delta,
            E1q=E1q,
            E1d=E1d,
            psi_1d=E1q - (self.xd1 - self.xl) * i_d,
            psi_2q=-E1d - (self.xq1 - self.xl) * i_q,
            psi_d=psi_d,
            psi_q=psi_q,
            i_d=i_d,
            i_q=i_q,
            P_m=psi_d * i_q - psi_q * i_d,
            E_fd=E1q + (self.xd - self.xd1) * i_d,
        )

    def equations(self) -> None:
        xd1, xq1, xd2, xq2, xl = self.xd1, self.xq1, self.xd2, self.xq2, self.xl
        E1q, E1d, psi_1d, psi_2q = self.E1q, self.E1d, self.psi_1d, self.psi_2q
        i_d, i_q, v = self.i_d, self.i_q, self.stator
        self.eq(v.id, -i_d)
        self.eq(v.iq, -i_q)
        # swing
        self.eq(2.0 * self.H * self.der(self.omega), (self.P_m - self.T_e) / self.omega)
        self.eq(self.der(self.delta), TWO_PI * self.f0 * (self.omega - self.frame))
        self.eq(self.T_e, self.psi_d * i_q - self.psi_q * i_d)
        # stator
        self.eq(v.vd, -self.ra * i_d - self.psi_q)
        self.eq(v.vq, -self.ra * i_q + self.psi_d)
        self.eq(self.psi_d, -xd2 * i_d + (xd2 - xl) / (xd1 - xl) * E1q + (xd1 - xd2) / (xd1 - xl) * psi_1d)
        self.eq(self.psi_q, -xq2 * i_q - (xq2 - xl) / (xq1 - xl) * E1d + (xq1 - xq2) / (xq1 - xl) * psi_2q)
        # rotor windings
        k_d = (xd1 - xd2) / ((xd1 - xl) * (xd1 - xl))
        k_q = (xq1 - xq2) / ((xq1 - xl) * (xq1 - xl))
        damper_d = k_d * (psi_1d + (xd1 - xl) * i_d - E1q)
        damper_q = k_q * (psi_2q + (xq1 - xl) * i_q + E1d)
        self.eq(self.Td0_1 * self.der(E1q), -E1q - (self.xd - xd1) * (i_d - damper_d) + self.E_fd)
        self.eq(self.Tq0_1 * self.der(E1d), -E1d + (self.xq - xq1) * (i_q - damper_q))
        self.eq(self.Td0_2 * self.der(psi_1d), -psi_1d + E1q - (xd1 - xl) * i_d)
        self.eq(self.Tq0_2 * self.der(psi_2q), -psi_2q - E1d - (xq1 - xl) * i_q)
        self.eq(self.V_t, (v.vd * v.vd + v.vq * v.vq) ** 0.5)

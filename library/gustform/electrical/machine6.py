"""Synchronous machine of sixth order."""

from __future__ import annotations

import cmath
import itertools
from dataclasses import dataclass

from gustform.electrical.synchronous_machine import MachineRest, SynchronousMachine
from gustform.language import GustformError, Parameter, Variable


@dataclass(frozen=True)
class Machine6Rest(MachineRest):
    """A machine of sixth order at rest: voltages and flux linkages too, pu."""

    E1q: float
    E1d: float
    psi_1d: float
    psi_2q: float
    psi_d: float
    psi_q: float


class Machine6(SynchronousMachine):
    """Synchronous machine with field and damper on d and two dampers on q.

    States: delta, omega, E'q, E'd, psi_1d, psi_2q.

    Currents i_d, i_q out of the machine (generator convention inside; the port's flows are into it), pu of the rating:

        2 H omega d(omega)/dt = P_m - T_e - D (omega - 1)      d(delta)/dt = w0 (omega - frame)
        T_e   = psi_d i_q - psi_q i_d
        v_d   = -r_a i_d - psi_q                     v_q   = -r_a i_q + psi_d
        psi_d = -xd'' i_d + (xd''-xl)/(xd'-xl) E'q + (xd'-xd'')/(xd'-xl) psi_1d
        psi_q = -xq'' i_q - (xq''-xl)/(xq'-xl) E'd + (xq'-xq'')/(xq'-xl) psi_2q
        T'd0 dE'q/dt = -E'q - (xd-xd')(i_d - (xd'-xd'')/(xd'-xl)^2 (psi_1d + (xd'-xl) i_d - E'q)) + E_fd
        T'q0 dE'd/dt = -E'd + (xq-xq')(i_q - (xq'-xq'')/(xq'-xl)^2 (psi_2q + (xq'-xl) i_q + E'd))
        T''d0 dpsi_1d/dt = -psi_1d + E'q - (xd'-xl) i_d
        T''q0 dpsi_2q/dt = -psi_2q - E'd - (xq'-xl) i_q

    The swing equation is in its power form, which belongs to a stator without speed voltages: T_e is then the air-gap
    power. Base of powers: the rating; of omega: w0 = 2 pi f0; time in s. No saturation. On each axis
    xl < x'' <= x' <= x.

    delta is the angle of the q axis against the phasor frame and keeps its start value in a steady state: the machine
    is the system's reference angle.

    Source: Sauer and Pai, Power System Dynamics and Stability, 1998, chapter 3; data: project notes, set A.
    """

    xd = Parameter("pu", "synchronous reactance, d axis", default=1.81, above=0.0)
    xq = Parameter("pu", "synchronous reactance, q axis", default=1.76, above=0.0)
    xd1 = Parameter("pu", "transient reactance xd'", default=0.30, above=0.0)
    xq1 = Parameter("pu", "transient reactance xq'", default=0.65, above=0.0)
    xd2 = Parameter("pu", "subtransient reactance xd''", default=0.23, above=0.0)
    xq2 = Parameter("pu", "subtransient reactance xq''", default=0.25, above=0.0)
    xl = Parameter("pu", "leakage reactance", default=0.15, min=0.0)
    Td0_1 = Parameter("s", "open-circuit transient time constant T'd0", default=8.0, above=0.0)
    Tq0_1 = Parameter("s", "open-circuit transient time constant T'q0", default=1.0, above=0.0)
    Td0_2 = Parameter("s", "open-circuit subtransient time constant T''d0", default=0.03, above=0.0)
    Tq0_2 = Parameter("s", "open-circuit subtransient time constant T''q0", default=0.07, above=0.0)

    E1q = Variable("pu", "E'q, transient voltage of the field winding", start=0.92)
    E1d = Variable("pu", "E'd, transient voltage of the q-axis damper", start=0.34)
    psi_1d = Variable("pu", "flux linkage of the d-axis damper", start=0.88)
    psi_2q = Variable("pu", "flux linkage of the second q-axis damper", start=-0.5)
    psi_d = Variable("pu", "stator flux linkage, d axis", start=0.89)
    psi_q = Variable("pu", "stator flux linkage, q axis", start=-0.47)

    def rest(self, power: complex, voltage: complex) -> Machine6Rest:
        """The machine at rest, delivering `power` at the terminal phasor `voltage` (pu)."""
        self.check_reactances()
        v, i, ra = voltage, (power / voltage).conjugate(), self.resistance
        delta = cmath.phase(v + complex(ra, self.xq) * i)
        turn = cmath.exp(-1j * (delta - cmath.pi / 2))  # network to d + jq
        v_d, v_q, i_d, i_q = (v * turn).real, (v * turn).imag, (i * turn).real, (i * turn).imag
        psi_d, psi_q = v_q + ra * i_q, -(v_d + ra * i_d)
        E1q, E1d = psi_d + self.xd1 * i_d, (self.xq - self.xq1) * i_q
        return Machine6Rest(
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

    def check_reactances(self) -> None:
        """GF2061 if they do not grow from the leakage to the synchronous reactance."""
        for names in (("xl", "xd2", "xd1", "xd"), ("xl", "xq2", "xq1", "xq")):
            for low, high in itertools.pairwise(names):
                a, b = self.value(low), self.value(high)
                if b < a or (low == "xl" and b == a):
                    raise GustformError(
                        "GF2061",
                        f"{self.path}.{high} must be {'above' if low == 'xl' else 'at least'} {low} = {a:g} "
                        f"({self.declarations()[high].description}, pu); got {b:g}",
                        hint=f"{' < '.join(names[:2])} <= {' <= '.join(names[2:])}",
                    )

    def equations(self) -> None:
        super().equations()
        xd1, xq1, xd2, xq2, xl = self.xd1, self.xq1, self.xd2, self.xq2, self.xl
        E1q, E1d, psi_1d, psi_2q = self.E1q, self.E1d, self.psi_1d, self.psi_2q
        i_d, i_q, v, ra = self.i_d, self.i_q, self.stator, self.resistance
        # stator
        self.eq(v.vd, -ra * i_d - self.psi_q)
        self.eq(v.vq, -ra * i_q + self.psi_d)
        self.eq(self.T_e, self.psi_d * i_q - self.psi_q * i_d)
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

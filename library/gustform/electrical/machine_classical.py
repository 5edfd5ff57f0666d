"""Classical synchronous machine: a constant voltage behind its transient reactance."""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from typing import ClassVar

from gustform.electrical.synchronous_machine import MachineRest, SynchronousMachine
from gustform.language import Parameter


@dataclass(frozen=True)
class ClassicalRest(MachineRest):
    """A classical machine at rest: the voltage behind x'd too, pu."""

    E: float


class ClassicalMachine(SynchronousMachine):
    """Synchronous machine of second order: constant voltage E behind the transient reactance x'd.

    States: delta, omega.

        2 H omega d(omega)/dt = P_m - T_e - D (omega - 1)      d(delta)/dt = w0 (omega - frame)
        v_d = -r_a i_d + xd' i_q          v_q = E - r_a i_q - xd' i_d          T_e = E i_q

    So T_e = E V/X sin(delta - theta) against a voltage V at theta behind X in all, as in the paper: b_g = E V/X. E lies
    on the q axis. It is what the excitation gives at a steady-state start (E = E_fd there) and stays constant: E_fd has
    no effect while the model runs. Currents out of the machine; base of powers: the rating; of omega: w0 = 2 pi f0.

    Source: Lyu, Subotic, Gross 2022, eq. (13); Kundur, Power System Stability and Control, 1994, 5.3.1.
    """

    excited: ClassVar[bool] = False

    xd1 = Parameter("pu", "transient reactance xd'", default=0.30, above=0.0)
    E = Parameter("pu", "voltage behind xd', found at the start", free=True, start=1.0)

    def rest(self, power: complex, voltage: complex) -> ClassicalRest:
        """The machine at rest, delivering `power` at the terminal phasor `voltage` (pu)."""
        i = (power / voltage).conjugate()
        inner = voltage + complex(self.resistance, self.xd1) * i
        E, delta = cmath.polar(inner)
        turned = i * cmath.exp(-1j * (delta - cmath.pi / 2))  # network to d + jq
        return ClassicalRest(delta=delta, i_d=turned.real, i_q=turned.imag, P_m=E * turned.imag, E_fd=E, E=E)

    def equations(self) -> None:
        super().equations()
        v, i_d, i_q, ra = self.stator, self.i_d, self.i_q, self.resistance
        self.eq(v.vd, self.xd1 * i_q - ra * i_d)
        self.eq(v.vq, self.E - self.xd1 * i_d - ra * i_q)
        self.eq(self.T_e, self.E * i_q)
        self.initial(self.E, self.E_fd)

"""Machine-side converter that takes a power from the machine through a loop on its current."""

from __future__ import annotations

from gustform.electrical.msc_dq import MachineSideDq
from gustform.language import Input, Parameter, maximum


class MachineSidePowerDq(MachineSideDq):
    """Averaged converter whose control imposes the torque of the machine, with no current along the magnet.

        tau* = P_ref/omega_r,   i_q* = tau*/psi = P_ref / max(psi omega_r, V_min),   i_d* = 0

    so the machine's air gap gives P_ref, and P is less by the losses r i^2 of its stator. V_min bounds the current of a
    machine that hardly turns. pu: rating and voltage of the machine, base of the rotor speed.
    Source: see MachineSideDq; Lyu, Subotic, Gross 2022, III-A.
    """

    V_min = Parameter("pu", "EMF below which the current reference grows no more", default=0.1, above=0.0)

    P_ref = Input("pu", "active power to take from the machine, base rating", start=0.5)

    def equations(self) -> None:
        super().equations()
        self.follow(0.0, self.P_ref / maximum(self.psi * self.omega_r, self.V_min))

"""Permanent-magnet synchronous generator in the frame of its own rotor."""

from __future__ import annotations

from gustform.electrical.permanent_magnet import PermanentMagnetMachine
from gustform.language import Parameter, Variable


class PmsgDq(PermanentMagnetMachine):
    """PMSG without saliency whose converter imposes the current, in dq: the magnets' flux lies along d.

        v_d = -r i_d + omega L i_q                  v = E - (r + j omega L) i,  E = j omega psi
        v_q = -r i_q - omega L i_d + omega psi      i out of the machine
        tau_e = psi i_q                             P = omega tau_e - r |i|^2, delivered

    The terminals stand in the rotor's frame: vr + j vi = V_b (v_d + j v_q), which needs no rotor angle. Without stator
    dynamics: the current follows from what is connected. pu: base rating, voltage, omega_base (mechanical).
    Source: Kundur, Power System Stability and Control, 1994, 3.3, with constant field; Lyu, Subotic, Gross 2022, III-A:
    the machine side's reference angle is the rotor's.
    """

    r = Parameter("pu", "stator resistance", default=0.0, min=0.0)

    i_d = Variable("pu", "current out of the machine along the magnets' flux")
    i_q = Variable("pu", "current out of the machine along the EMF", start=0.5)

    def equations(self) -> None:
        super().equations()
        v, omega = self.terminal, self.omega
        I_b = self.rating / self.voltage
        self.eq(v.ir, -I_b * self.i_d)
        self.eq(v.ii, -I_b * self.i_q)
        self.eq(v.vr, self.voltage * (-self.r * self.i_d + omega * self.L * self.i_q))
        self.eq(v.vi, self.voltage * (-self.r * self.i_q - omega * self.L * self.i_d + omega * self.psi))
        self.eq(self.shaft.tau, self.rating / self.omega_base * self.psi * self.i_q)

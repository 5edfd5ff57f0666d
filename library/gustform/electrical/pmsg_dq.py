"""Permanent-magnet synchronous generator in the frame of its own rotor."""

from __future__ import annotations

from gustform.electrical.permanent_magnet import PermanentMagnetMachine
from gustform.language import Parameter, Variable


class PmsgDq(PermanentMagnetMachine):
    """PMSG without saliency in dq: the magnets' flux lies along d, the EMF along q.

        v_d = -r i_d + omega L i_q - L/w_b d(i_d)/dt                  v = E - (r + j omega L) i,  E = j omega psi
        v_q = -r i_q - omega L i_d + omega psi - L/w_b d(i_q)/dt      i out of the machine,  w_b = p omega_base
        tau_e = psi i_q                                               P = omega tau_e - r |i|^2 - d/dt(L/w_b |i|^2/2)

    Without `stator_dynamics` the terms with d/dt are left out and the current follows from what is connected. The
    terminals stand in the rotor's frame: vr + j vi = V_b (v_d + j v_q), which needs no rotor angle. P is delivered. pu:
    base rating, voltage, omega_base (mechanical).
    Source: Kundur, Power System Stability and Control, 1994, 3.3, with constant field; Lyu, Subotic, Gross 2022, III-A:
    the machine side's reference angle is the rotor's. r = 0.01 pu with the stator's dynamics only: project notes.
    """

    stator_dynamics = Parameter("1", "whether the stator currents are states", default=False, structural=True)
    r = Parameter("pu", "stator resistance", default=lambda self: 0.01 if self.stator_dynamics else 0.0, min=0.0)

    i_d = Variable("pu", "current out of the machine along the magnets' flux")
    i_q = Variable("pu", "current out of the machine along the EMF", start=0.5)

    def equations(self) -> None:
        super().equations()
        v, omega = self.terminal, self.omega
        I_b = self.rating / self.voltage
        self.eq(v.ir, -I_b * self.i_d)
        self.eq(v.ii, -I_b * self.i_q)
        v_d = -self.r * self.i_d + omega * self.L * self.i_q
        v_q = -self.r * self.i_q - omega * self.L * self.i_d + omega * self.psi
        if self.stator_dynamics:
            w_b = self.pole_pairs * self.omega_base
            v_d -= self.L / w_b * self.der(self.i_d)
            v_q -= self.L / w_b * self.der(self.i_q)
        self.eq(v.vr, self.voltage * v_d)
        self.eq(v.vi, self.voltage * v_q)
        self.eq(self.shaft.tau, self.rating / self.omega_base * self.psi * self.i_q)

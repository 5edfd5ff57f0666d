"""Machine-side converter, averaged, that takes a power from the machine."""

from __future__ import annotations

from gustform.electrical.machine_side import MachineSide
from gustform.language import Input, Parameter, Variable, maximum


class MachineSidePower(MachineSide):
    """Averaged, lossless converter whose vector current control takes the power P_ref, with no current along d.

        i_d = 0
        T d(i_q)/dt = P_ref / max(v_q, V_min) - i_q        i out of the machine, in the frame of its rotor
        P = v_q i_q                                         so T dP/dt = P_ref - P while v_q stands still

    The current loop is a lag. V_min bounds the current of a machine that hardly turns. After `blocked` has become 1, no
    current flows. pu: base rating, voltage. Ports in V and A.
    Source: Lyu, Subotic, Gross 2022, III-A; lag of 20 ms: project notes.
    """

    rating = Parameter("VA", "base of power", default=5e6, above=0.0)
    T = Parameter("s", "time constant of the current loop", default=0.02, above=0.0)
    V_min = Parameter("pu", "voltage below which the current reference grows no more", default=0.1, above=0.0)

    P_ref = Input("pu", "active power to take from the machine, base rating", start=0.5)
    blocked = Input("1", "1: the converter is blocked")
    i_q = Variable("pu", "current along the EMF, out of the machine, before blocking", start=0.5)

    def equations(self) -> None:
        super().equations()
        I_b = self.rating / self.voltage
        v_q = maximum(self.machine.vi / self.voltage, self.V_min)
        self.eq(self.T * self.der(self.i_q), self.P_ref / v_q - self.i_q)
        self.eq(self.machine.ir, 0)
        self.eq(self.machine.ii, I_b * self.i_q * (1.0 - self.blocked))

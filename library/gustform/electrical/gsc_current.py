"""Grid-side converter, averaged, that imposes a current."""

from __future__ import annotations

import casadi as ca

from gustform.electrical.grid_side import GridSide
from gustform.language import Input, Parameter, Variable


class GridSideCurrent(GridSide):
    """Averaged, lossless converter whose vector current control imposes a current in its own frame, in phasors.

        T d(i_d)/dt = i_d_ref - i_d,   T d(i_q)/dt = i_q_ref - i_q
        i = I_b (i_d + j i_q) e^{j theta}                     out of the converter,  I_b = S_b / V_b
        P + jQ = (v_d + j v_q) conj(i) + (r + jx) |i|^2       measured at the converter, before the filter
        v_dc i_dc = P

    The current loop is a lag. After `blocked` has become 1, no current flows. Base: rating, nominal voltage. Ports in
    V and A. Source: Lyu, Subotic, Gross 2022, III-A, eq. (3); lag of 5 ms: project notes.
    """

    T = Parameter("s", "time constant of the current loop", default=0.005, above=0.0)

    i_d_ref = Input("pu", "reference of the current along the frame, generator convention", start=0.5)
    i_q_ref = Input("pu", "reference of the current across the frame, generator convention")
    blocked = Input("1", "1: the converter is blocked")
    i_d = Variable("pu", "current along the frame, before blocking", start=0.5)
    i_q = Variable("pu", "current across the frame, before blocking")

    def equations(self) -> None:
        super().equations()
        self.eq(self.T * self.der(self.i_d), self.i_d_ref - self.i_d)
        self.eq(self.T * self.der(self.i_q), self.i_q_ref - self.i_q)
        flowing = 1.0 - self.blocked
        i_d, i_q = self.i_d * flowing, self.i_q * flowing
        c, s = ca.cos(self.theta), ca.sin(self.theta)
        I_b = self.rating / self.voltage
        self.eq(self.grid.ir, -I_b * (i_d * c - i_q * s))
        self.eq(self.grid.ii, -I_b * (i_d * s + i_q * c))
        square = i_d * i_d + i_q * i_q
        self.eq(self.P, self.rating * (self.v_d * i_d + self.v_q * i_q + self.resistance * square))
        self.eq(self.Q, self.rating * (self.v_q * i_d - self.v_d * i_q + self.x * square))

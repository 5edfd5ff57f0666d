"""Grid-side converter, averaged, that imposes a voltage."""

from __future__ import annotations

import casadi as ca

from gustform.electrical.grid_side import GridSide
from gustform.language import Input


class GridSideConverter(GridSide):
    """Averaged, lossless converter that imposes a voltage behind its filter, in phasors.

        d(theta)/dt = w0 (omega - frame)          w0 = 2 pi f0
        e = V V_b e^{j theta}
        e - v = (r + jx) Z_b i                    i out of the converter,  Z_b = V_b^2 / S_b
        P + jQ = e conj(i)                        measured at the converter, before the filter
        v_dc i_dc = P

    Base: rating, nominal voltage. After `blocked` has become 1, no current flows. The filter's capacitor is left
    out at phasor fidelity. Ports in V and A.
    Source: Lyu, Subotic, Gross 2022, II-B, eqs. (3), (7); filter .01 + j.1 pu: Table I and project notes.
    """

    V = Input("pu", "magnitude of the voltage, base V_b", start=1.0)
    blocked = Input("1", "1: the converter is blocked")

    def equations(self) -> None:
        super().equations()
        v = self.grid
        Z_b = self.voltage * self.voltage / self.rating
        R, X = self.resistance * Z_b, self.x * Z_b
        E = self.voltage * self.V
        e_r, e_i = E * ca.cos(self.theta), E * ca.sin(self.theta)
        closed = 1.0 - self.blocked
        self.eq((e_r - v.vr) * closed, X * v.ii - R * v.ir)
        self.eq((e_i - v.vi) * closed, -X * v.ir - R * v.ii)
        self.eq(self.P, -(e_r * v.ir + e_i * v.ii))
        self.eq(self.Q, e_r * v.ii - e_i * v.ir)

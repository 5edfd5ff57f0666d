"""Grid-side converter that imposes a voltage through inner loops on its LC filter."""

from __future__ import annotations

from gustform.control.inner_loops import VoltageLoop
from gustform.control.virtual_impedance import VirtualImpedance
from gustform.electrical.gsc_dq import GridSideDq
from gustform.language import Input, Part


class GridSideVoltageDq(GridSideDq):
    """Averaged converter with LC filter whose control imposes a voltage behind a virtual impedance.

        v*  = V - (r + jx) i_g          virtual impedance: that of the filter
        i_f* from a PI loop on the capacitor voltage v, e from a PI loop on the current i_f of the inductor

    So V stands behind the same r + jx as in phasors, and b_gsc is the same. pu: rating, nominal voltage.
    Source: see GridSideDq and the loops; Lyu, Subotic, Gross 2022, eq. (7): V at the angle of omega.
    """

    virtual = Part(VirtualImpedance, "virtual impedance", r=lambda self: self.resistance, x=lambda self: self.x)
    capacitor = Part(VoltageLoop, "voltage loop", b=lambda self: self.b)

    V = Input("pu", "magnitude of the voltage, base V_b", start=1.0)

    def equations(self) -> None:
        super().equations()
        virtual, capacitor = self.virtual, self.capacitor
        self.connect(virtual.V, self.V)
        self.connect(virtual.i_d, self.i_gd)
        self.connect(virtual.i_q, self.i_gq)
        self.connect(capacitor.omega, self.omega)
        self.connect(capacitor.v_d_ref, virtual.v_d)
        self.connect(capacitor.v_q_ref, virtual.v_q)
        self.connect(capacitor.v_d, self.v_d)
        self.connect(capacitor.v_q, self.v_q)
        self.connect(capacitor.i_gd, self.i_gd)
        self.connect(capacitor.i_gq, self.i_gq)
        self.follow(capacitor.i_d_ref, capacitor.i_q_ref)

"""Machine-side converter, averaged, that imposes a voltage."""

from __future__ import annotations

from gustform.electrical.machine_side import MachineSide
from gustform.language import Input


class MachineSideConverter(MachineSide):
    """Averaged, lossless converter that imposes a voltage on the machine, in phasors.

        v = V V_b + j0            the frame of the machine side stands on this voltage and turns at omega_msc
        v_dc i_dc = -P            P: active power taken from the machine

    Q is what the converter delivers to the machine. V in pu of V_b; ports in V and A. The reactance that the converter
    works on is that of the machine.
    Source: Lyu, Subotic, Gross 2022, II-B, eq. (3): P = P_pmsg = -P_msc.
    """

    V = Input("pu", "magnitude of the AC voltage, base V_b", start=1.0)

    def equations(self) -> None:
        super().equations()
        self.eq(self.machine.vr, self.voltage * self.V)
        self.eq(self.machine.vi, 0)

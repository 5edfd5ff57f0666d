"""Droop control of the grid side, DC voltage held by the machine side."""

from __future__ import annotations

from gustform.control.dc_voltage_held import DcVoltageHeld
from gustform.language import Parameter, Variable


class Droop(DcVoltageHeld):
    """Grid-forming droop control: the frequency falls with the power delivered.

        T_p d(P_f)/dt = P_gsc - P_f
        omega_gsc = 1 + m_p (P* - P_f)
        V_gsc     = V* + K_q (Q* - Q_f)
        P_msc     = PI(v_dc* - v_dc)          within 0 and the limit of the machine side

    The grid side assumes that the DC voltage is held. pu as in ConverterControl; time in s.
    Source: Chandorkar, Divan, Adapa, Control of parallel connected inverters in standalone AC supply systems, IEEE
    Trans. Ind. Appl. 29 (1993); Lyu, Subotic, Gross 2022, III-B. m_p = 5 %, T_p = 0.05 s: ours.
    """

    T_p = Parameter("s", "time constant of the filter of the active power", default=0.05, above=0.0)

    P_filtered = Variable("pu", "filtered active power P_f", start=0.5)

    def equations(self) -> None:
        super().equations()
        self.eq(self.T_p * self.der(self.P_filtered), self.P_gsc - self.P_filtered)
        self.eq(self.omega_gsc, 1.0 + self.droop * (self.P_ref - self.P_filtered))

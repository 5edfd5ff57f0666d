"""Virtual synchronous machine on the grid side, DC voltage held by the machine side."""

from __future__ import annotations

from gustform.control.dc_voltage_held import DcVoltageHeld
from gustform.language import Parameter, Variable


class VirtualSynchronousMachine(DcVoltageHeld):
    """Grid-forming control by the swing equation of a virtual machine.

        omega_gsc = 1 + w,      2 H dw/dt = P* - P_gsc - w/m_p - D (w - w_f),      T_f d(w_f)/dt = w - w_f
        V_gsc = V* + K_q (Q* - Q_f)
        P_msc = PI(v_dc* - v_dc)              within 0 and the limit of the machine side

    D damps swings against the slow deviation w_f and does not change the droop; in the source a PLL gives that
    frequency, here it is the machine's own, filtered. The grid side assumes that the DC voltage is held. pu as in
    ConverterControl; time in s. The states are deviations, because a single-precision number near 1 loses what the
    sampled control adds to it in a period.
    Source: D'Arco, Suul, Fosso, A virtual synchronous machine implementation for distributed control of power
    converters in smart grids, Electr. Power Syst. Res. 122 (2015); Lyu, Subotic, Gross 2022, III-B. Values: ours.
    """

    H = Parameter("s", "inertia constant of the virtual machine", default=2.0, above=0.0)
    D = Parameter("pu", "damping against the filtered frequency", default=100.0, min=0.0)
    T_f = Parameter("s", "time constant of the filter of the frequency", default=0.5, above=0.0)

    w = Variable("pu", "deviation of the frequency from nominal, base f0")
    w_f = Variable("pu", "filtered deviation of the frequency, base f0")

    def equations(self) -> None:
        super().equations()
        self.eq(self.omega_gsc, 1.0 + self.w)
        self.eq(
            2.0 * self.H * self.der(self.w),
            self.P_ref - self.P_gsc - self.w / self.droop - self.D * (self.w - self.w_f),
        )
        self.eq(self.T_f * self.der(self.w_f), self.w - self.w_f)

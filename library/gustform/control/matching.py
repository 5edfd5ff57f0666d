"""Matching control of the grid side."""

from __future__ import annotations

from gustform.control.grid_forming import GridForming
from gustform.control.low_speed_limit import LowSpeedLimit
from gustform.language import Parameter, Part, limit


class Matching(GridForming):
    """Grid-forming matching control: the DC link is the rotor of a synchronous machine.

        omega_gsc = 1 + K_theta (v_dc - v_dc*)
        V_gsc     = V* + K_q (Q* - Q_f)
        P_msc     = P* + K_dc (v_dc* - v_dc)          within 0 and P_limit(omega_r), see LowSpeedLimit

    The machine side acts in proportion only: in a steady state off the nominal frequency v_dc must be free to deviate,
    which is what tells it to help. So the droop is m_p = K_theta/K_dc, from which K_dc follows. Small K_theta means a
    stiff DC link and a large inertia: H = tau_dc/(2 K_theta). pu as in ConverterControl; time in s.
    Source: Arghir, Jouini, Dorfler, Grid-forming control for power converters based on matching of synchronous
    machines, Automatica 95 (2018); Curi, Gross, Dorfler, Control of low-inertia power grids: a model reduction
    approach, CDC 2017. Values: ours.
    """

    K_theta = Parameter("pu", "frequency by the DC voltage", default=0.2, above=0.0)
    K_dc = Parameter(
        "pu", "power of the machine side by the DC voltage", default=lambda self: self.K_theta / self.droop, min=0.0
    )

    low_speed = Part(LowSpeedLimit, "power limit of a slow rotor", P_max=lambda self: self.P_max)

    def equations(self) -> None:
        super().equations()
        deviation = self.v_dc - self.v_dc_ref
        self.connect(self.low_speed.omega_r, self.omega_r)
        self.eq(self.omega_gsc, 1.0 + self.K_theta * deviation)
        self.eq(self.P_msc, limit(self.P_ref - self.K_dc * deviation, 0.0, self.low_speed.P_limit))

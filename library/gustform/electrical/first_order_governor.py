"""Turbine and governor of first order."""

from __future__ import annotations

from gustform.electrical.governor import Governor
from gustform.language import Parameter


class FirstOrderGovernor(Governor):
    """Turbine-governor of first order, without limits and dead band.

        T d(P_m)/dt = P_ref - (omega - 1)/R - P_m

    The paper's T_g dP_g/dt = -P_g - k_g omega_g, with k_g = 1/R and P_g, omega_g as deviations. In a steady state the
    speed falls by R times the power taken over. pu of the machine's rating; time in s. P_ref is found at a steady-state
    start so that the machine turns at `speed_start`.

    Source: Lyu, Subotic, Gross 2022, eq. (13c). The paper gives no T: here T1 + T3 - T2 of TGOV1's set A, so that both
    have the same mean delay.
    """

    droop = Parameter("pu", "droop R: speed deviation for rated power", default=0.05, above=0.0)
    T = Parameter("s", "time constant of turbine and governor", default=5.5, above=0.0)
    speed_start = Parameter("pu", "speed at a steady-state start", default=1.0, above=0.0)
    P_ref = Parameter("pu", "power set point, found at the start", free=True, start=0.4)

    def equations(self) -> None:
        order = self.P_ref - (self.omega - 1.0) / self.droop
        self.eq(self.T * self.der(self.P_m), order - self.P_m)
        self.initial(self.omega, self.speed_start)

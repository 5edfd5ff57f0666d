"""Steam turbine and governor TGOV1."""

from __future__ import annotations

from gustform.electrical.governor import Governor
from gustform.language import Parameter, Variable, dead_band, limit


class TGOV1(Governor):
    """Steam turbine-governor TGOV1 with a dead band on the speed deviation.

        d = omega - 1, less the dead band       (continuous: deviation minus half width outside, 0 inside)
        T1 d(g)/dt = limit(P_ref - d/R, valve_min, valve_max) - g          g  valve
        T3 d(h)/dt = g - h                                                 h  reheater
        P_m = h + T2/T3 (g - h)

    pu of the machine's rating; time in s. The dead band stands before the gain 1/R. P_ref is found at a steady-state
    start so that the machine turns at `speed_start`.

    Inside the dead band nothing holds the frequency, and an eigenvalue is zero. For eigenvalues take set B: R 0.0613,
    T1 0.3 s, T2 2.5 s, T3 8.4 s, no dead band, with H 8 s of the machine. The defaults are set A, for the time domain.

    Source: PSS/E model TGOV1; dead band, sets A and B: project notes.
    """

    droop = Parameter("pu", "droop R: speed deviation for rated power", default=0.05, above=0.0)
    T1 = Parameter("s", "time constant of the valve", default=0.3, above=0.0)
    T2 = Parameter("s", "lead time constant of the turbine", default=2.2, min=0.0)
    T3 = Parameter("s", "lag time constant of the turbine (reheater)", default=7.4, above=0.0)
    half_dead_band = Parameter("pu", "half width of the dead band on the speed", default=0.00105, min=0.0)
    valve_min = Parameter("pu", "lower limit of the valve", default=0.0, min=0.0)
    valve_max = Parameter("pu", "upper limit of the valve", default=1.0)
    speed_start = Parameter("pu", "speed at a steady-state start", default=1.0, above=0.0)
    P_ref = Parameter("pu", "power set point, found at the start", free=True, start=0.4)

    valve = Variable("pu", "valve position g", start=0.4, min=0.0)
    reheater = Variable("pu", "power after the reheater h", start=0.4)

    def equations(self) -> None:
        d = dead_band(self.omega - 1.0, self.half_dead_band)
        order = limit(self.P_ref - d / self.droop, self.valve_min, self.valve_max)
        self.eq(self.T1 * self.der(self.valve), order - self.valve)
        self.eq(self.T3 * self.der(self.reheater), self.valve - self.reheater)
        self.eq(self.P_m, self.reheater + self.T2 / self.T3 * (self.valve - self.reheater))
        self.initial(self.omega, self.speed_start)

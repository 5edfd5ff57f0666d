"""Simplified excitation system SEXS."""

from __future__ import annotations

from gustform.electrical.exciter import Exciter
from gustform.language import Parameter, Variable, limit


class SEXS(Exciter):
    """Simplified excitation system SEXS.

        e = V_ref - V_t
        TB d(a)/dt = e - a                                               lead-lag (1 + s TA)/(1 + s TB)
        TE d(E_fd)/dt = limit(K (a + TA/TB (e - a)), E_min, E_max) - E_fd

    pu of the machine; time in s. V_ref is found at a steady-state start so that V_t = `V_start`.
    Source: PSS/E model SEXS; data: project notes, set A. The field limits are ours and are not reached there.
    """

    K = Parameter("pu", "gain", default=200.0, above=0.0)
    TA = Parameter("s", "lead time constant", default=1.0, min=0.0)
    TB = Parameter("s", "lag time constant", default=10.0, above=0.0)
    TE = Parameter("s", "time constant of the exciter", default=0.05, above=0.0)
    E_min = Parameter("pu", "lower limit of the field voltage", default=0.0)
    E_max = Parameter("pu", "upper limit of the field voltage", default=5.0)
    V_start = Parameter("pu", "terminal voltage at a steady-state start", default=1.0, above=0.0)
    V_ref = Parameter(
        "pu",
        "voltage set point, found at the start",
        free=True,
        start=lambda self: self.V_start + self.lead_start(),
    )

    lead = Variable("pu", "state of the lead-lag a", start=lambda self: self.lead_start(), nominal=0.01)

    def lead_start(self) -> float:
        """First guess of the lead-lag's state: the control error that gives the first guess of E_fd."""
        return float(self.start_value(type(self).E_fd) / self.K)

    def equations(self) -> None:
        e = self.V_ref - self.V_t
        order = limit(self.K * (self.lead + self.TA / self.TB * (e - self.lead)), self.E_min, self.E_max)
        self.eq(self.TB * self.der(self.lead), e - self.lead)
        self.eq(self.TE * self.der(self.E_fd), order - self.E_fd)
        self.initial(self.V_t, self.V_start)

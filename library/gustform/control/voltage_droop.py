"""Voltage of a grid-forming converter by its reactive power."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable


class VoltageDroop(Component):
    """Droop of the voltage with the reactive power.

        T_v d(Q_f)/dt = Q - Q_f
        V = V* + K_q (Q* - Q_f)

    pu: nominal voltage, rating; time in s; Q delivered. Q* is found at a steady-state start so that V = V*.
    Source: Chandorkar, Divan, Adapa, IEEE Trans. Ind. Appl. 29 (1993); values as in Lyu, Subotic, Gross 2022, eq. (8).
    """

    K_q = Parameter("pu", "droop of the voltage with the reactive power", default=0.02, min=0.0)
    T_v = Parameter("s", "time constant of the filter of the reactive power", default=0.05, above=0.0)
    V_ref = Parameter("pu", "voltage set point V*", default=1.0, above=0.0)
    Q_ref = Parameter("pu", "reactive power set point Q*, found at the start", free=True, start=0.0)

    Q = Input("pu", "reactive power delivered")
    V = Output("pu", "magnitude of the converter's voltage", start=1.0)
    Q_filtered = Variable("pu", "filtered reactive power Q_f")

    def equations(self) -> None:
        self.eq(self.T_v * self.der(self.Q_filtered), self.Q - self.Q_filtered)
        self.eq(self.V, self.V_ref + self.K_q * (self.Q_ref - self.Q_filtered))
        self.initial(self.V, self.V_ref)

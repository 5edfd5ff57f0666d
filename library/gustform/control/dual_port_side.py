"""Dual-port grid-forming control of one converter, whichever side it stands on."""

from __future__ import annotations

from typing import Any

from gustform.language import Component, Input, Output, Parameter, Variable


class DualPortSide(Component):
    """Base: frequency from the DC voltage, voltage from the reactive power.

        omega = omega* + (K_theta + K_d s)/(T_dc s + 1) (v_dc - v_dc*)
        V     = V* + K_q (Q* - Q/(T_v s + 1))

    with one state for each filter, xi for the first:

        T_dc d(xi)/dt = (v_dc - v_dc*) - xi
        omega = omega* + K_theta xi + K_d d(xi)/dt
        T_v d(Q_f)/dt = Q - Q_f

    `lossless`, the form of the paper's analysis: T_dc = 0 and a constant voltage, so that no state is left:

        omega = omega* + K_theta (v_dc - v_dc*) + K_d d(v_dc)/dt          V = V*

    The side says what omega* is, and which of the set points V*, Q* is found at a steady-state start. pu: nominal
    frequency or speed, nominal voltages, rating of the turbine; time in s; Q delivered. Stable for T_dc < K_d/K_theta
    only (project notes): the published T_dc = 0.05 s is not.
    Source: Lyu, Subotic, Gross 2022, eqs. (7)-(9); V-A for the analysis.
    """

    lossless = Parameter(
        "1", "the paper's analysis: no filter of the DC voltage, constant AC voltage", default=False, structural=True
    )
    K_theta = Parameter("pu", "droop of the frequency with the DC voltage", default=0.5, above=0.0)
    K_d = Parameter("s", "derivative gain, pu frequency for 1 pu/s of DC voltage", default=0.0067, min=0.0)
    T_dc = Parameter("s", "time constant of the filter of the DC voltage", default=0.002, above=0.0)
    K_q = Parameter("pu", "droop of the voltage with the reactive power", default=0.02, min=0.0)
    T_v = Parameter("s", "time constant of the filter of the reactive power", default=0.05, above=0.0)
    v_dc_ref = Parameter("pu", "DC voltage set point v_dc*", default=1.0, above=0.0)
    V_ref = Parameter("pu", "voltage set point V*", default=1.0, above=0.0)
    Q_ref = Parameter("pu", "reactive power set point Q*", default=0.0)

    v_dc = Input("pu", "DC voltage", start=1.0)
    dv_dc = Input("1/s", "rate of change of the DC voltage in pu/s, read by the lossless form only")
    Q = Input("pu", "reactive power delivered")
    omega = Output("pu", "frequency of the converter's voltage", start=1.0)
    V = Output("pu", "magnitude of the converter's voltage", start=1.0)
    xi = Variable("pu", "filtered deviation of the DC voltage")
    Q_filtered = Variable("pu", "filtered reactive power Q_f")

    def omega_ref(self) -> Any:
        """omega*, the frequency at v_dc = v_dc*."""
        raise NotImplementedError

    def equations(self) -> None:
        if self.lossless:
            slope = self.dv_dc
            self.eq(self.xi, self.v_dc - self.v_dc_ref)
            self.eq(self.Q_filtered, self.Q)
            self.eq(self.V, self.V_ref)
        else:
            slope = (self.v_dc - self.v_dc_ref - self.xi) / self.T_dc
            self.eq(self.der(self.xi), slope)
            self.eq(self.T_v * self.der(self.Q_filtered), self.Q - self.Q_filtered)
            self.eq(self.V, self.V_ref + self.K_q * (self.Q_ref - self.Q_filtered))
        self.eq(self.omega, self.omega_ref() + self.K_theta * self.xi + self.K_d * slope)
        self.initial(self.Q, self.Q_ref)

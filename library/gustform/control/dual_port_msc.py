"""Dual-port grid-forming control of the machine-side converter."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable


class DualPortMsc(Component):
    """Machine-side frequency from the DC voltage, machine-side voltage from the reactive power.

        omega = omega_del + (K_theta + K_d s)/(T_dc s + 1) (v_dc - v_dc*)
        V     = V* + K_q (Q* - Q/(T_v s + 1))

    with the states xi and Q_f as in DualPortGsc, and without them for `lossless`. pu: base of the rotor speed, nominal
    voltages, rating of the turbine; time in s; Q delivered to the machine. V* is found at a steady-state start so that
    the reactive power is Q* = 0.
    Source: Lyu, Subotic, Gross 2022, eqs. (9a), (9b) with K_q^msc (project notes).
    """

    lossless = Parameter(
        "1", "the paper's analysis: no filter of the DC voltage, constant AC voltage", default=False, structural=True
    )
    K_theta = Parameter("pu", "droop of the rotor speed with the DC voltage", default=0.5, above=0.0)
    K_d = Parameter("s", "derivative gain, pu speed for 1 pu/s of DC voltage", default=0.0067, min=0.0)
    T_dc = Parameter("s", "time constant of the filter of the DC voltage", default=0.002, above=0.0)
    K_q = Parameter("pu", "droop of the voltage with the reactive power", default=0.05, min=0.0)
    T_v = Parameter("s", "time constant of the filter of the reactive power", default=0.05, above=0.0)
    v_dc_ref = Parameter("pu", "DC voltage set point v_dc*", default=1.0, above=0.0)
    Q_ref = Parameter("pu", "reactive power set point Q*", default=0.0)
    V_ref = Parameter("pu", "voltage set point V*, found at the start", free=True, start=0.95)

    omega_del = Input("pu", "rotor speed at the operating point", start=1.2)
    v_dc = Input("pu", "DC voltage", start=1.0)
    dv_dc = Input("1/s", "rate of change of the DC voltage in pu/s, read by the lossless form only")
    Q = Input("pu", "reactive power delivered to the machine")
    omega = Output("pu", "frequency of the converter's voltage, base of the rotor speed", start=1.2)
    V = Output("pu", "magnitude of the converter's voltage", start=1.0)
    xi = Variable("pu", "filtered deviation of the DC voltage")
    Q_filtered = Variable("pu", "filtered reactive power Q_f")

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
        self.eq(self.omega, self.omega_del + self.K_theta * self.xi + self.K_d * slope)
        self.initial(self.Q, self.Q_ref)

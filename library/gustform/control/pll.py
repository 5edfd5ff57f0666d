"""Phase-locked loop."""

from __future__ import annotations

from gustform.conventions import magnitude
from gustform.language import Component, Input, Output, Parameter, Variable, maximum


class Pll(Component):
    """Synchronous-reference-frame PLL: turns the frame until the voltage lies along d.

        e     = v_q / max(|v|, V_min)
        omega = omega_0 + k_p e + I,      d(I)/dt = k_i e

    The angle is that of the frame which turns at omega; v_d, v_q are seen from it. For small angles against the voltage
    the loop is s^2 + w0 k_p s + w0 k_i: with the default gains 21 rad/s and a damping of 1.5. pu: base f0, nominal
    voltage; time in s. Source: Chung, A phase tracking system for three phase utility interface inverters, IEEE
    Trans. Power Electron. 15 (2000); gains: project notes.
    """

    omega_0 = Parameter("pu", "nominal frequency", default=1.0, above=0.0)
    k_p = Parameter("pu", "proportional gain", default=0.2, min=0.0)
    k_i = Parameter("1/s", "integral gain, pu/pu/s", default=1.4, above=0.0)
    V_min = Parameter("pu", "voltage below which the gains fall with it", default=0.1, above=0.0)

    v_d = Input("pu", "voltage along the frame", start=1.0)
    v_q = Input("pu", "voltage across the frame")
    omega = Output("pu", "frequency of the frame", start=1.0)
    integral = Variable("pu", "integral part I, deviation of the frequency")

    def equations(self) -> None:
        e = self.v_q / maximum(magnitude(self.v_d, self.v_q), self.V_min)
        self.eq(self.der(self.integral), self.k_i * e)
        self.eq(self.omega, self.omega_0 + self.k_p * e + self.integral)

"""Machine-side control that holds the DC voltage."""

from __future__ import annotations

from gustform.control.low_speed_limit import LowSpeedLimit
from gustform.control.pi_control import PiControl
from gustform.language import Component, Input, Output, Parameter, Part


class MscDcVoltage(Component):
    """The machine side gives the DC link what the grid side takes out of it.

        P = PI(v_dc* - v_dc)            within 0 and P_limit(omega_r), see LowSpeedLimit

    Once P stands at its limit, nothing holds the DC voltage. pu: rating, nominal DC voltage, base of the rotor speed.
    Source: Lyu, Subotic, Gross 2022, III-B; gains of the PI: those of the grid side in III-A.
    """

    v_dc_ref = Parameter("pu", "DC voltage set point v_dc*", default=1.0, above=0.0)
    P_max = Parameter("pu", "highest power of the machine side", default=1.0, above=0.0)

    pi = Part(PiControl, "DC voltage", k_p=4.0, k_i=20.0)
    low_speed = Part(LowSpeedLimit, "power limit of a slow rotor", P_max=lambda self: self.P_max)

    v_dc = Input("pu", "DC voltage", start=1.0)
    omega_r = Input("pu", "rotor speed", start=1.2)
    P = Output("pu", "power to be taken from the machine", start=0.5)

    def equations(self) -> None:
        pi = self.pi
        self.connect(self.low_speed.omega_r, self.omega_r)
        self.eq(pi.e, self.v_dc_ref - self.v_dc)
        self.eq(pi.lower, 0)
        self.connect(pi.upper, self.low_speed.P_limit)
        self.connect(self.P, pi.u)

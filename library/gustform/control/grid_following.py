"""Grid-following control at the maximum power point."""

from __future__ import annotations

from gustform.control.converter_control import ConverterControl
from gustform.control.pi_control import PiControl
from gustform.control.pll import Pll
from gustform.language import Input, Output, Parameter, Part, minimum


class GridFollowing(ConverterControl):
    """Grid-following control: the grid side holds the DC voltage, the machine side takes power by the rotor speed.

        omega_gsc = PLL(v_d, v_q)
        i_d_gsc   = PI(v_dc - v_dc*)              within +-i_max sqrt(1 - s^2)
        i_q_gsc   = PI(Q_gsc - Q*)                within +-sqrt(i_max^2 - i_d_gsc^2): active current first, but for
                                          the share s of i_max
        P_msc     = min(k_opt omega_r^3, P_max)

    k_opt is the power of the operating point by the cube of its speed: without curtailment the rotor so finds the
    optimal tip speed ratio in any wind; with it, the same share is held back at its tip speed ratio. From omega_max on
    the speed limiter of the pitch control alone sets the pitch. No response to the frequency. Currents in the
    generator convention; pu as in ConverterControl. Source: Lyu, Subotic, Gross 2022, III-A; gains: project notes
    (those of the reactive power, which the notes leave open: 0.1 s).
    """

    k_opt = Parameter("pu", "power at 1 pu rotor speed", default=1.2**-3, above=0.0)
    P_max = Parameter("pu", "highest power of the machine side", default=1.0, above=0.0)
    v_dc_ref = Parameter("pu", "DC voltage set point v_dc*", default=1.0, above=0.0)
    Q_ref = Parameter("pu", "reactive power set point Q*", default=0.0)
    i_max = Parameter("pu", "largest current of the grid side", default=1.1, above=0.0)
    reactive_share = Parameter(
        "1", "share s of i_max that is always left for reactive current", default=0.1, min=0.01, max=0.99
    )

    omega_r = Input("pu", "rotor speed, base of the rotor speed", start=1.2)
    v_d = Input("pu", "voltage at the grid side of the filter, along the frame", start=1.0)
    v_q = Input("pu", "voltage at the grid side of the filter, across the frame")
    Q_gsc = Input("pu", "reactive power delivered by the grid-side converter")
    i_d_gsc = Output("pu", "reference of the active current", start=0.5)
    i_q_gsc = Output("pu", "reference of the reactive current, negative where Q is delivered")
    P_msc = Output("pu", "power reference of the machine side", start=0.5)

    pll = Part(Pll, "phase-locked loop")
    dc_voltage = Part(PiControl, "DC voltage", k_p=4.0, k_i=20.0)
    reactive = Part(PiControl, "reactive power", k_p=0.1, k_i=10.0, integral=0.0)

    def equations(self) -> None:
        pll, dc_voltage, reactive = self.pll, self.dc_voltage, self.reactive
        self.connect(pll.v_d, self.v_d)
        self.connect(pll.v_q, self.v_q)
        self.connect(self.omega_gsc, pll.omega)
        active_max = self.i_max * (1.0 - self.reactive_share * self.reactive_share) ** 0.5
        self.eq(dc_voltage.e, self.v_dc - self.v_dc_ref)
        self.eq(dc_voltage.lower, -active_max)
        self.eq(dc_voltage.upper, active_max)
        self.connect(self.i_d_gsc, dc_voltage.u)
        reactive_max = (self.i_max * self.i_max - self.i_d_gsc * self.i_d_gsc) ** 0.5
        self.eq(reactive.e, self.Q_gsc - self.Q_ref)
        self.eq(reactive.lower, -reactive_max)
        self.eq(reactive.upper, reactive_max)
        self.connect(self.i_q_gsc, reactive.u)
        self.eq(self.P_msc, minimum(self.k_opt * self.omega_r * self.omega_r * self.omega_r, self.P_max))

"""Dual-port grid-forming control of both converters, sharing their parameters."""

from __future__ import annotations

from gustform.control.converter_control import ConverterControl
from gustform.control.dual_port_gsc import DualPortGsc
from gustform.control.dual_port_msc import DualPortMsc
from gustform.language import Input, Output, Parameter, Part


class DualPort(ConverterControl):
    """Energy-balancing dual-port grid-forming control on both sides of the DC link.

    Both converters form a voltage whose frequency follows the DC voltage, so that in a steady state the deviations of
    grid frequency, DC voltage and rotor speed are in proportion:

        omega_gsc - 1 = K_gsc (v_dc - v_dc*),      omega_msc - omega_del = K_msc (v_dc - v_dc*)

    K_d_msc = K_d_gsc K_msc / K_gsc by default (the condition of the stability theorem). pu as in ConverterControl.
    K_msc comes from the turbine's operating point, omega_del from its schedule; see `control.operating_point`.
    Source: Lyu, Subotic, Gross 2022, IV-C, IV-D; T_dc = 0.002 s: project notes.
    """

    scheduled_pitch = True

    lossless = Parameter(
        "1", "the paper's analysis: no filter of the DC voltage, constant AC voltages", default=False, structural=True
    )
    K_gsc = Parameter("pu", "droop K_theta of the grid side", default=0.5, above=0.0)
    K_msc = Parameter("pu", "droop K_theta of the machine side", default=lambda self: self.K_gsc, min=0.0)
    K_d_gsc = Parameter("s", "derivative gain of the grid side", default=0.0067, min=0.0)
    K_d_msc = Parameter(
        "s", "derivative gain of the machine side", default=lambda self: self.K_d_gsc * self.K_msc / self.K_gsc, min=0.0
    )
    K_q_gsc = Parameter("pu", "voltage droop of the grid side", default=0.02, min=0.0)
    K_q_msc = Parameter("pu", "voltage droop of the machine side", default=0.05, min=0.0)
    T_dc = Parameter("s", "time constant of the filters of the DC voltage", default=0.002, above=0.0)
    T_v = Parameter("s", "time constant of the filters of the reactive power", default=0.05, above=0.0)
    v_dc_ref = Parameter("pu", "DC voltage set point", default=1.0, above=0.0)
    V_ref = Parameter("pu", "voltage set point of the grid side", default=1.0, above=0.0)
    frequency_reserve = Parameter(
        "pu", "largest frequency deviation the gains are designed for", default=0.01, above=0.0
    )

    dv_dc = Input("1/s", "rate of change of the DC voltage in pu/s, read by the lossless form only")
    Q_gsc = Input("pu", "reactive power delivered by the grid-side converter")
    Q_msc = Input("pu", "reactive power delivered by the machine-side converter")
    omega_del = Input("pu", "rotor speed at the operating point, base of the rotor speed", start=1.2)
    V_gsc = Output("pu", "magnitude of the grid-side voltage", start=1.0)
    omega_msc = Output("pu", "frequency of the machine-side voltage, base of the rotor speed", start=1.2)
    V_msc = Output("pu", "magnitude of the machine-side voltage", start=1.0)

    gsc = Part(
        DualPortGsc,
        "grid side",
        lossless=lambda self: self.lossless,
        K_theta=lambda self: self.K_gsc,
        K_d=lambda self: self.K_d_gsc,
        K_q=lambda self: self.K_q_gsc,
        T_dc=lambda self: self.T_dc,
        T_v=lambda self: self.T_v,
        v_dc_ref=lambda self: self.v_dc_ref,
        V_ref=lambda self: self.V_ref,
    )
    msc = Part(
        DualPortMsc,
        "machine side",
        lossless=lambda self: self.lossless,
        K_theta=lambda self: self.K_msc,
        K_d=lambda self: self.K_d_msc,
        K_q=lambda self: self.K_q_msc,
        T_dc=lambda self: self.T_dc,
        T_v=lambda self: self.T_v,
        v_dc_ref=lambda self: self.v_dc_ref,
    )

    def equations(self) -> None:
        self.connect(self.v_dc, self.gsc.v_dc)
        self.connect(self.v_dc, self.msc.v_dc)
        self.connect(self.dv_dc, self.gsc.dv_dc)
        self.connect(self.dv_dc, self.msc.dv_dc)
        self.connect(self.omega_del, self.msc.omega_del)
        self.connect(self.Q_gsc, self.gsc.Q)
        self.connect(self.Q_msc, self.msc.Q)
        self.connect(self.omega_gsc, self.gsc.omega)
        self.connect(self.V_gsc, self.gsc.V)
        self.connect(self.omega_msc, self.msc.omega)
        self.connect(self.V_msc, self.msc.V)

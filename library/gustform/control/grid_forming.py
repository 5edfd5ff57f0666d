"""What the controls have in common that form a voltage on the grid side only."""

from __future__ import annotations

from gustform.control.converter_control import ConverterControl
from gustform.control.voltage_droop import VoltageDroop
from gustform.language import Input, Output, Parameter, Part


class GridForming(ConverterControl):
    """Base of controls that form a voltage on the grid side and take power from the machine.

        V_gsc = VoltageDroop(Q_gsc)

    The power set point P* is found at a steady-state start so that the rotor turns at omega_del. Derived classes give
    omega_gsc and P_msc. pu as in ConverterControl. Source: Lyu, Subotic, Gross 2022, III-B.
    """

    droop = Parameter("pu", "droop m_p: frequency deviation for rated power", default=0.05, above=0.0)
    P_max = Parameter("pu", "highest power of the machine side", default=1.0, above=0.0)
    v_dc_ref = Parameter("pu", "DC voltage set point v_dc*", default=1.0, above=0.0)
    P_ref = Parameter("pu", "active power set point P*, found at the start", free=True, start=0.5)

    voltage = Part(VoltageDroop, "voltage by the reactive power")

    Q_gsc = Input("pu", "reactive power delivered by the grid-side converter")
    omega_r = Input("pu", "rotor speed, base of the rotor speed", start=1.2)
    omega_del = Input("pu", "rotor speed at the operating point, base of the rotor speed", start=1.2)
    V_gsc = Output("pu", "magnitude of the grid-side voltage", start=1.0)
    P_msc = Output("pu", "power reference of the machine side", start=0.5)

    def equations(self) -> None:
        self.connect(self.voltage.Q, self.Q_gsc)
        self.connect(self.V_gsc, self.voltage.V)
        self.initial(self.omega_r, self.omega_del)

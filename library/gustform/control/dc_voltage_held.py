"""What the grid-forming controls have in common whose DC voltage is held by the machine side."""

from __future__ import annotations

from gustform.control.grid_forming import GridForming
from gustform.control.msc_dc_voltage import MscDcVoltage
from gustform.language import Input, Part


class DcVoltageHeld(GridForming):
    """Base of controls whose grid side assumes that the machine side holds the DC voltage.

        P_msc = PI(v_dc* - v_dc)          within 0 and the limit of the machine side

    Derived classes give omega_gsc from the power delivered. pu as in ConverterControl.
    Source: Lyu, Subotic, Gross 2022, III-B.
    """

    P_gsc = Input("pu", "active power out of the grid-side converter", start=0.5)

    dc_voltage = Part(
        MscDcVoltage,
        "DC voltage, held by the machine side",
        v_dc_ref=lambda self: self.v_dc_ref,
        P_max=lambda self: self.P_max,
    )

    def equations(self) -> None:
        super().equations()
        self.connect(self.dc_voltage.v_dc, self.v_dc)
        self.connect(self.dc_voltage.omega_r, self.omega_r)
        self.connect(self.P_msc, self.dc_voltage.P)

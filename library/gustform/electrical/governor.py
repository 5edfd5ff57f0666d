"""What a turbine governor reads and gives."""

from __future__ import annotations

from gustform.language import Component, Input, Output


class Governor(Component):
    """Base of turbine-governors: speed in, mechanical power out. Base: rating of the machine."""

    omega = Input("pu", "speed of the machine, base w0", start=1.0)
    P_m = Output("pu", "mechanical power, base rating of the machine", start=0.5)

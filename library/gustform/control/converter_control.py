"""What the control of a back-to-back converter reads and gives."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter


class ConverterControl(Component):
    """Base of controls of both converters of a turbine.

    pu: powers of the rating of one turbine; DC voltage of its nominal; grid side of V_n and f0; machine side of the
    machine's base voltage and speed. Q is what a converter delivers.
    """

    curtailment = Parameter(
        "1", "share of the available power held back, 1 - eta; 0 is maximum power", default=0.0, min=0.0, max=0.95
    )

    v_dc = Input("pu", "DC voltage", start=1.0)
    Q_gsc = Input("pu", "reactive power delivered by the grid-side converter")
    Q_msc = Input("pu", "reactive power delivered by the machine-side converter")
    omega_gsc = Output("pu", "frequency of the grid-side voltage, base f0", start=1.0)
    V_gsc = Output("pu", "magnitude of the grid-side voltage", start=1.0)
    omega_msc = Output("pu", "frequency of the machine-side voltage, base of the rotor speed", start=1.2)
    V_msc = Output("pu", "magnitude of the machine-side voltage", start=1.0)

"""What the control of a back-to-back converter reads and gives."""

from __future__ import annotations

from typing import ClassVar

from gustform.language import Component, Input, Output, Parameter


class ConverterControl(Component):
    """Base of controls of both converters of a turbine.

    What a control reads are inputs with the name of the turbine's quantity; the turbine connects those it finds:

        v_dc  omega_r  P_pmsg  P_gsc  Q_gsc  Q_msc      measured; Q is what a converter delivers
        v_d  v_q                                        voltage at the grid side of the filter, in the converter's frame
        omega_del  beta_del  wind                       operating point and wind speed, m/s

    What it gives are outputs, by which the turbine knows what each converter imposes:

        omega_gsc, V_gsc             a voltage behind the filter       omega_gsc, i_d_gsc, i_q_gsc   a current
        omega_msc, V_msc             a voltage on the machine          P_msc                         a power

    pu: powers of the rating of one turbine; DC voltage of its nominal; grid side of V_n and f0; machine side of the
    machine's base voltage and speed.
    """

    scheduled_pitch: ClassVar[bool] = False  # whether beta_del is held, or the speed limiter alone sets the pitch

    curtailment = Parameter(
        "1", "share of the available power held back, 1 - eta; 0 is maximum power", default=0.0, min=0.0, max=0.95
    )

    v_dc = Input("pu", "DC voltage", start=1.0)
    omega_gsc = Output("pu", "frequency of the grid side's own frame, base f0", start=1.0)

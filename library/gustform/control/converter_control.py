"""What the control of a back-to-back converter reads and gives."""

from __future__ import annotations

from typing import Any, ClassVar

from gustform.language import Component, GustformError, Input, Output, Parameter

SHORTEST_SAMPLE = 1e-5  # s; the solver begins anew at each
LONGEST_SAMPLE = 1.0  # s; a longer one is a slip of the unit


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

    With `sampled` the control is no part of the equations: its exported C steps once in each period, together with the
    pitch control, on measurements and commands of the number type `real`. The commands are held between the samples,
    and act at once or `delay` samples later.
    """

    scheduled_pitch: ClassVar[bool] = False  # whether beta_del is held, or the speed limiter alone sets the pitch

    curtailment = Parameter(
        "1", "share of the available power held back, 1 - eta; 0 is maximum power", default=0.0, min=0.0, max=0.95
    )

    sampled = Parameter(
        "s",
        "sample period of the exported controller in the place of the equations; 0: continuous",
        default=0.0,
        min=0.0,
        max=LONGEST_SAMPLE,
        structural=True,
    )
    delay = Parameter(
        "1", "samples from a measurement to the command that follows from it", default=0, min=0, max=1, structural=True
    )
    real = Parameter(
        "1",
        "number type of the exported controller",
        default="float",
        structural=True,
        choices=("float", "double"),
    )

    v_dc = Input("pu", "DC voltage", start=1.0)
    omega_gsc = Output("pu", "frequency of the grid side's own frame, base f0", start=1.0)

    def __init__(self, **modifiers: Any) -> None:
        super().__init__(**modifiers)
        sampled, delay = modifiers.get("sampled", 0.0), modifiers.get("delay", 0)
        if not callable(sampled) and 0.0 < sampled < SHORTEST_SAMPLE:
            raise GustformError(
                "GF2003",
                f"{type(self).__name__}.sampled must be 0 or at least {SHORTEST_SAMPLE:g} "
                f"(sample period of the exported controller, s); got {sampled:g}",
                hint="1 ms",
            )
        if not callable(delay) and (isinstance(delay, bool) or delay not in (0, 1)):
            raise GustformError(
                "GF2003", f"{type(self).__name__}.delay must be 0 or 1 (whole samples); got {delay!r}", hint="1"
            )
        if sampled == 0.0 and delay == 1:
            raise GustformError(
                "GF2003",
                f"{type(self).__name__}.delay must be 0 where the control is continuous (whole samples); got {delay!r}",
                hint="sampled: 1 ms",
            )

    def held(self) -> tuple[str, ...]:
        return tuple(self.declared(Output)) if self.sampled > 0.0 else ()

"""Constant field voltage: no voltage control."""

from __future__ import annotations

from gustform.electrical.exciter import Exciter
from gustform.language import Parameter


class ConstantField(Exciter):
    """Excitation by a constant field voltage (manual excitation).

        E_fd = E_ref

    pu of the machine. E_ref is found at a steady-state start so that V_t = `V_start`, and stays.
    Source: Kundur, Power System Stability and Control, 1994, 8.4.1 (DC regulator, manual control).
    """

    V_start = Parameter("pu", "terminal voltage at a steady-state start", default=1.0, above=0.0)
    E_ref = Parameter(
        "pu",
        "field voltage, found at the start",
        free=True,
        start=lambda self: self.start_value(type(self).E_fd),
    )

    def equations(self) -> None:
        self.eq(self.E_fd, self.E_ref)
        self.initial(self.V_t, self.V_start)

"""What an excitation system reads and gives."""

from __future__ import annotations

from gustform.language import Component, Input, Output


class Exciter(Component):
    """Base of excitation systems: terminal voltage in, field voltage out. Base: the machine's own."""

    V_t = Input("pu", "terminal voltage of the machine", start=1.0)
    E_fd = Output("pu", "field voltage; 1 gives rated voltage at no load", start=1.5)

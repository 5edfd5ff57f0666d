"""Bus: the node at which units meet."""

from __future__ import annotations

from gustform.conventions import magnitude
from gustform.interfaces import AcPort
from gustform.language import Component, Parameter, Variable


class Bus(Component):
    """Three-phase node. It has no equations of its own but its voltage to look at:

        V = |v| / V_n,      no current into the bus itself

    Base: the bus's nominal line-to-line RMS voltage V_n.
    """

    voltage = Parameter("V", "nominal line-to-line RMS voltage V_n, base of V", default=33e3, above=0.0)

    terminal = AcPort(
        "what is connected at the bus",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    V = Variable("pu", "voltage magnitude, base V_n", start=1.0)

    def equations(self) -> None:
        self.eq(self.terminal.ir, 0)
        self.eq(self.terminal.ii, 0)
        self.eq(self.V, magnitude(self.terminal.vr, self.terminal.vi) / self.voltage)

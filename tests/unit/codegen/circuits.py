"""Circuit elements and small units that the tests of code generation are made of."""

from __future__ import annotations

from gustform.interfaces import DcPort
from gustform.language import Component, Input, Output, Parameter, Part, Variable


class TwoPin(Component):
    """What all elements with two pins share: the current goes in at p and out at n."""

    v = Variable("V", "voltage from p to n")
    p = DcPort("positive pin")
    n = DcPort("negative pin")

    def equations(self) -> None:
        self.eq(self.v, self.p.v - self.n.v)
        self.eq(self.p.i + self.n.i, 0)


class Resistor(TwoPin):
    R = Parameter("ohm", "resistance", default=2.0)

    def equations(self) -> None:
        super().equations()
        self.eq(self.v, self.R * self.p.i)


class Capacitor(TwoPin):
    C = Parameter("F", "capacitance", default=0.5)

    def equations(self) -> None:
        super().equations()
        self.eq(self.C * self.der(self.v), self.p.i)


class Inductor(TwoPin):
    L = Parameter("H", "inductance", default=0.3)
    i = Variable("A", "current")

    def equations(self) -> None:
        super().equations()
        self.eq(self.i, self.p.i)
        self.eq(self.L * self.der(self.i), self.v)


class VoltageSource(TwoPin):
    V = Parameter("V", "voltage", default=5.0)

    def equations(self) -> None:
        super().equations()
        self.eq(self.v, self.V)


class CurrentSource(TwoPin):
    I = Parameter("A", "current from p to n inside", default=1.0)  # noqa: E741

    def equations(self) -> None:
        super().equations()
        self.eq(self.p.i, self.I)


class Ground(Component):
    pin = DcPort("pin")

    def equations(self) -> None:
        self.eq(self.pin.v, 0)


# ---- units with one terminal, the return path being ground ----


class IdealSource(Component):
    """Fixes the potential of its terminal."""

    V = Parameter("V", "voltage", default=5.0)
    pin = DcPort("terminal", start={"v": lambda self: self.V})

    def equations(self) -> None:
        self.eq(self.pin.v, self.V)


class Load(Component):
    """A resistor to ground."""

    R = Parameter("ohm", "resistance", default=2.0, above=0.0)
    P = Output("W", "power taken")
    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.pin.v, self.R * self.pin.i)
        self.eq(self.P, self.pin.v * self.pin.i)


class Storage(Component):
    """A capacitor to ground behind a resistance, charged to a set point."""

    R = Parameter("ohm", "resistance", default=2.0, above=0.0)
    C = Parameter("F", "capacitance", default=0.5, above=0.0)
    v = Variable("V", "capacitor voltage", start=1.0, nominal=2.0)
    soc = Output("V", "what is shown")
    minus = Output("V", "the same with the other sign")
    seen = Output("V", "terminal voltage")
    pin = DcPort("terminal", start={"v": 3.0}, nominal={"v": 4.0})

    def equations(self) -> None:
        self.eq(self.C * self.der(self.v), self.pin.i)
        self.eq(self.pin.v - self.v, self.R * self.pin.i)
        self.eq(self.soc, self.v)
        self.eq(self.minus, -self.v)
        self.eq(self.seen, self.pin.v)


class Follower(Component):
    """A first-order lag of its input, drawn as a current; has no terminal of its own signal source."""

    T = Parameter("s", "time constant", default=0.1, above=0.0)
    G = Parameter("S", "conductance", default=lambda self: 0.2 / self.gain)
    gain = Parameter("1", "gain", default=1.0)
    u = Input("V", "signal to follow")
    bias = Input("V", "offset")
    x = Variable("V", "state")
    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), self.gain * (self.u + self.bias) - self.x)
        self.eq(self.pin.i, self.G * (self.pin.v - self.x))


class Ladder(Component):
    """Two resistors and a capacitor in a row, from a terminal to ground."""

    R = Parameter("ohm", "resistance of both", default=2.0)
    pin = DcPort("terminal")
    first = Part(Resistor, "first resistor", R=lambda self: self.R)
    second = Part(Resistor, "second resistor", R=lambda self: self.R)
    store = Part(Capacitor, "capacitor")
    ground = Part(Ground, "ground")

    def equations(self) -> None:
        self.connect(self.pin, self.first.p)
        self.connect(self.first.n, self.second.p)
        self.connect(self.second.n, self.store.p)
        self.connect(self.store.n, self.ground.pin)

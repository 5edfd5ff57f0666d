"""The rotor frame of a synchronous machine: its connector, the change of frame, and an impedance in it."""

from __future__ import annotations

import casadi as ca

from gustform.interfaces import AcPort
from gustform.language import Component, Connector, Flow, Input, Parameter, Potential


class DqPort(Connector):
    """Terminal in the rotor's d-q frame, pu of the machine's rating; d-q components of the same phasor as outside.

    The q axis leads the d axis by 90 degrees. P = vd id + vq iq, Q = vq id - vd iq flow into the component.
    """

    vd = Potential("pu", "voltage along the d axis")
    vq = Potential("pu", "voltage along the q axis", start=1.0)
    id = Flow("pu", "current along the d axis into the component")
    iq = Flow("pu", "current along the q axis into the component")


class RotorFrame(Component):
    """Change from the network's phasors (V, A) to a machine's d-q frame (pu).

        v_d + j v_q = v/V_n e^{-j(delta - pi/2)}        and the currents likewise, base I_b = n S_n / V_n

    delta: angle of the q axis against the real axis of the phasor frame. n identical machines are one in the d-q frame.
    Source: Kundur, Power System Stability and Control, 1994, 13.3.
    """

    rating = Parameter("VA", "rated apparent power S_n of one machine", default=210e6, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage V_n of the network side", default=33e3, above=0.0)
    n = Parameter("1", "number of identical machines", default=1.0, min=1.0)

    delta = Input("rad", "angle of the q axis against the phasor frame")
    network = AcPort(
        "network side",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    machine = DqPort("machine side")

    def equations(self) -> None:
        a, m = self.network, self.machine
        s, c = ca.sin(self.delta), ca.cos(self.delta)
        I_b = self.n * self.rating / self.voltage
        self.eq(m.vd, (a.vr * s - a.vi * c) / self.voltage)
        self.eq(m.vq, (a.vr * c + a.vi * s) / self.voltage)
        self.eq(a.ir, -I_b * (m.id * s + m.iq * c))
        self.eq(a.ii, -I_b * (m.iq * s - m.id * c))


class DqImpedance(Component):
    """Series impedance in the rotor frame: the step-up transformer of a machine.

        v_a - v_b = (r + jx) i        i from a to b;  in d-q: v_d: r i_d - x i_q,  v_q: r i_q + x i_d

    pu of the machine's rating; x at nominal frequency.
    """

    lossless = Parameter("1", "whether the series resistance is left out", default=False, structural=True)
    r = Parameter("pu", "series resistance", default=0.0, min=0.0)
    x = Parameter("pu", "series reactance at nominal frequency", default=0.12, min=0.0)

    a = DqPort("one side")
    b = DqPort("other side")

    @property
    def resistance(self) -> float:
        """The series resistance that counts, pu."""
        return 0.0 if self.lossless else self.r

    def equations(self) -> None:
        a, b, r = self.a, self.b, self.resistance
        self.eq(a.id + b.id, 0)
        self.eq(a.iq + b.iq, 0)
        self.eq(a.vd - b.vd, r * a.id - self.x * a.iq)
        self.eq(a.vq - b.vq, r * a.iq + self.x * a.id)

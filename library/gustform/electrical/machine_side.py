"""What every machine-side converter has: its ports and its power balance."""

from __future__ import annotations

from gustform.conventions import active_power, reactive_power
from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, Parameter, Variable


class MachineSide(Component):
    """Base of averaged, lossless machine-side converters.

        v_dc i_dc = -P            P: active power taken from the machine;  Q: reactive power delivered to it

    Ports in V and A, in the frame of the machine's terminals. Source: Lyu, Subotic, Gross 2022, II-B, eq. (3):
    P = P_pmsg = -P_msc.
    """

    voltage = Parameter("V", "base V_b of the AC voltage, line-to-line RMS", default=3.3e3, above=0.0)

    machine = AcPort(
        "machine side",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    dc = DcPort("DC link", start={"v": 7920.0}, nominal={"v": 7920.0})
    P = Variable("W", "active power taken from the machine", start=1e6, nominal=1e6)
    Q = Variable("var", "reactive power delivered to the machine", nominal=1e6)

    def equations(self) -> None:
        self.eq(self.P, active_power(self.machine))
        self.eq(self.Q, -reactive_power(self.machine))
        self.eq(self.dc.i, -self.P / self.dc.v)

"""Machine-side converter, averaged."""

from __future__ import annotations

from gustform.conventions import active_power, reactive_power
from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, Input, Parameter, Variable


class MachineSideConverter(Component):
    """Averaged, lossless converter that imposes a voltage on the machine.

        v = V V_b + j0            the frame of the machine side stands on this voltage and turns at omega_msc
        v_dc i_dc = -P            P: active power taken from the machine

    Q is what the converter delivers to the machine. V in pu of V_b; ports in V and A. The reactance that the converter
    works on is that of the machine.
    Source: Lyu, Subotic, Gross 2022, II-B, eq. (3): P = P_pmsg = -P_msc.
    """

    voltage = Parameter("V", "base V_b of the AC voltage, line-to-line RMS", default=3.3e3, above=0.0)

    V = Input("pu", "magnitude of the AC voltage, base V_b", start=1.0)
    machine = AcPort(
        "machine side",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    dc = DcPort("DC link", start={"v": 7920.0}, nominal={"v": 7920.0})
    P = Variable("W", "active power taken from the machine", start=1e6, nominal=1e6)
    Q = Variable("var", "reactive power delivered to the machine", nominal=1e6)

    def equations(self) -> None:
        self.eq(self.machine.vr, self.voltage * self.V)
        self.eq(self.machine.vi, 0)
        self.eq(self.P, active_power(self.machine))
        self.eq(self.Q, -reactive_power(self.machine))
        self.eq(self.dc.i, -self.P / self.dc.v)

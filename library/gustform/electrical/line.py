"""Line as a series impedance."""

from __future__ import annotations

from gustform.interfaces import AcPort
from gustform.language import Component, Parameter


class Line(Component):
    """Short line: a series impedance at nominal frequency, no shunt.

        v_sending - v_receiving = (R + jX) i        i from the sending to the receiving end
        i_sending + i_receiving = 0

    SI units: R, X in ohm per phase. With line-to-line voltages and currents scaled by sqrt(3) the equation keeps
    this form.
    Source: Kundur, Power System Stability and Control, 1994, 6.1 (short line).
    """

    R = Parameter("ohm", "series resistance of one phase", default=0.0436, min=0.0)
    X = Parameter("ohm", "series reactance of one phase at nominal frequency", default=0.871, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage, for start values", default=33e3, above=0.0)

    sending = AcPort(
        "sending end",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    receiving = AcPort(
        "receiving end",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )

    def equations(self) -> None:
        a, b = self.sending, self.receiving
        self.eq(a.ir + b.ir, 0)
        self.eq(a.ii + b.ii, 0)
        self.eq(a.vr - b.vr, self.R * a.ir - self.X * a.ii)
        self.eq(a.vi - b.vi, self.R * a.ii + self.X * a.ir)

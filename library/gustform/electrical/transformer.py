"""Transformer as an ideal ratio with a series impedance."""

from __future__ import annotations

from typing import Any

from gustform.interfaces import AcPort
from gustform.language import Component, Parameter


class Transformer(Component):
    """Two-winding transformer: ideal ratio and series impedance, no magnetising current, no phase shift.

        v_primary V_s/V_p - v_secondary = (r + jx) Z_b i        i = -i_secondary,  out of the secondary side
        V_p i_primary + V_s i_secondary = 0

    r, x in pu of the rating and of the nominal voltage of either side; Z_b = V_s^2 / S_n.
    Source: Kundur, Power System Stability and Control, 1994, 6.2.
    """

    lossless = Parameter("1", "whether the series resistance is left out", default=False, structural=True)
    rating = Parameter("VA", "rated apparent power S_n, base of r and x", default=5e6, above=0.0)
    voltage_primary = Parameter("V", "nominal line-to-line RMS voltage V_p", default=3.3e3, above=0.0)
    voltage_secondary = Parameter("V", "nominal line-to-line RMS voltage V_s", default=33e3, above=0.0)
    r = Parameter("pu", "series resistance, base S_n", default=0.0, min=0.0)
    x = Parameter("pu", "series reactance, base S_n", default=0.06, above=0.0)

    primary = AcPort(
        "primary side",
        start={"vr": lambda self: self.voltage_primary},
        nominal={"vr": lambda self: self.voltage_primary, "vi": lambda self: self.voltage_primary},
    )
    secondary = AcPort(
        "secondary side",
        start={"vr": lambda self: self.voltage_secondary},
        nominal={"vr": lambda self: self.voltage_secondary, "vi": lambda self: self.voltage_secondary},
    )

    def equations(self) -> None:
        p, s = self.primary, self.secondary
        ratio = self.voltage_secondary / self.voltage_primary
        Z_b = self.voltage_secondary * self.voltage_secondary / self.rating
        R, X = (0.0 if self.lossless else self.r * Z_b), self.x * Z_b
        self.eq(p.ir + ratio * s.ir, 0)
        self.eq(p.ii + ratio * s.ii, 0)
        self.branch(ratio, R, X)

    def branch(self, ratio: Any, R: Any, X: Any) -> None:
        """Current and voltage of the series impedance R + jX of the secondary side."""
        p, s = self.primary, self.secondary
        self.eq(ratio * p.vr - s.vr, X * s.ii - R * s.ir)
        self.eq(ratio * p.vi - s.vi, -X * s.ir - R * s.ii)

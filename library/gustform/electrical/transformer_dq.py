"""Transformer with the dynamics of its leakage inductance."""

from __future__ import annotations

from typing import Any

from gustform.conventions import NOMINAL_FREQUENCY, TWO_PI
from gustform.electrical.transformer import Transformer
from gustform.language import Parameter, Variable


class TransformerDq(Transformer):
    """Two-winding transformer whose leakage current is a state.

        x/w0 Z_b d(i)/dt = v_primary V_s/V_p - v_secondary - (r + jx) Z_b i          w0 = 2 pi f0
        i = -i_secondary,          V_p i_primary + V_s i_secondary = 0

    i stands in the phasor frame, whose speed counts as nominal, as everywhere in the phasor network. r, x in pu of the
    rating and of the nominal voltage of either side; Z_b = V_s^2 / S_n.
    Source: Kundur, Power System Stability and Control, 1994, 6.2.
    """

    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)

    i_r = Variable(
        "A", "real part of the current out of the secondary side",
        start=lambda self: 0.5 * self.rating / self.voltage_secondary,
        nominal=lambda self: self.rating / self.voltage_secondary,
    )  # fmt: skip
    i_i = Variable(
        "A", "imaginary part of the current out of the secondary side",
        nominal=lambda self: self.rating / self.voltage_secondary,
    )  # fmt: skip

    def branch(self, ratio: Any, R: Any, X: Any) -> None:
        p, s, w0 = self.primary, self.secondary, TWO_PI * self.f0
        self.eq(self.i_r, -s.ir)
        self.eq(self.i_i, -s.ii)
        self.eq(X / w0 * self.der(self.i_r), ratio * p.vr - s.vr - R * self.i_r + X * self.i_i)
        self.eq(X / w0 * self.der(self.i_i), ratio * p.vi - s.vi - R * self.i_i - X * self.i_r)

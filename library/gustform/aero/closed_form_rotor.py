"""Rotor whose power coefficient is a polynomial: the NREL 5 MW rotor as fitted in the project notes."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import casadi as ca

from gustform.aero.rotor import Rotor
from gustform.language import Parameter, limit, quantity

# Cp/Cp_max = 1 + sum a_ij x^i b^j; row i, column j.
COEFFICIENTS = (
    (0.0, -0.041700792, -1.0116883, 0.25035167),
    (0.0, 1.1182009, -3.5208631, 1.1795875),
    (-1.2451227, 1.8222489, -0.87798351, -0.69166117),
    (2.3810225, -7.9564136, 14.522795, -10.36426),
    (-4.2319617, 15.024635, -23.185559, 7.5504531),
    (3.0500212, -10.000686, 12.020351, 0.30400836),
)
RATIO_RANGE = (0.70, 1.56)  # of lambda/lambda_opt
PITCH_SCALE = 10.0  # deg
PITCH_RANGE = (0.0, 12.0)  # deg


def polynomial(ratio: Any, b: Any) -> Any:
    """Cp/Cp_max of ratio = lambda/lambda_opt and b = beta/10 deg, inside the range of the fit (Horner in both)."""
    x = ratio - 1.0
    value: Any = 0.0
    for row in reversed(COEFFICIENTS):
        column: Any = row[3]
        for a in (row[2], row[1]):
            column = column * b + a
        value = value * x + (column * b + row[0])
    return 1.0 + value


class ClosedFormRotor(Rotor):
    """Rotor with a closed-form, smooth Cp (NREL 5 MW).

        Cp = Cp_max (1 + sum a_ij x^i b^j)      x = lambda/lambda_opt - 1,  b = beta/10 deg

    Valid for 0.70 <= lambda/lambda_opt <= 1.56 and 0 <= beta <= 12 deg. Outside, the arguments are held at the edge:
    Cp is continuous there, its slope is not. SI units, beta in deg.

    Source: project notes to Lyu, Subotic, Gross 2022, Fig. 2; fitted to the NREL 5 MW rotor (Jonkman et al. 2009).
    """

    lambda_opt = Parameter("1", "tip speed ratio of the highest power coefficient", default=7.6857, above=0.0)
    Cp_max = Parameter("1", "highest power coefficient", default=0.4897, above=0.0, max=0.593)

    def equations(self) -> None:
        super().equations()
        ratio = limit(self.tip_speed_ratio / self.lambda_opt, *RATIO_RANGE)
        b = limit(self.beta / quantity(PITCH_SCALE, "deg"), *(edge / PITCH_SCALE for edge in PITCH_RANGE))
        self.eq(self.Cp, self.Cp_max * polynomial(ratio, b))

    def tip_speed_ratio_range(self) -> tuple[float, float]:
        return RATIO_RANGE[0] * self.lambda_opt, RATIO_RANGE[1] * self.lambda_opt

    def pitch_range(self) -> tuple[float, float]:
        return PITCH_RANGE

    def power_coefficient(self) -> Any:
        ratio, beta = ca.SX.sym("lambda"), ca.SX.sym("beta")
        cp = self.Cp_max * polynomial(ratio / self.lambda_opt, beta / PITCH_SCALE)
        return ca.Function("Cp", [ratio, beta], [cp])

    def aerodynamic_key(self) -> Hashable:
        return (type(self), self.lambda_opt, self.Cp_max)

"""Base of all rotors: the power equation. What differs between rotors is the power coefficient Cp."""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any

from gustform.interfaces import Shaft
from gustform.language import Component, Input, Parameter, Variable, maximum

# rho * efficiency * Cp_max = 0.5663 kg/m^3 at rated power (project notes), with rho = 1.225 and Cp_max = 0.4897.
NREL_5MW_EFFICIENCY = 0.5663 / (1.225 * 0.4897)


class Rotor(Component):
    """Wind turbine rotor; a base class, whose subclasses say what Cp is.

        lambda = R omega / v
        P      = efficiency * rho/2 pi R^2 Cp(lambda, beta) v^3
        tau    = -P / omega        torque INTO the rotor at its shaft, so a driving rotor has tau < 0

    SI units; the pitch angle beta in deg, positive to feather. `wind` is the rotor-effective wind speed. `efficiency`
    covers the losses from the rotor to the converter terminals, because the electrical side is lossless.
    Calm or reversed wind counts as `wind_min`, which keeps lambda finite.

    Source: Lyu, Subotic, Gross 2022, eq. (1).
    """

    radius = Parameter("m", "rotor radius R", default=63.0, above=0.0)
    density = Parameter("kg/m^3", "air density rho", default=1.225, above=0.0)
    efficiency = Parameter(
        "1", "share of the rotor power that reaches the converter", default=NREL_5MW_EFFICIENCY, above=0.0, max=1.0
    )
    wind_min = Parameter("m/s", "lowest wind speed that the equations see", default=0.1, above=0.0)

    wind = Input("m/s", "rotor-effective wind speed", start=8.0, nominal=10.0)
    beta = Input("deg", "blade pitch angle, 0 at best power, positive to feather", nominal=10.0)
    shaft = Shaft("rotor hub", start={"w": 1.2}, nominal={"w": 1.0})

    tip_speed_ratio = Variable("1", "tip speed over wind speed, lambda", start=8.0, nominal=10.0)
    Cp = Variable("1", "power coefficient", start=0.4, nominal=0.5)
    P = Variable("W", "power taken from the wind, losses to the converter left out", start=1e6, nominal=1e6)

    def equations(self) -> None:
        v = maximum(self.wind, self.wind_min)
        R = self.radius
        self.eq(self.tip_speed_ratio, R * self.shaft.w / v)
        self.eq(self.P, 0.5 * math.pi * self.efficiency * self.density * R * R * self.Cp * (v * v * v))
        self.eq(self.shaft.tau, -self.P / self.shaft.w)

    # ---- numbers, for operating points ------------------------------------------------------------------------------
    def tip_speed_ratio_range(self) -> tuple[float, float]:
        """Tip speed ratios for which Cp is known; it is held constant outside."""
        raise NotImplementedError

    def pitch_range(self) -> tuple[float, float]:
        """Pitch angles, deg, for which Cp is known; it is held constant outside."""
        raise NotImplementedError

    def power_coefficient(self) -> Any:
        """A CasADi function (lambda, beta in deg) -> Cp of the numbers of this rotor."""
        raise NotImplementedError

    def power_per_cube(self) -> float:
        """P / (Cp v^3) in W s^3/m^3."""
        return float(0.5 * math.pi * self.efficiency * self.density * self.radius**2)

    def aerodynamic_key(self) -> Hashable:
        """Equal keys mean equal power_coefficient(), so that what is computed from it can be kept."""
        raise NotImplementedError

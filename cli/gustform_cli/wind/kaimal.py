"""The Kaimal spectrum and the normal turbulence model of IEC 61400-1 (ed. 3, 6.3.1.3 and annex B.2).

S(f) = 4 sigma^2 (L/U) / (1 + 6 f L/U)^(5/3)        one-sided, (m/s)^2/Hz
sigma_1 = I_ref (0.75 U + 5.6 m/s)                   I_ref = 0.16 (A), 0.14 (B), 0.12 (C); 90 % quantile
E(sigma_1) = I_ref (0.75 U + 3.8 m/s)                the mean of the same distribution
L_1 = 8.1 Lambda_1,  Lambda_1 = 0.7 z below 60 m, 42 m above
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

REFERENCE_INTENSITY = {"A": 0.16, "B": 0.14, "C": 0.12}


def standard_deviation(turbulence_class: str, mean: float, level: str = "quantile_90") -> float:
    """sigma_1, m/s, of the longitudinal wind at hub height for mean wind `mean`, m/s: the 90 % quantile that loads are
    calculated for, or the mean that energy is."""
    return REFERENCE_INTENSITY[turbulence_class] * (0.75 * mean + (5.6 if level == "quantile_90" else 3.8))


def length_scale(hub_height: float) -> float:
    """L_1, m, the integral length scale of the longitudinal component at `hub_height`, m."""
    return 8.1 * min(0.7 * hub_height, 42.0)


@dataclass(frozen=True)
class Kaimal:
    """Spectrum of the wind at one point: mean m/s, sigma m/s, length scale m."""

    mean: float
    sigma: float
    length: float

    def density(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """S(f), (m/s)^2/Hz, at f in Hz."""
        time = self.length / self.mean
        result: NDArray[np.float64] = 4.0 * self.sigma**2 * time / (1.0 + 6.0 * frequency * time) ** (5.0 / 3.0)
        return result

    def variance_below(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Integral of S from 0 to f, (m/s)^2: sigma^2 (1 - (1 + 6 f L/U)^(-2/3))."""
        time = self.length / self.mean
        result: NDArray[np.float64] = self.sigma**2 * (1.0 - (1.0 + 6.0 * frequency * time) ** (-2.0 / 3.0))
        return result

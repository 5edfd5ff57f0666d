"""Winds that are given by a formula: steps, ramps and the gusts of IEC 61400-1.

Extreme operating gust, EOG (IEC 61400-1 ed. 3:2005, 6.3.2.2), for 0 <= t <= T = 10.5 s at hub height:

    V(t) = V_hub - 0.37 V_gust sin(3 pi t / T) (1 - cos(2 pi t / T))
    V_gust = min(1.35 (V_e1 - V_hub), 3.3 sigma_1 / (1 + 0.1 D / Lambda_1))
    V_e1 = 0.8 V_e50 = 0.8 * 1.4 V_ref,      V_ref = 50 (I), 42.5 (II), 37.5 m/s (III)
    sigma_1 = I_ref (0.75 V_hub + 5.6 m/s),  Lambda_1 = 0.7 z below 60 m, 42 m above

Extreme coherent gust, ECG (ed. 2:1999, 6.3.2.3; in ed. 3 the speed of the gust with direction change, ECD, 6.3.2.5),
T = 10 s, V_cg = 15 m/s, and V_hub + V_cg after it:

    V(t) = V_hub + 0.5 V_cg (1 - cos(pi t / T))

D rotor diameter m, z hub height m. Both gusts take the whole rotor at once; the direction stays.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gustform_cli.wind.kaimal import standard_deviation

REFERENCE_SPEED = {"I": 50.0, "II": 42.5, "III": 37.5}  # m/s
EOG_SECONDS, ECG_SECONDS = 10.5, 10.0
COHERENT_GUST = 15.0  # m/s
_STEP = 0.01  # s; linear interpolation is then within 2e-4 m/s


def eog_amplitude(mean: float, turbine_class: str, turbulence_class: str, hub_height: float, diameter: float) -> float:
    """V_gust of the extreme operating gust, m/s; at most 0 where the mean is above V_e1."""
    extreme = 0.8 * 1.4 * REFERENCE_SPEED[turbine_class]
    scale = min(0.7 * hub_height, 42.0)
    turbulent = 3.3 * standard_deviation(turbulence_class, mean) / (1.0 + 0.1 * diameter / scale)
    return min(1.35 * (extreme - mean), turbulent)


def eog(mean: float, amplitude: float, begin: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times s and speeds m/s of an extreme operating gust that begins at `begin`, s."""
    t = _grid(EOG_SECONDS)
    turn = math.pi * t / EOG_SECONDS
    speeds = mean - 0.37 * amplitude * np.sin(3.0 * turn) * (1.0 - np.cos(2.0 * turn))
    return _from_zero(begin, t, speeds)


def ecg(mean: float, amplitude: float, begin: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times s and speeds m/s of an extreme coherent gust that begins at `begin`, s."""
    t = _grid(ECG_SECONDS)
    return _from_zero(begin, t, mean + 0.5 * amplitude * (1.0 - np.cos(math.pi * t / ECG_SECONDS)))


def ramp(before: float, after: float, begin: float, duration: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times s and speeds m/s of a straight line between two speeds."""
    return _from_zero(begin, np.array([0.0, duration]), np.array([before, after]))


def _grid(seconds: float) -> NDArray[np.float64]:
    return np.linspace(0.0, seconds, round(seconds / _STEP) + 1)


def _from_zero(
    begin: float, t: NDArray[np.float64], speeds: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if begin <= 0.0:
        return t + begin, speeds
    return np.concatenate(([0.0], begin + t)), np.concatenate((speeds[:1], speeds))

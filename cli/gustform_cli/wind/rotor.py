"""From the wind at a point to the wind a whole rotor feels.

Eddies smaller than the rotor average out over it. As a linear filter of the point wind (an admittance of the rotor):

    H(s) = (sqrt(2) + b s) / ((sqrt(2) + b sqrt(a) s) (1 + b s / sqrt(a))),   a = 0.55,  b = 1.3 R / U

R rotor radius m, U mean wind m/s. H(0) = 1, so the mean and slow changes pass unchanged.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def rotor_effective(frequency: NDArray[np.float64], radius: float, mean: float) -> NDArray[np.complex128]:
    """H(j 2 pi f) for f in Hz."""
    a, b = 0.55, 1.3 * radius / mean
    s = 2j * math.pi * frequency
    result: NDArray[np.complex128] = (math.sqrt(2.0) + b * s) / (
        (math.sqrt(2.0) + b * math.sqrt(a) * s) * (1.0 + b * s / math.sqrt(a))
    )
    return result

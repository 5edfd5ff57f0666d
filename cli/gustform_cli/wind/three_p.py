"""The wind that blades meet on their way round: rotational sampling at three times the speed of the rotor.

    v_3P(t) = v(t) (1 + A sin(2 pi 3 n t))

Tower shadow and shear make a blade feel less wind at the bottom of its way; with three blades the torque has a
component of three times the rotor's frequency (D. S. L. Dolan, P. W. Lehn, Simulation model of wind turbine 3p torque
oscillations due to wind shear and tower shadow, IEEE Trans. Energy Conv. 21 (2006)). Here it is carried by the wind,
with an amplitude A relative to it. The rotor's speed n is one constant, since a series knows nothing of the turbine
that it drives: a stand-in for studies of how such a component passes to the grid, not for its exact phase.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.wind.rotor import Reader

BLADES = 3
_SAMPLES = 8  # per period, at least


class BladeWind:
    """The wind of `reader` with a 3P component: relative amplitude, speed of the rotor in rad/s."""

    def __init__(self, reader: Reader, amplitude: float, rotor_speed: float) -> None:
        self._reader, self._amplitude, self._pulsation = reader, amplitude, BLADES * rotor_speed

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end."""
        times, speeds = self._reader(first, count)
        return times, speeds * (1.0 + self._amplitude * np.sin(self._pulsation * times))


def check_spacing(name: str, spacing: float, rotor_speed: float) -> None:
    """GF2513 if samples at this distance, s, cannot carry the component."""
    longest = 2.0 * math.pi / (BLADES * rotor_speed) / _SAMPLES
    if spacing > longest * (1.0 + 1e-9):
        raise GustformError(
            "GF2513",
            f"{name}.three_p needs samples every {longest:.3g} s or closer ({_SAMPLES} a period of 3P); "
            f"they are {spacing:g} s apart",
            hint="leaving three_p out",
        )

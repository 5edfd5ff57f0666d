"""Sign conventions and constants that every component shares; the page with examples is docs/conventions.md.

* Flows are positive INTO the component that declares the port. What a unit delivers has a minus sign at its port.
* AC phasors: v line-to-line RMS, i scaled so that S = v conj(i) is the three-phase power; P = vr ir + vi ii,
  Q = vi ir - vr ii. Q > 0 into a component means that it is inductive.
* Phasors stand in a frame that turns at the signal `frame`, pu of the nominal frequency; angles are measured against
  it: d(angle)/dt = w0 (omega - frame).
* Per unit stays inside a component or a unit. Its base is named where it is declared. Electrical speed and frequency
  have the base w0 = 2 pi f0.
"""

from __future__ import annotations

import math
from typing import Any

NOMINAL_FREQUENCY = 50.0  # Hz, default of every unit that has an AC terminal and needs it
TWO_PI = 2.0 * math.pi


def active_power(port: Any) -> Any:
    """P into the component at an AcPort, W."""
    return port.vr * port.ir + port.vi * port.ii


def reactive_power(port: Any) -> Any:
    """Q into the component at an AcPort, var."""
    return port.vi * port.ir - port.vr * port.ii


def magnitude(real: Any, imaginary: Any) -> Any:
    """Length of a phasor."""
    return (real * real + imaginary * imaginary) ** 0.5

"""The limits of a turbine, and when it stands at one: as samples of a channel beyond a threshold.

| limit | at it |
|---|---|
| omega_max | rotor speed above omega_max - 0.001 pu |
| P_max | filtered power, which the power limiter acts on, above P_max - 0.001 pu |
| beta_min | pitch angle below beta_min + 0.01 deg |
| beta_max | pitch angle above beta_max - 0.01 deg |
| pitch_rate | pitch rate beyond 99.9 % of rate_max, either way |

A soft limiter, as those of speed and power, is passed for a while before it has acted: that counts as well.
"""

from __future__ import annotations

from dataclasses import dataclass

from gustform.turbines.pmsg_turbine import PmsgTurbine

SPEED_TOLERANCE = 1e-3  # pu
POWER_TOLERANCE = 1e-3  # pu
ANGLE_TOLERANCE = 1e-2  # deg
RATE_SHARE = 0.999
_FAR = 1e300  # where no sample is


@dataclass(frozen=True)
class Limit:
    """A limit of one turbine: at it are the samples of `channel` below `low` or above `high`."""

    name: str
    channel: str
    unit: str
    low: float = -_FAR
    high: float = _FAR

    @property
    def edges(self) -> tuple[float, float]:
        """Of a histogram with one bin, outside of which lies what stands at the limit."""
        return self.low, self.high

    @property
    def condition(self) -> str:
        """The limit as a sentence."""
        below = f"below {self.low:.6g} {self.unit}" if self.low > -_FAR else ""
        above = f"above {self.high:.6g} {self.unit}" if self.high < _FAR else ""
        return f"{self.channel} {' or '.join(part for part in (below, above) if part)}"


def turbine_limits(name: str, turbine: PmsgTurbine) -> list[Limit]:
    """The limits of the turbine that stands in the system under `name`."""
    pitch = turbine.pitch
    rate = RATE_SHARE * float(pitch.servo.rate_max)
    return [
        Limit("omega_max", f"{name}.omega_r", "pu", high=float(pitch.omega_max) - SPEED_TOLERANCE),
        Limit("P_max", f"{name}.pitch.P_filtered", "pu", high=float(pitch.P_max) - POWER_TOLERANCE),
        Limit("beta_min", f"{name}.beta", "deg", low=float(pitch.beta_min) + ANGLE_TOLERANCE),
        Limit("beta_max", f"{name}.beta", "deg", high=float(pitch.beta_max) - ANGLE_TOLERANCE),
        Limit("pitch_rate", f"{name}.pitch.servo.rate", "deg/s", low=-rate, high=rate),
    ]

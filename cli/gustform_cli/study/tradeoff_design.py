"""What the trade-off study varies: a Latin hypercube over curtailment and gains of dual-port control.

    curtailment     0 ... 20 %                       power held back, 1 - eta
    K_msc, factor   0.1 ... 2, logarithmic           on the largest K_msc that keeps the rotor above the MPP, eq. (19)
    K_p, factor     0 ... 2                          on the largest K_p that keeps the pitch demand above 0, eq. (20)
    K_gsc           0.25 ... 1 pu, logarithmic       the largest K_msc below rated wind goes with it
    K_d_gsc         0.002 ... 0.03 s, logarithmic    K_d_msc = K_d_gsc K_msc/K_gsc, the theorem's condition
    T_dc            0.02 ... 0.7, logarithmic        share of K_d/K_gsc, at which the filter takes the damping away
    speed margin    0 ... 0.12 pu                    from the highest operating speed to the speed limiter's

The largest gains follow from each wind speed's operating point (control.operating_point), so that a design is one
rule for all wind speeds. Beside the sampled ones stand the source paper's two: with frequency response and at maximum
power. McKay, Beckman, Conover 1979, for the hypercube; scipy.stats.qmc.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gustform.control.dual_port import DualPort
from gustform.control.operating_point import DualPortGains, dual_port_gains, operating_point
from gustform.turbines.pmsg_turbine import PmsgTurbine

# Lowest and highest value, and whether equal shares of each decade are sampled.
RANGES = {
    "curtailment": (0.0, 0.2, False),
    "K_msc_factor": (0.1, 2.0, True),
    "K_p_factor": (0.0, 2.0, False),
    "K_gsc": (0.25, 1.0, True),
    "K_d_gsc": (0.002, 0.03, True),
    "T_dc_share": (0.02, 0.7, True),
    "speed_margin": (0.0, 0.12, False),
}
_DIGITS = 6  # of a sampled value, so that it can be typed again


@dataclass(frozen=True)
class Design:
    """One choice of curtailment and gains. `K_gsc` and `speed_margin` in pu, `K_d_gsc` in s, `T_dc_share` of
    K_d_gsc/K_gsc."""

    name: str
    curtailment: float
    K_msc_factor: float
    K_p_factor: float
    K_gsc: float
    K_d_gsc: float
    T_dc_share: float
    speed_margin: float

    @property
    def T_dc(self) -> float:
        """Time constant of the filters of the DC voltage, s."""
        return self.T_dc_share * self.K_d_gsc / self.K_gsc

    def gains(self, wind: float) -> DualPortGains:
        """K_msc in pu and K_p in deg/pu at a wind speed, m/s. GF2020 to GF2023 where there is no operating point."""
        turbine = PmsgTurbine()
        control = turbine.control
        assert isinstance(control, DualPort)
        point = operating_point(turbine.rotor, wind, self.curtailment, turbine.limits())
        largest = dual_port_gains(point, self.K_gsc, control.frequency_reserve)
        return DualPortGains(self.K_msc_factor * largest.K_msc, self.K_p_factor * largest.K_p, float("nan"))

    def values(self, wind: float) -> Mapping[str, Any]:
        """What a scenario sets for it, by path."""
        gains = self.gains(wind)
        return {
            "wt.curtailment": self.curtailment,
            "wt.K_msc": float(f"{gains.K_msc:.9g}"),
            "wt.K_p": f"{gains.K_p:.9g} deg",
            "wt.control.K_gsc": self.K_gsc,
            "wt.control.K_d_gsc": f"{self.K_d_gsc:.9g} s",
            "wt.control.T_dc": f"{self.T_dc:.9g} s",
            "wt.pitch.omega_max": PmsgTurbine().omega_max + self.speed_margin,
        }


# The source paper's gains: largest K_msc and K_p, K_gsc = 0.5, K_d = 0.0067 s, one limit of the speed; T_dc = 2 ms is
# that of the project notes.
_PAPER = {
    "K_msc_factor": 1.0, "K_p_factor": 1.0, "K_gsc": 0.5, "K_d_gsc": 0.0067, "T_dc_share": 0.002 * 0.5 / 0.0067,
    "speed_margin": 0.0,
}  # fmt: skip
FR = Design("GFM FR", 0.1, **_PAPER)
MPPT = Design("GFM MPPT", 0.0, **_PAPER)
PAPER = (FR, MPPT)


def designs(n: int, seed: int) -> tuple[Design, ...]:
    """The paper's two designs and n sampled ones."""
    from scipy.stats import qmc  # 0.5 s of imports

    cube = qmc.LatinHypercube(len(RANGES), rng=seed).random(n)
    found = []
    for number, row in enumerate(cube, start=1):
        values = {}
        for share, (name, (low, high, logarithmic)) in zip(row, RANGES.items(), strict=True):
            value = low * (high / low) ** share if logarithmic else low + (high - low) * share
            values[name] = float(f"{value:.{_DIGITS}g}")
        found.append(Design(f"design {number}", **values))
    return (*PAPER, *found)

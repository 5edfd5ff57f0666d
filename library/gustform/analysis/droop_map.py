"""The smallest droop that a turbine can have, over wind speed and curtailment.

At each point the gains are the largest that the steady state allows for a frequency deviation Delta_omega: K_msc first,
which gives the inertia of the rotor, then K_p. What is left is what the wind offers:

    m_p = Delta_omega/((1 - eta) P_mpp)                             below rated wind: all of the reserve
    m_p = Delta_omega (beta_del - beta_mpp)/((1 - eta) beta_del)    above: K_p keeps beta_ref >= 0, not >= beta_mpp

K_gsc cancels, and so does K_msc above rated wind. Just below rated wind K_msc is held at K_gsc (`dual_port_gains`),
which lowers m_p there by what the speed still gives. Above rated wind the droop ends at rated power: the power limiter
of the pitch control takes over once the reserve is used up.
m_p in pu of frequency over pu of the turbine's rating. Source: Lyu, Subotic, Gross 2022, V-B, eqs. (17)-(20), Fig. 8.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gustform.aero.rotor import Rotor
from gustform.control.curtailment_table import Infeasible
from gustform.control.operating_point import Limits, dual_port_gains, operating_point
from gustform.language.errors import GustformError

FREQUENCY_RESERVE = 0.005  # pu, the paper's for this figure
_K_GSC = 0.5  # cancels


@dataclass(frozen=True, eq=False)
class DroopMap:
    """m_p[j, i] (pu; nan where there is no operating point, inf without a reserve) at eta[j] and wind[i] (m/s)."""

    frequency_reserve: float
    rated_wind: float
    wind: tuple[float, ...]
    eta: tuple[float, ...]
    m_p: NDArray[np.float64]
    infeasible: tuple[Infeasible, ...]

    def percent(self) -> list[list[float | None]]:
        """m_p in per cent, a row for each eta; None where there is none."""
        return [[100.0 * float(v) if np.isfinite(v) else None for v in row] for row in self.m_p]


def droop_map(
    rotor: Rotor,
    limits: Limits,
    winds: Sequence[float],
    etas: Sequence[float],
    frequency_reserve: float = FREQUENCY_RESERVE,
    progress: Callable[[int, int], None] | None = None,
) -> DroopMap:
    """The map on a grid; `progress` is called with the rows done and their number."""
    m_p = np.full((len(etas), len(winds)), np.nan)
    infeasible = []
    rated = np.nan
    for j, eta in enumerate(etas):
        for i, wind in enumerate(winds):
            try:
                point = operating_point(rotor, wind, round(1.0 - eta, 12), limits)
            except GustformError as error:
                infeasible.append(Infeasible(wind, eta, error.code, error.message))
                continue
            m_p[j, i] = dual_port_gains(point, _K_GSC, frequency_reserve).m_p
            rated = point.rated_wind
        if progress is not None:
            progress(j + 1, len(etas))
    if len(infeasible) == m_p.size > 0:
        raise GustformError("GF2041", f"no place of the map has an operating point; the first: {infeasible[0].reason}")
    m_p.setflags(write=False)
    return DroopMap(frequency_reserve, float(rated), tuple(winds), tuple(etas), m_p, tuple(infeasible))

"""Curtailed operating points over wind speed and eta, solved offline: the look-up table of the curtailment strategy.

The equations are those of `control.operating_point`. The grid is solved by Ipopt, one row of constant eta at a time and
with the bounds of the rotor's known Cp. A row starts from the one before, with less curtailment; what has no neighbour
there is bracketed by a scan first.

Where no operating point exists, the table holds on to the nearest one that does: at the same wind the one with the most
curtailment that can be reached, at a wind where none exists the row of the nearest wind. So whatever is looked up is
an operating point within all limits, but at such a place it holds back less than was asked for; `feasible` is False
there, and `infeasible` has the reason.

The table is continuous in the wind, through rated wind too, except for one step of beta_del: where the speed reaches
omega_max and Cp rises with pitch before it falls, the pitch steps over the rise (from 0 to 2.1 deg at 8.29 m/s for
eta = 0.9 of the NREL 5 MW rotor). The power is the same on both sides of the step.

Source: Lyu, Subotic, Gross 2022, IV-B, Fig. 4; readings: project notes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.aero.cp_solver import CpSolver, cp_solver
from gustform.aero.rotor import Rotor
from gustform.control.operating_point import (
    ROUND_OFF,
    Limits,
    outside_curtailment,
    outside_wind,
    pitch_too_low,
    speed_too_low,
)
from gustform.language.errors import GustformError

Array = NDArray[np.float64]

# C99 guarantees 63 significant characters of a name; the longest suffix takes 12 of them.
_C_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,47}")


@dataclass(frozen=True)
class Infeasible:
    """A place of the grid without an operating point, and why: the code and message of the error it would raise."""

    wind: float
    eta: float
    code: str
    reason: str


@dataclass(frozen=True, eq=False)
class CurtailmentTable:
    """omega_del[i, j] (pu of omega_base) and beta_del[i, j] (deg) at wind[i] (m/s) and eta[j], the share of the
    available power that is delivered; above rated wind, of the rated power. Both grids increase.

    omega_free is omega_del before omega_max limits it. It has no bend there, so it is the one to interpolate:
    omega_del = min(omega_free, omega_max).
    """

    rotor: str
    limits: Limits
    rated_wind: float
    wind: Array
    eta: Array
    omega_del: Array
    omega_free: Array
    beta_del: Array
    feasible: NDArray[np.bool_]
    infeasible: tuple[Infeasible, ...]

    def write_c(self, file: str | Path, name: str) -> Path:
        """Write the table as C99: constant arrays and sizes whose names begin with `name`. GF2042, GF2043."""
        if not _C_NAME.fullmatch(name):
            raise GustformError(
                "GF2042", f"a table in C needs a name that C takes; got {name!r}", hint="curtailment or nrel_5mw"
            )
        path = Path(file)
        try:
            path.write_text(_c_text(self, name), encoding="ascii", newline="\n")
        except OSError as failure:
            raise GustformError(
                "GF2043", f"the table {str(path)!r} cannot be written: {failure.strerror}", hint="another folder"
            ) from None
        return path


def curtailment_table(rotor: Rotor, limits: Limits, winds: Sequence[float], etas: Sequence[float]) -> CurtailmentTable:
    """Solve the grid. Places without an operating point are listed in `infeasible`; GF2041 if nothing else is left.

    GF2040: the grids must increase and have finite values; GF2021: eta must be above 0 and at most 1.
    """
    wind, eta = _grid(winds, "winds"), _grid(etas, "etas")
    for value in eta:
        error = outside_curtailment(1.0 - float(value))
        if error is not None:
            raise error
    return _solved(
        cp_solver(rotor), float(rotor.radius), rotor.power_per_cube(), limits, tuple(wind.tolist()), tuple(eta.tolist())
    )


def _grid(values: Sequence[float], label: str) -> Array:
    grid = np.asarray(values, dtype=np.float64)
    if grid.ndim != 1 or not grid.size or not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0.0):
        shown = ", ".join(f"{value:g}" for value in grid.ravel()[:6])
        raise GustformError("GF2040", f"{label} must be finite numbers that increase; got [{shown}]", hint="3, 4, 5")
    return grid


@lru_cache(maxsize=64)
def _solved(
    aero: CpSolver,
    radius: float,
    per_cube: float,
    limits: Limits,
    winds: tuple[float, ...],
    etas: tuple[float, ...],
) -> CurtailmentTable:
    wind, eta = np.array(winds), np.array(etas)
    beta_min = max(limits.beta_min, aero.pitches[0])
    lambda_mpp = aero.mpp(beta_min)
    cp_max = aero.value(lambda_mpp, beta_min)
    to_ratio = radius * limits.omega_base / wind  # tip speed ratio of 1 pu speed
    to_power = per_cube * wind**3 / limits.rating  # power, pu, of Cp = 1
    available = np.minimum(to_power * cp_max, 1.0)

    reasons: dict[tuple[int, int], GustformError] = {}
    for i, value in enumerate(winds):
        error = outside_wind(value, limits)
        if error is not None:
            reasons |= {(i, j): error for j in range(eta.size)}
    running = np.array([(i, 0) not in reasons for i in range(wind.size)])
    free = np.full((wind.size, eta.size), np.nan)
    beta = np.full((wind.size, eta.size), np.nan)
    near = np.full(wind.size, np.nan)
    too_little = np.zeros(wind.size, dtype=bool)  # pitch: what is impossible stays so with more curtailment
    for j in reversed(range(eta.size)):
        share = etas[j]
        # speed: one tip speed ratio for all winds
        ratio = aero.falling_ratio(beta_min, share * cp_max) if share < 1.0 else lambda_mpp
        at_will = (aero.ratios[1] if ratio is None else ratio) / to_ratio
        row = np.minimum(at_will, limits.omega_max)
        known = running.copy()
        if ratio is None:
            # speed that is not at its limit would have to go beyond the known Cp
            lost = running & (limits.omega_max * to_ratio > aero.ratios[1])
            known &= ~lost
            for i in np.flatnonzero(lost).tolist():
                reasons[i, j] = speed_too_low(aero, winds[i], 1.0 - share, beta_min)
        # pitch: what the speed leaves over
        target = share * available
        ratios = np.clip(row * to_ratio, *aero.ratios)
        surplus = to_power * aero.values(ratios, np.full(wind.size, beta_min)) > target * (1.0 + ROUND_OFF)
        angle = np.where(known, beta_min, np.nan)
        angle[too_little] = np.nan
        pitching = np.flatnonzero(known & surplus & ~too_little)
        if pitching.size:
            aims = (target / to_power)[pitching]
            angle[pitching] = aero.falling_pitches(ratios[pitching], aims, beta_min, near[pitching])
        for i in np.flatnonzero(known & np.isnan(angle)).tolist():
            least = to_power[i] * aero.value(float(ratios[i]), aero.pitches[1])
            reasons[i, j] = pitch_too_low(aero, winds[i], 1.0 - share, least, float(target[i]))
            too_little[i] = True
        near = np.where(angle > beta_min, angle, np.nan)
        free[:, j], beta[:, j] = np.where(np.isnan(angle), np.nan, at_will), angle

    feasible = ~np.isnan(beta)
    if not feasible.any():
        first = next(iter(reasons.values()))
        raise GustformError("GF2041", f"no place of the grid has an operating point; the first: {first.message}")
    free, beta = _extended(free, feasible), _extended(beta, feasible)
    omega = np.minimum(free, limits.omega_max)
    for array in (wind, eta, omega, free, beta, feasible):
        array.setflags(write=False)  # one table is shared by all who ask for it
    return CurtailmentTable(
        rotor=aero.name,
        limits=limits,
        rated_wind=float((limits.rating / (per_cube * cp_max)) ** (1.0 / 3.0)),
        wind=wind,
        eta=eta,
        omega_del=omega,
        omega_free=free,
        beta_del=beta,
        feasible=feasible,
        infeasible=tuple(
            Infeasible(winds[i], etas[j], error.code, error.message)
            for (i, j), error in sorted(reasons.items(), key=_at)
        ),
    )


def _at(item: tuple[tuple[int, int], GustformError]) -> tuple[int, int]:
    return item[0]


def _extended(values: Array, feasible: NDArray[np.bool_]) -> Array:
    """Places without a value take that of the next higher eta that has one; rows without any, the nearest row."""
    result = values.copy()
    for j in reversed(range(result.shape[1] - 1)):
        result[:, j] = np.where(np.isnan(result[:, j]), result[:, j + 1], result[:, j])
    # Less curtailment is possible wherever more is, so only whole rows are empty now.
    rows = np.flatnonzero(feasible.any(axis=1))
    for i in np.flatnonzero(~feasible.any(axis=1)).tolist():
        result[i] = result[rows[np.argmin(np.abs(rows - i))]]
    return result


# ---- C --------------------------------------------------------------------------------------------------------------
def _c_text(table: CurtailmentTable, name: str) -> str:
    t, limits = table, table.limits
    n, m = t.wind.size, t.eta.size
    missing = int(np.sum(~t.feasible))
    return f"""/* Curtailed operating points of a wind turbine ({t.rotor}), solved offline by gustform.
 *
 * Over the wind speed {name}_wind[i], m/s, and {name}_eta[j], the share of the available power that is delivered
 * (above rated wind, {t.rated_wind:.4f} m/s, of the rated power), both increasing:
 *     {name}_omega_del[i][j]   rotor speed, pu of {limits.omega_base!r} rad/s, at most {limits.omega_max:g}
 *     {name}_beta_del[i][j]    pitch angle, deg, at least {limits.beta_min:g}
 *     {name}_feasible[i][j]    1: solved; 0: no such point ({missing} of {n * m}), its neighbour's values stand there
 * Rated power {limits.rating!r} W; in operation from {limits.cut_in:g} to {limits.cut_out:g} m/s.
 * C99. Include this file, or compile it and declare the arrays extern.
 */

enum {{ {name}_winds = {n}, {name}_etas = {m} }};

const double {name}_wind[{n}] = {{
{_c_row(t.wind)}
}};

const double {name}_eta[{m}] = {{
{_c_row(t.eta)}
}};

const double {name}_omega_del[{n}][{m}] = {{
{_c_rows(t.omega_del)}
}};

const double {name}_beta_del[{n}][{m}] = {{
{_c_rows(t.beta_del)}
}};

const unsigned char {name}_feasible[{n}][{m}] = {{
{_c_rows(t.feasible.astype(np.int64))}
}};
"""


def _c_rows(values: NDArray[np.generic]) -> str:
    return ",\n".join(f"    {{\n{_c_row(row, 8)}\n    }}" for row in values)


def _c_row(values: NDArray[np.generic], indent: int = 4) -> str:
    words = [repr(value.item()) for value in values]  # the shortest decimal that gives the same double back
    lines, line = [], ""
    for word in words:
        if line and len(line) + len(word) + indent + 2 > 110:
            lines.append(line)
            line = ""
        line += f"{', ' if line else ''}{word}"
    return ",\n".join(" " * indent + one for one in [*lines, line])

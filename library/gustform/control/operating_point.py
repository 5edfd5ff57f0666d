"""Curtailed operating points of a turbine and the control gains that follow from them.

Rotor speed first, pitch second: power is held back by turning faster than at the maximum power point (MPP), and only
what the speed limit leaves over by pitching. Above rated wind, eta means eta times the rated power.

    lambda_mpp = argmax Cp(lambda, beta_min)
    Cp(lambda_del, beta_min) = eta Cp(lambda_mpp, beta_min),  lambda_del >= lambda_mpp
    omega_del  = min(lambda_del v / R, omega_max)
    P(omega_del, beta_del) = eta min(P_mpp, P_rated)          upper root in beta, on the falling side

Each of these is a bounded problem in one variable, solved by Ipopt on the rotor's own Cp (`aero.cp_solver`). A whole
grid of them is solved, warm-started, by `control.curtailment_table`.
Source: Lyu, Subotic, Gross 2022, IV-B, eqs. (5), (6); V-B; readings: project notes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

from gustform.aero.cp_solver import CpSolver, cp_solver, inside
from gustform.aero.rotor import Rotor
from gustform.language.errors import GustformError

ROUND_OFF = 1e-12  # relative


@dataclass(frozen=True)
class Limits:
    """What bounds the operation of a turbine: pu of rating (W) and of omega_base (rad/s); pitch in deg; wind in m/s."""

    rating: float
    omega_base: float
    omega_max: float
    beta_min: float
    cut_in: float
    cut_out: float


@dataclass(frozen=True)
class OperatingPoint:
    """Where a turbine works in constant wind: speeds and power in pu of its bases, pitch in deg.

    `mpp` without curtailment, `del` with it. K_wr, K_beta: loss of power for speed (pu/pu) and for pitch (pu/deg),
    as secants from the MPP.
    """

    wind: float
    eta: float
    rated_wind: float
    lambda_mpp: float
    omega_mpp: float
    omega_del: float
    beta_mpp: float
    beta_del: float
    power: float
    K_wr: float
    K_beta: float


@dataclass(frozen=True)
class DualPortGains:
    """Gains of dual-port control: K_msc in pu, K_p in deg/pu; m_p is the droop they give (inf: none)."""

    K_msc: float
    K_p: float
    m_p: float


def operating_point(rotor: Rotor, wind: float, curtailment: float, limits: Limits) -> OperatingPoint:
    """The operating point of a rotor in constant wind, `curtailment` = 1 - eta held back.

    Raises GF2020 (wind outside cut-in ... cut-out), GF2021 (curtailment outside 0 ... 1), GF2022 (speed cannot hold
    back so much within the known Cp), GF2023 (pitch cannot), GF2025 (beta_min outside the known Cp), each naming the
    limit.
    """
    return _operating_point(
        cp_solver(rotor), float(rotor.radius), rotor.power_per_cube(), float(wind), float(curtailment), limits
    )


def power_at(rotor: Rotor, wind: float, omega: float, beta: float, limits: Limits) -> float:
    """Power, pu, at a wind speed (m/s), rotor speed (pu) and pitch angle (deg)."""
    ratio = rotor.radius * limits.omega_base * omega / wind
    return float(rotor.power_per_cube() * wind**3 * cp_solver(rotor).value(ratio, beta) / limits.rating)


def power_slopes(rotor: Rotor, wind: float, omega: float, beta: float, limits: Limits) -> tuple[float, float]:
    """-dP/d(omega) (pu/pu) and -dP/d(beta) (pu/deg) at a point: what K_wr and K_beta are as tangents."""
    to_ratio = rotor.radius * limits.omega_base / wind
    by_ratio, by_pitch = cp_solver(rotor).slopes(omega * to_ratio, beta)
    to_power = rotor.power_per_cube() * wind**3 / limits.rating
    return -to_power * by_ratio * to_ratio, -to_power * by_pitch


# ---- what cannot be ------------------------------------------------------------------------------------------------
def outside_wind(wind: float, limits: Limits) -> GustformError | None:
    """GF2020 where the turbine does not run."""
    if limits.cut_in <= wind <= limits.cut_out:
        return None
    return GustformError(
        "GF2020",
        f"no operating point at a wind speed of {wind:g} m/s: the turbine runs from cut-in "
        f"at {limits.cut_in:g} m/s to cut-out at {limits.cut_out:g} m/s",
        hint=f"a wind speed from {limits.cut_in:g} to {limits.cut_out:g} m/s",
    )


def outside_curtailment(curtailment: float) -> GustformError | None:
    """GF2021 where the curtailment is no share of the power."""
    if 0.0 <= curtailment < 1.0:
        return None
    return GustformError(
        "GF2021",
        f"curtailment must be at least 0 and below 1 (share of the power held back); got {curtailment:g}",
        hint="0.1",
    )


def speed_too_low(aero: CpSolver, wind: float, curtailment: float, beta_min: float) -> GustformError:
    """GF2022: speed alone cannot hold back so much within the known Cp."""
    most = 1.0 - aero.value(aero.ratios[1], beta_min) / aero.value(aero.mpp(beta_min), beta_min)
    return GustformError(
        "GF2022",
        f"no operating point at {wind:g} m/s with curtailment {curtailment:g}: at the highest tip speed ratio "
        f"for which Cp of {aero.name} is known, {aero.ratios[1]:.2f}, speed holds back {most:.3f}",
        hint=f"a curtailment up to {math.floor(most * 100) / 100:g}",
    )


def pitch_too_low(aero: CpSolver, wind: float, curtailment: float, least: float, wanted: float) -> GustformError:
    """GF2023: at the highest known pitch angle there is still more power than wanted, pu."""
    return GustformError(
        "GF2023",
        f"no operating point at {wind:g} m/s with curtailment {curtailment:g}: at the highest pitch angle for "
        f"which Cp of {aero.name} is known, {aero.pitches[1]:g} deg, the power is still {least:.3f} pu, "
        f"{wanted:.3f} pu is wanted",
        hint="less curtailment, a lower wind speed, or a rotor table that goes to higher pitch angles",
    )


@lru_cache(maxsize=65536)
def _operating_point(
    aero: CpSolver, radius: float, per_cube: float, wind: float, curtailment: float, limits: Limits
) -> OperatingPoint:
    error = outside_wind(wind, limits) or outside_curtailment(curtailment)
    if error is not None:
        raise error
    eta, beta_min = 1.0 - curtailment, max(limits.beta_min, aero.pitches[0])
    if beta_min >= aero.pitches[1]:
        raise GustformError(
            "GF2025",
            f"beta_min must be less than {aero.pitches[1]:g} deg, up to which Cp of {aero.name} is known (lowest pitch "
            f"angle, deg); got {limits.beta_min:g}",
            hint="0 deg",
        )
    lambda_mpp = aero.mpp(beta_min)
    cp_max = aero.value(lambda_mpp, beta_min)
    to_ratio = radius * limits.omega_base / wind  # tip speed ratio of 1 pu speed
    to_power = per_cube * wind**3 / limits.rating  # power, pu, of Cp = 1
    available = min(to_power * cp_max, 1.0)
    target = eta * available

    def power(omega: float, beta: float) -> float:
        return to_power * aero.value(omega * to_ratio, beta)

    def pitch_for(wanted: float, omega: float) -> float:
        if power(omega, beta_min) <= wanted * (1.0 + ROUND_OFF):
            return beta_min
        ratio = inside(omega * to_ratio, aero.ratios)
        beta = aero.falling_pitch(ratio, wanted / to_power, beta_min)
        if beta is None:
            raise pitch_too_low(aero, wind, curtailment, power(omega, aero.pitches[1]), wanted)
        return beta

    omega_mpp = min(lambda_mpp / to_ratio, limits.omega_max)
    omega_del = omega_mpp
    if curtailment > 0.0 and omega_mpp < limits.omega_max:
        ratio = aero.falling_ratio(beta_min, eta * cp_max)
        if ratio is None and limits.omega_max * to_ratio > aero.ratios[1]:
            raise speed_too_low(aero, wind, curtailment, beta_min)
        omega_del = limits.omega_max if ratio is None else min(ratio / to_ratio, limits.omega_max)
    beta_del = pitch_for(target, omega_del)
    beta_mpp = pitch_for(available, omega_mpp)
    K_wr = K_beta = 0.0
    rated_wind = (limits.rating / (per_cube * cp_max)) ** (1.0 / 3.0)
    if omega_del > omega_mpp and wind < rated_wind:
        K_wr = (power(omega_mpp, beta_min) - power(omega_del, beta_min)) / (omega_del - omega_mpp)
    if beta_del > beta_mpp:
        K_beta = (power(omega_del, beta_mpp) - power(omega_del, beta_del)) / (beta_del - beta_mpp)
    return OperatingPoint(
        wind=wind,
        eta=eta,
        rated_wind=rated_wind,
        lambda_mpp=lambda_mpp,
        omega_mpp=omega_mpp,
        omega_del=omega_del,
        beta_mpp=beta_mpp,
        beta_del=beta_del,
        power=power(omega_del, beta_del),
        K_wr=K_wr,
        K_beta=K_beta,
    )


def dual_port_gains(point: OperatingPoint, K_gsc: float, reserve: float, K_msc_rated: float = 1.0) -> DualPortGains:
    """The largest gains that the operating point allows for a frequency deviation `reserve` (pu).

        K_msc = K_gsc (omega_del - omega_mpp) / reserve       below rated wind, but at least K_gsc
        K_msc = K_msc_rated                                   above rated wind
        K_msc = K_gsc                                         maximum power (eta = 1)
        K_p   = K_gsc beta_del / (K_msc reserve)              below rated: beta_del / (omega_del - omega_mpp)
        m_p   = K_gsc / (K_msc (K_wr + K_beta K_p))

    K_msc_rated = 1 is the paper's choice, to keep the droop above 2 %. The lower bound K_gsc is ours: just below rated
    wind the speed reserve vanishes, and K_p would grow without bound; K_gsc is what maximum power has anyway.
    Source: Lyu, Subotic, Gross 2022, eqs. (17)-(20); readings: project notes.
    """
    if point.eta == 1.0:
        K_msc = K_gsc
    elif point.wind < point.rated_wind:
        K_msc = max(K_gsc * (point.omega_del - point.omega_mpp) / reserve, K_gsc)
    else:
        K_msc = K_msc_rated
    K_p = K_gsc * point.beta_del / (K_msc * reserve)
    slope = point.K_wr + point.K_beta * K_p
    return DualPortGains(K_msc, K_p, K_gsc / (K_msc * slope) if slope > 0.0 else math.inf)

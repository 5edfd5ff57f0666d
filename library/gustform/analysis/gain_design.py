"""Gains of dual-port control from what a steady state must keep: operating point, three limits, droop.

At a frequency deviation Delta_omega (pu, the largest expected) the steady state of dual-port control has

    v_dc - 1         = Delta_omega/K_gsc
    omega_r - omega_del = (K_msc/K_gsc) Delta_omega
    beta - beta_del  = K_p (K_msc/K_gsc) Delta_omega

so that DC voltage, rotor speed and pitch angle stay in their ranges with

    K_gsc       >= Delta_omega/Delta_v_dc                          (18)   v_dc within Delta_v_dc
    K_msc/K_gsc <= (omega_del - omega_mpp)/Delta_omega             (19)   omega_r not below the MPP
    K_p         <= (K_gsc/K_msc) beta_del/Delta_omega              (20)   beta_ref not below zero

and the turbine answers with the droop

    m_p = K_gsc/(K_msc (K_wr + K_beta K_p))                        (17)

The paper prints (18) with <=; but v_dc moves by Delta_omega/K_gsc, eq. (15a), so it is the smallest K_gsc that the
DC voltage bounds. The paper's K_gsc = 0.5 is at the limit for Delta_v_dc = 0.02 pu.

K_wr = -dP/d(omega_r) and K_beta = -dP/d(beta) as secants from the MPP to the operating point (what the turbine gives
over the whole range), or as tangents at the operating point (what it gives at first).

Where (19) says nothing or nothing useful: above rated wind the speed is at omega_max and pitch alone holds back, so
K_msc is free; it is 1 by default, the paper's choice. At maximum power, and just below rated wind where the speed
reserve vanishes, K_msc = K_gsc: the rotor then falls below the MPP by what is missing, Delta_omega at most.

Largest gains below rated wind give m_p = Delta_omega/((1 - eta) P_available): the whole reserve over the deviation.
pu of the turbine's rating, base speed, nominal DC voltage and f0; beta in deg; K_d and T_dc in s.
Source: Lyu, Subotic, Gross 2022, V-B, eqs. (15)-(20); T_dc: project notes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from gustform.aero.rotor import Rotor
from gustform.control.operating_point import (
    DualPortGains,
    Limits,
    OperatingPoint,
    dual_port_gains,
    operating_point,
    power_slopes,
)
from gustform.language.errors import GustformError

_ROUNDED = 0.01  # relative: gains are given with two or three digits, and within that they count as at their limit
_ROUND_OFF = 1e-9  # relative
_NO_DROOP = 1e-9  # pu of power for 1 pu of speed: less counts as none


@dataclass(frozen=True)
class Specification:
    """What the gains are designed for. Gains that are None are chosen: the largest that the limits allow."""

    frequency_reserve: float = 0.01  # Delta_omega, pu
    dc_reserve: float = 0.02  # Delta_v_dc, pu
    tangent: bool = False
    K_gsc: float | None = None
    K_msc: float | None = None
    K_p: float | None = None  # deg/pu
    K_d_gsc: float = 0.0067  # s
    K_d_msc: float | None = None  # s; None: K_d_gsc K_msc/K_gsc
    T_dc: float = 0.002  # s


@dataclass(frozen=True)
class GainLimit:
    """One of the three limits: gain `relation` bound (">=" or "<="); a bound of inf does not apply."""

    name: str
    equation: str
    gain: str
    relation: str
    bound: float
    chosen: float
    keeps: str

    @property
    def applies(self) -> bool:
        """Whether there is a bound."""
        return math.isfinite(self.bound)

    @property
    def binds(self) -> bool:
        """Whether the gain is at the bound, to 1 %."""
        return self.applies and abs(self.chosen - self.bound) <= _ROUNDED * self.bound

    @property
    def broken(self) -> bool:
        """Whether the gain is beyond the bound, by more than rounding."""
        beyond = self.chosen - self.bound if self.relation == "<=" else self.bound - self.chosen
        return self.applies and beyond > _ROUNDED * self.bound


@dataclass(frozen=True)
class GainDesign:
    """The design: operating point, slopes, limits, gains, droop (inf: none) and what is wrong with it."""

    specification: Specification
    point: OperatingPoint
    K_wr: float
    K_beta: float
    limits: tuple[GainLimit, GainLimit, GainLimit]
    K_gsc: float
    K_msc: float
    K_p: float
    K_d_gsc: float
    K_d_msc: float
    T_dc: float
    m_p: float
    speed_at_limit: float  # omega_r at the deviation, pu
    pitch_at_limit: float  # beta at the deviation, deg
    warnings: tuple[str, ...]


def design_gains(
    rotor: Rotor, limits: Limits, wind: float, curtailment: float, specification: Specification | None = None
) -> GainDesign:
    """Design the gains for a constant wind (m/s) and curtailment.

    Raises GF2044, GF2045, GF2046 where a given gain breaks (16), (17), (18); GF2020-GF2023 where there is no operating
    point; GF2003 for a specification that is not positive.
    """
    spec = specification or Specification()
    _check(spec)
    point = operating_point(rotor, wind, curtailment, limits)
    reserve = spec.frequency_reserve

    smallest = reserve / spec.dc_reserve
    K_gsc = smallest if spec.K_gsc is None else spec.K_gsc
    dc = GainLimit("DC voltage", "(18)", "K_gsc", ">=", smallest, K_gsc, "v_dc within its reserve")
    _refuse(dc, "GF2044", f"{reserve:g} pu of frequency over {spec.dc_reserve:g} pu of DC voltage")

    chosen = dual_port_gains(point, K_gsc, reserve)
    K_msc = chosen.K_msc if spec.K_msc is None else spec.K_msc
    speed_reserve = point.omega_del - point.omega_mpp
    largest_msc = K_gsc * speed_reserve / reserve if point.wind < point.rated_wind else math.inf
    speed = GainLimit("rotor speed", "(19)", "K_msc", "<=", largest_msc, K_msc, "omega_r above the MPP")
    if K_msc > K_gsc * (1.0 + _ROUND_OFF):  # K_gsc itself is what maximum power has
        _refuse(
            speed,
            "GF2045",
            f"{speed_reserve:.4g} pu of speed above the MPP for {reserve:g} pu of frequency, K_gsc {K_gsc:g}",
        )

    largest_p = K_gsc * point.beta_del / (K_msc * reserve)
    K_p = largest_p if spec.K_p is None else spec.K_p
    pitch = GainLimit("pitch angle", "(20)", "K_p", "<=", largest_p, K_p, "beta_ref above zero")
    _refuse(pitch, "GF2046", f"beta_del is {point.beta_del:.4g} deg, K_msc/K_gsc {K_msc / K_gsc:.4g}")

    K_wr, K_beta = point.K_wr, point.K_beta
    if spec.tangent:
        K_wr, K_beta = power_slopes(rotor, wind, point.omega_del, point.beta_del, limits)
    K_d_msc = spec.K_d_gsc * K_msc / K_gsc if spec.K_d_msc is None else spec.K_d_msc
    design = GainDesign(
        specification=spec,
        point=point,
        K_wr=K_wr,
        K_beta=K_beta,
        limits=(dc, speed, pitch),
        K_gsc=K_gsc,
        K_msc=K_msc,
        K_p=K_p,
        K_d_gsc=spec.K_d_gsc,
        K_d_msc=K_d_msc,
        T_dc=spec.T_dc,
        m_p=droop(K_wr, K_beta, K_gsc, DualPortGains(K_msc, K_p, math.inf)),
        speed_at_limit=point.omega_del - K_msc / K_gsc * reserve,
        pitch_at_limit=point.beta_del * (1.0 - K_p / largest_p) if largest_p > 0.0 else 0.0,
        warnings=(),
    )
    return replace(design, warnings=tuple(_warnings(design)))


def droop(K_wr: float, K_beta: float, K_gsc: float, gains: DualPortGains) -> float:
    """m_p of eq. (17); inf where the power does not answer."""
    slope = K_wr + K_beta * gains.K_p
    return K_gsc / (gains.K_msc * slope) if slope > _NO_DROOP else math.inf


def _check(spec: Specification) -> None:
    positive = ("frequency_reserve", "dc_reserve", "K_gsc", "K_msc", "T_dc")
    for name in (*positive, "K_p", "K_d_gsc", "K_d_msc"):
        value = getattr(spec, name)
        if value is None or value > 0.0 or (value == 0.0 and name not in positive):
            continue
        wanted = "greater than 0" if name in positive else "at least 0"
        raise GustformError("GF2003", f"{name} must be {wanted}; got {value:g}", hint="the default: leave it out")


def _refuse(limit: GainLimit, code: str, why: str) -> None:
    if not limit.broken:
        return
    least, range_ = ("at most", "up to") if limit.relation == "<=" else ("at least", "from")
    value = _rounded_down(limit.bound) if limit.relation == "<=" else -_rounded_down(-limit.bound)
    raise GustformError(
        code,
        f"{limit.gain} must be {least} {limit.bound:.4g}, the {limit.name} limit, eq. {limit.equation}, which keeps "
        f"{limit.keeps}: {why}; got {limit.chosen:g}",
        hint=f"{limit.gain} {range_} {value:g}, or more reserve",
    )


def _rounded_down(value: float) -> float:
    """To three digits, towards minus infinity."""
    if value == 0.0:
        return 0.0
    digits = 2 - math.floor(math.log10(abs(value)))
    scaled = round(value * 10.0**digits, 6)  # what is there to round-off stays
    return round(math.floor(scaled) * 10.0**-digits, max(digits, 0))


def _warnings(d: GainDesign) -> list[str]:
    found = []
    sides = (("K_d_gsc/K_gsc", d.K_d_gsc / d.K_gsc), ("K_d_msc/K_msc", d.K_d_msc / d.K_msc))
    for name, ratio in sides:
        if d.T_dc >= ratio * (1.0 - _ROUND_OFF):
            found.append(
                f"T_dc = {d.T_dc:g} s is not below {name} = {ratio:.4g} s: the filter takes the damping away and the "
                f"control is unstable; try T_dc below {_rounded_down(0.5 * ratio):g} s, or a larger K_d"
            )
    if not math.isclose(sides[0][1], sides[1][1], rel_tol=_ROUND_OFF):
        found.append(
            f"K_d_gsc/K_gsc = {sides[0][1]:.4g} s and K_d_msc/K_msc = {sides[1][1]:.4g} s differ: the theorem on "
            f"stability asks for one ratio on both sides; try K_d_msc = {d.K_d_gsc * d.K_msc / d.K_gsc:.4g} s"
        )
    speed = d.limits[1]
    if speed.broken:
        below = d.point.omega_mpp - d.speed_at_limit
        found.append(
            f"K_msc = {d.K_msc:.4g} is above the {speed.name} limit, eq. {speed.equation}, {speed.bound:.4g}: at a "
            f"deviation of {d.specification.frequency_reserve:g} pu the rotor is {below:.3g} pu below the MPP"
        )
    slope = d.K_wr + d.K_beta * d.K_p
    if slope < -_NO_DROOP:
        found.append(
            f"K_wr + K_beta K_p = {slope:.3g} is negative: power falls with the speed, and the stability theorem does "
            f"not hold; try a larger K_p"
        )
    return found

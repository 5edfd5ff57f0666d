"""Curtailed operating points of a turbine and the control gains that follow from them.

Rotor speed first, pitch second: power is held back by turning faster than at the maximum power point (MPP), and only
what the speed limit leaves over by pitching. Above rated wind, eta means eta times the rated power.

    lambda_mpp = argmax Cp(lambda, beta_min)
    Cp(lambda_del, beta_min) = eta Cp(lambda_mpp, beta_min),  lambda_del >= lambda_mpp
    omega_del  = min(lambda_del v / R, omega_max)
    P(omega_del, beta_del) = eta min(P_mpp, P_rated)          upper root in beta, on the falling side

Each of these is a bounded problem in one variable, bracketed by a scan and solved by Ipopt on the rotor's own Cp.
Source: Lyu, Subotic, Gross 2022, IV-B, eqs. (5), (6); V-B; readings: project notes.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.aero.rotor import Rotor
from gustform.language.errors import GustformError

Array = NDArray[np.float64]

_SCAN = 241  # points of a scan that brackets a root: steps of about 0.05 in lambda or pitch, finer than any known table
_ON_TARGET = 1e-9  # of Cp: what a solution may miss
_ROUND_OFF = 1e-12  # relative

_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-13,
        "constr_viol_tol": 1e-13,
        "acceptable_tol": 1e-11,
        "acceptable_iter": 3,
        "bound_relax_factor": 0.0,
        "max_iter": 200,
    },
}


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


class _Aerodynamics:
    """Solvers on the Cp of one rotor; made once for each rotor."""

    def __init__(self, rotor: Rotor) -> None:
        self.name = type(rotor).__name__
        self.cp = rotor.power_coefficient()
        self.ratios = rotor.tip_speed_ratio_range()
        self.pitches = rotor.pitch_range()
        x, p = ca.MX.sym("x"), ca.MX.sym("p", 2)  # p: the other argument, the target
        best: Any = {"x": x, "p": p, "f": -self.cp(x, p[0])}
        ratio: Any = {"x": x, "p": p, "f": 0, "g": self.cp(x, p[0]) - p[1]}
        pitch: Any = {"x": x, "p": p, "f": 0, "g": self.cp(p[0], x) - p[1]}
        self._best = ca.nlpsol("best", "ipopt", best, _OPTIONS)
        self._ratio = ca.nlpsol("ratio", "ipopt", ratio, _OPTIONS)
        self._pitch = ca.nlpsol("pitch", "ipopt", pitch, _OPTIONS)
        self._scan = self.cp.map(_SCAN)
        self._mpp: dict[float, float] = {}
        self._falling_ratio: dict[tuple[float, float], float | None] = {}

    def value(self, ratio: float, pitch: float) -> float:
        """Cp, with the arguments held inside their ranges as the rotor does."""
        return float(self.cp(_inside(ratio, self.ratios), _inside(pitch, self.pitches)))

    def along_ratio(self, ratios: Array, pitch: float) -> Array:
        """Cp at _SCAN tip speed ratios and one pitch angle."""
        return np.asarray(self._scan(ratios[None, :], np.full((1, _SCAN), pitch))).ravel()

    def along_pitch(self, ratio: float, pitches: Array) -> Array:
        """Cp at one tip speed ratio and _SCAN pitch angles."""
        return np.asarray(self._scan(np.full((1, _SCAN), ratio), pitches[None, :])).ravel()

    def mpp(self, pitch: float) -> float:
        """The tip speed ratio of the highest Cp at a pitch angle."""
        if pitch not in self._mpp:
            scan = np.linspace(*self.ratios, _SCAN)
            k = int(np.argmax(self.along_ratio(scan, pitch)))
            low, high = float(scan[max(k - 1, 0)]), float(scan[min(k + 1, _SCAN - 1)])
            answer = self._best(x0=scan[k], p=[pitch, 0.0], lbx=low, ubx=high)
            self._mpp[pitch] = float(answer["x"])
        return self._mpp[pitch]

    def falling_ratio(self, pitch: float, target: float) -> float | None:
        """The tip speed ratio above the best one at which Cp falls to the target; None if it does not."""
        key = (pitch, target)
        if key not in self._falling_ratio:
            scan = np.linspace(self.mpp(pitch), self.ratios[1], _SCAN)
            below = np.flatnonzero(self.along_ratio(scan, pitch) <= target)
            below = below[below > 0]
            found = None
            if below.size:
                k = int(below[0])
                found = self._root(self._ratio, float(scan[k - 1]), float(scan[k]), [pitch, target])
            self._falling_ratio[key] = found
        return self._falling_ratio[key]

    def falling_pitch(self, ratio: float, target: float, low: float) -> float | None:
        """The highest pitch angle at which Cp falls through the target; None if it stays above."""
        scan = np.linspace(low, self.pitches[1], _SCAN)
        surplus = self.along_pitch(ratio, scan) - target
        through = np.flatnonzero((surplus[:-1] > 0.0) & (surplus[1:] <= 0.0))
        if not through.size:
            return None
        k = int(through[-1])
        return self._root(self._pitch, float(scan[k]), float(scan[k + 1]), [ratio, target])

    def _root(self, solver: Any, low: float, high: float, p: list[float]) -> float:
        answer = solver(x0=0.5 * (low + high), p=p, lbx=low, ubx=high, lbg=0.0, ubg=0.0)
        miss = abs(float(answer["g"]))
        if not miss < _ON_TARGET:
            raise GustformError(
                "GF2024",
                f"no operating point of {self.name} between {low:g} and {high:g}: Ipopt ended with "
                f"{solver.stats()['return_status']}, Cp off by {miss:.2g}",
                hint="a smoother table of Cp",
            )
        return float(answer["x"])


def _inside(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])


_aerodynamics: dict[Hashable, _Aerodynamics] = {}


def _aerodynamics_of(rotor: Rotor) -> _Aerodynamics:
    key = rotor.aerodynamic_key()
    if key not in _aerodynamics:
        _aerodynamics[key] = _Aerodynamics(rotor)
    return _aerodynamics[key]


def operating_point(rotor: Rotor, wind: float, curtailment: float, limits: Limits) -> OperatingPoint:
    """The operating point of a rotor in constant wind, `curtailment` = 1 - eta held back.

    Raises GF2020 (wind outside cut-in ... cut-out), GF2021 (curtailment outside 0 ... 1), GF2022 (speed cannot hold
    back so much within the known Cp), GF2023 (pitch cannot), each naming the limit.
    """
    _aerodynamics_of(rotor)
    return _operating_point(
        rotor.aerodynamic_key(), float(rotor.radius), rotor.power_per_cube(), float(wind), float(curtailment), limits
    )


def power_at(rotor: Rotor, wind: float, omega: float, beta: float, limits: Limits) -> float:
    """Power, pu, at a wind speed (m/s), rotor speed (pu) and pitch angle (deg)."""
    ratio = rotor.radius * limits.omega_base * omega / wind
    return float(rotor.power_per_cube() * wind**3 * _aerodynamics_of(rotor).value(ratio, beta) / limits.rating)


@lru_cache(maxsize=65536)
def _operating_point(
    key: Hashable, radius: float, per_cube: float, wind: float, curtailment: float, limits: Limits
) -> OperatingPoint:
    aero = _aerodynamics[key]
    if not limits.cut_in <= wind <= limits.cut_out:
        raise GustformError(
            "GF2020",
            f"no operating point at a wind speed of {wind:g} m/s: the turbine runs from cut-in "
            f"at {limits.cut_in:g} m/s to cut-out at {limits.cut_out:g} m/s",
            hint=f"a wind speed from {limits.cut_in:g} to {limits.cut_out:g} m/s",
        )
    if not 0.0 <= curtailment < 1.0:
        raise GustformError(
            "GF2021",
            f"curtailment must be at least 0 and below 1 (share of the power held back); got {curtailment:g}",
            hint="0.1",
        )
    eta, beta_min = 1.0 - curtailment, max(limits.beta_min, aero.pitches[0])
    lambda_mpp = aero.mpp(beta_min)
    cp_max = aero.value(lambda_mpp, beta_min)
    to_ratio = radius * limits.omega_base / wind  # tip speed ratio of 1 pu speed
    to_power = per_cube * wind**3 / limits.rating  # power, pu, of Cp = 1
    available = min(to_power * cp_max, 1.0)
    target = eta * available

    def power(omega: float, beta: float) -> float:
        return to_power * aero.value(omega * to_ratio, beta)

    def pitch_for(wanted: float, omega: float) -> float:
        if power(omega, beta_min) <= wanted * (1.0 + _ROUND_OFF):
            return beta_min
        ratio = _inside(omega * to_ratio, aero.ratios)
        beta = aero.falling_pitch(ratio, wanted / to_power, beta_min)
        if beta is None:
            least = power(omega, aero.pitches[1])
            raise GustformError(
                "GF2023",
                f"no operating point at {wind:g} m/s with curtailment {curtailment:g}: at the highest pitch angle for "
                f"which Cp of {aero.name} is known, {aero.pitches[1]:g} deg, the power is still {least:.3f} pu, "
                f"{wanted:.3f} pu is wanted",
                hint="less curtailment, a lower wind speed, or a rotor table that goes to higher pitch angles",
            )
        return beta

    omega_mpp = min(lambda_mpp / to_ratio, limits.omega_max)
    omega_del = omega_mpp
    if curtailment > 0.0 and omega_mpp < limits.omega_max:
        ratio = aero.falling_ratio(beta_min, eta * cp_max)
        if ratio is None and limits.omega_max * to_ratio > aero.ratios[1]:
            most = 1.0 - aero.value(aero.ratios[1], beta_min) / cp_max
            raise GustformError(
                "GF2022",
                f"no operating point at {wind:g} m/s with curtailment {curtailment:g}: at the highest tip speed ratio "
                f"for which Cp of {aero.name} is known, {aero.ratios[1]:.2f}, speed holds back {most:.3f}",
                hint=f"a curtailment up to {math.floor(most * 100) / 100:g}",
            )
        omega_del = limits.omega_max if ratio is None else min(ratio / to_ratio, limits.omega_max)
    beta_mpp = pitch_for(available, omega_mpp)
    beta_del = pitch_for(target, omega_del)
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

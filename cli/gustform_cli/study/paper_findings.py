"""The numbers of the paper study: what goes into summary.json, and the details that its report compares beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gustform.analysis.droop_map import DroopMap, droop_map
from gustform.control.dual_port import DualPort
from gustform_cli.run import Ended
from gustform_cli.run_data import RunData
from gustform_cli.study.droop_map import ETAS
from gustform_cli.study.paper_cases import GFM_FR, GFM_MPPT, SCENARIO, TURBINE, Built, Case
from gustform_cli.study.stability import SET_B, check_theorem
from gustform_cli.study.variants import Variants
from gustform_codegen.modes import Modes, modes

# m/s, finer where the droop falls at rated wind (11.23 m/s); `gustform study droop-map` has a finer grid everywhere
MAP_WINDS = tuple(sorted({4.0 + 0.25 * k for k in range(45)} - {11.25} | {11.2, 11.3}))
LOSSLESS = "lossless"  # the fidelity without filters
_SEED = 1  # of the random sets: the report is the same every time


@dataclass(frozen=True)
class Stability:
    """Where the rightmost eigenvalue of one case lies, 1/s, for a time constant of the DC voltage filters, s."""

    case: Case
    fidelity: str
    T_dc: float
    rightmost: complex
    limit: float  # K_d/K_theta, s


def frequency(ended: Mapping[Case, Ended]) -> dict[str, dict[str, dict[str, float | None]]]:
    """The `frequency` part of summary.json: by control and wind speed."""
    result: dict[str, dict[str, dict[str, float | None]]] = {}
    for case, end in ended.items():
        figures = end.summary.frequency or {}
        with RunData(end.result) as data:
            last = {name: float(data.curve(f"{TURBINE}.{name}").values[-1]) for name in ("v_dc", "omega_r", "beta")}
        result.setdefault(case.control.key, {})[str(case.wind)] = {
            "nadir_hz": figures.get("nadir_hz"),
            "settle_hz": figures.get("settle_hz"),
            "rocof_hz_per_s": figures.get("rocof_hz_per_s"),
            "v_dc_end_pu": last["v_dc"],
            "omega_r_end_pu": last["omega_r"],
            "beta_end_deg": last["beta"],
        }
    return result


def gains(built: Iterable[Built]) -> dict[str, dict[str, float]]:
    """The `gains` part of summary.json: operating point and gains of GFM FR by wind speed."""
    result = {}
    for b in built:
        if b.case.control is not GFM_FR:
            continue
        point, chosen = b.turbine.operating_point(), b.turbine.gains()
        result[str(b.case.wind)] = {
            "omega_del_pu": point.omega_del,
            "beta_del_deg": point.beta_del,
            "K_msc": chosen.K_msc,
            "K_p": chosen.K_p,
            "K_wr": point.K_wr,
            "K_beta": point.K_beta,
            "m_p_percent": 100.0 * chosen.m_p,
        }
    return result


def linear(case: Case, fidelity: str) -> Variants:
    """A case to be linearised in its steady state before the load step.

    With governor set B: inside its dead band the other one does nothing, and the frequency is neutral. The governor of
    lossless has no dead band.
    """
    return Variants(SCENARIO, [*case.overrides(fidelity), *(SET_B if fidelity != LOSSLESS else ())])


def as_pairs(found: Modes) -> list[list[float]]:
    """Eigenvalues as [re, im], 1/s, the least damped first."""
    return [[float(value.real), float(value.imag)] for value in found.eigenvalues]


def stability(case: Case, fidelity: str, time_constants: Sequence[float]) -> list[Stability]:
    """The rightmost eigenvalue of a case with dual-port control, with its own and other filters of the DC voltage (s);
    at rms instead of lossless, which has no filter."""
    fidelity = "rms" if fidelity == LOSSLESS else fidelity
    variants = linear(case, fidelity)
    control = variants.component(TURBINE).part("control")
    assert isinstance(control, DualPort)
    limit = float(control.K_d_gsc / control.K_gsc)
    return [
        Stability(case, fidelity, T_dc, modes(variants.linear(TURBINE, {"control.T_dc": T_dc})).rightmost, limit)
        for T_dc in (float(control.T_dc), *time_constants)
    ]


def theorem_check() -> dict[str, float]:
    """The Lyapunov identity and the exceptions to the theorem, by the keys of `published`."""
    checked = check_theorem(_SEED)
    return {
        "theorem.sets": float(checked["sets"]),
        "theorem.identity": float(checked["identity_error"]),
        "theorem.counter_examples": float(checked["counter_examples"]),
    }


def droop(built: Iterable[Built]) -> DroopMap:
    """The smallest achievable droop of the study's turbine, over curtailment and wind speed."""
    turbine = next(b.turbine for b in built if b.case.control is GFM_FR)
    return droop_map(turbine.rotor, turbine.limits(), MAP_WINDS, ETAS)


def details(built: Iterable[Built]) -> dict[str, float]:
    """What the paper's tables hold beside the gains, by the keys of `published`."""
    result: dict[str, float] = {}
    for b in built:
        turbine, control = b.turbine, b.turbine.control
        if b.case.control is GFM_FR:
            result[f"beta_mpp.{b.case.wind}"] = turbine.operating_point().beta_mpp
        if b.case.control is GFM_MPPT and isinstance(control, DualPort):
            result["control.K_msc_mppt"] = control.K_msc
        if b.case.control is not GFM_FR or not isinstance(control, DualPort):
            continue
        impedance = turbine.voltage_converter**2 / turbine.rating
        result |= {
            "turbine.rating_mw": turbine.rating / 1e6,
            "turbine.speed_rad_per_s": turbine.omega_max * turbine.omega_base,
            "turbine.inertia": turbine.drive.J / 1e6,
            "turbine.v_dc_kv": turbine.v_dc_base / 1e3,
            "turbine.capacitance_mf": turbine.dc_link.C * 1e3,
            "turbine.filter_ohm": turbine.gsc.r * impedance,
            "turbine.filter_mh": turbine.gsc.x * impedance / (2.0 * np.pi * turbine.f0) * 1e3,
            "rated_wind": turbine.operating_point().rated_wind,
            "control.K_gsc": control.K_gsc,
            "control.K_d_gsc": control.K_d_gsc,
            "control.T_dc": control.T_dc,
            "control.T_v": control.T_v,
            "control.K_q_gsc": control.K_q_gsc,
            "control.K_q_msc": control.K_q_msc,
        }
    return {key: float(value) for key, value in result.items()}


def flat(tree: Mapping[str, Any], path: str = "") -> dict[str, float]:
    """The numbers of a nested mapping by dotted path; what is no number (a run that did not reach) is left out."""
    result: dict[str, float] = {}
    for name, value in tree.items():
        at = f"{path}.{name}" if path else name
        if isinstance(value, Mapping):
            result |= flat(value, at)
        elif isinstance(value, int | float):
            result[at] = float(value)
    return result

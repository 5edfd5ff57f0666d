"""The numbers of the paper study: what goes into summary.json, and the details that its report compares beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gustform.analysis import theorem
from gustform.control.dual_port import DualPort
from gustform_cli.run import Ended
from gustform_cli.run_data import RunData
from gustform_cli.study.paper_cases import GFM_FR, GFM_MPPT, TURBINE, Built, Case, build
from gustform_codegen.linear import linearise
from gustform_codegen.modes import Modes, modes

# Inside its dead band a governor does nothing and the frequency is neutral, so eigenvalues are those of the generator
# without one, with the data that then give the published frequencies. Project notes, set B.
GOVERNOR_B = (
    "sg.machine.H=8 s",
    "sg.governor.T1=0.3 s",
    "sg.governor.T2=2.5 s",
    "sg.governor.T3=8.4 s",
    "sg.governor.droop=0.0613",
    "sg.governor.half_dead_band=0",
)
RANDOM_SETS = 20_000
_SEED = 1  # of the random sets: the report is the same every time
_ROUND_OFF = 1e-13  # of the largest eigenvalue: a real part that may as well be zero


@dataclass(frozen=True)
class Stability:
    """Where the rightmost eigenvalue of one case lies, 1/s, for a time constant of the DC voltage filters, s."""

    case: Case
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


def linear_modes(case: Case, fidelity: str, more: Sequence[str] = ()) -> Modes:
    """The modes of a case in its steady state before the load step, with the governor of set B."""
    b = build(case, fidelity, [*GOVERNOR_B, *more])
    return modes(linearise(b.model.built.linked, b.table))


def as_pairs(found: Modes) -> list[list[float]]:
    """Eigenvalues as [re, im], 1/s, the least damped first."""
    return [[float(value.real), float(value.imag)] for value in found.eigenvalues]


def stability(case: Case, fidelity: str, T_dc: float) -> Stability:
    """The rightmost eigenvalue of a case with dual-port control and another filter."""
    control = build(case, fidelity).turbine.control
    assert isinstance(control, DualPort)
    found = linear_modes(case, fidelity, [f"wt.control.T_dc={T_dc} s"])
    return Stability(case, T_dc, found.rightmost, control.K_d_gsc / control.K_gsc)


def theorem_check() -> dict[str, float]:
    """The Lyapunov identity at random states, and exceptions to the theorem, over sets that meet its conditions."""
    rng = np.random.default_rng(_SEED)
    sets = theorem.random_sets(RANDOM_SETS, rng)
    states = rng.standard_normal((RANDOM_SETS, len(theorem.STATES)))
    values = theorem.eigenvalues(sets)
    unstable = values.real.max(axis=-1) > _ROUND_OFF * np.abs(values).max(axis=-1)
    return {
        "theorem.identity": float(theorem.identity_error(sets, states).max()),
        "theorem.counter_examples": float(np.count_nonzero(unstable)),
    }


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

"""Where stability ends: the paper's theorem checked, and three sweeps on its model and on the full rms model.

The full model is the shipped load step at 8 m/s with governor set B of the project notes (H 8 s, T1 .3 T2 2.5 T3 8.4 s,
R .0613, no dead band), so that the frequency is not neutral; where it says so, with set A, whose dead band keeps the
governor silent. K_wt of the full model is changed in its linear system, as the slope of the wind power over the rotor
speed; points beside that curve have their operating point moved along the Cp curve instead.
"""

from __future__ import annotations

import csv
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.analysis import theorem
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.new import SCENARIOS
from gustform_cli.result import prepare_folder
from gustform_cli.study.variants import Variants
from gustform_cli.writing import write_text
from gustform_codegen.linear import LinearSystem
from gustform_codegen.modes import CONSTANT, REFERENCE, modes

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SCENARIO = SCENARIOS / "load_step_8ms.yaml"
SET_B = (
    "sg.machine.H=8 s",
    "sg.governor.T1=0.3 s",
    "sg.governor.T2=2.5 s",
    "sg.governor.T3=8.4 s",
    "sg.governor.droop=6.13 %",
    "sg.governor.half_dead_band=0 pu",
)
SETS = 20_000
PUBLISHED_T_DC = 0.05  # s, Table II of the paper
_ROTOR = "wt.drive.w"
_LIMIT_TOLERANCE = 1e-6  # relative, of a limit found by bisection


@dataclass(frozen=True, eq=False)
class Curve:
    """Eigenvalues of one model over the values of one parameter."""

    model: str
    label: str
    values: Array
    eigenvalues: list[ComplexArray]
    limits: list[float]  # values at which the rightmost eigenvalue crosses the imaginary axis

    @property
    def rightmost(self) -> ComplexArray:
        """The eigenvalue with the largest real part, at each value."""
        return np.array([e[np.argmax(e.real)] for e in self.eigenvalues])


@dataclass(frozen=True, eq=False)
class Sweep:
    """One parameter over a range, on several models."""

    key: str
    title: str
    unit: str
    logarithmic: bool
    nominal: float
    marks: dict[str, float]
    curves: list[Curve]


@dataclass(frozen=True, eq=False)
class Study:
    """Everything the study found, with its files."""

    summary: dict[str, Any]
    sweeps: list[Sweep]
    files: dict[str, Path]


def stability(out: Path, seed: int = 1) -> Study:
    """Run the study and write its figure, tables and summary into the folder `out`."""
    prepare_folder(out)
    begin = time.perf_counter()

    def say(text: str) -> None:
        print(f"[{time.perf_counter() - begin:5.1f} s] {text}", file=sys.stderr, flush=True)

    say(f"theorem: {SETS} random parameter sets, seed {seed}")
    checked = check_theorem(seed)
    say("full model: linking and steady state")
    full, silent = Variants(SCENARIO, SET_B), Variants(SCENARIO)
    turbine, generator = full.component("wt"), full.component("sg")
    assert isinstance(turbine, PmsgTurbine)
    assert isinstance(generator, SynchronousGenerator)
    model = theorem.of_components(turbine, generator)
    sweeps = []
    for make in (_sweep_filter, _sweep_ratio, _sweep_slope):
        sweep = make(model, turbine, full, silent)
        say(f"swept: {sweep.title}, {len(sweep.curves)} models")
        sweeps.append(sweep)
    files = {
        "figure": out / "stability.png", "sweeps": out / "sweeps.csv", "limits": out / "limits.csv",
        "summary": out / "summary.json",
    }  # fmt: skip
    summary = {
        "theorem": checked,
        "published": _published(model, turbine, full),
        "model_parameters": {name: float(value) for name, value in asdict(model).items()},
        "eigenvalues": {
            "simplified": _pairs(theorem.eigenvalues(model)),
            "simplified_filtered": _pairs(theorem.eigenvalues(model, float(turbine.control.T_dc))),
            "rms": _pairs(_eigenvalues(full.linear("wt", {}))),
            "rms_dead_band": _pairs(_eigenvalues(silent.linear("wt", {}))),
        },
        "limits": {s.key: {c.model: c.limits for c in s.curves} for s in sweeps},
        "paths": {name: str(path) for name, path in files.items()},
    }
    _write_tables(sweeps, files)
    write_text(files["summary"], json.dumps(summary, indent=2) + "\n")
    say("figure")
    from gustform_cli.study.stability_figure import draw

    draw(sweeps, files["figure"])
    return Study(summary, sweeps, files)


# ---- the theorem ----


def check_theorem(seed: int) -> dict[str, Any]:
    """The theorem over random parameter sets that meet its conditions, and over sets that break one."""
    rng = np.random.default_rng(seed)
    sets = theorem.random_sets(SETS, rng)
    real = theorem.eigenvalues(sets).real.max(axis=1)
    states = rng.standard_normal((SETS, len(theorem.STATES)))
    # The same sets without one of the conditions: they must not all be stable, or the check would be blind.
    ratio = np.exp(rng.uniform(np.log(1e-3), np.log(1e3), SETS))
    broken_ratio = replace(sets, K_d_msc=np.asarray(sets.K_d_msc) * ratio)
    broken_slope = replace(sets, K_wt=-np.asarray(sets.K_wt))
    return {
        "sets": SETS,
        "seed": seed,
        "counter_examples": int(np.count_nonzero(real >= 0.0)),
        "largest_real_part": float(real.max()),
        "identity_error": float(theorem.identity_error(sets, states).max()),
        "unstable_without_ratio_condition": int(
            np.count_nonzero(theorem.eigenvalues(broken_ratio).real.max(axis=1) > 0.0)
        ),
        "unstable_with_negative_slope": int(np.count_nonzero(theorem.eigenvalues(broken_slope).real.max(axis=1) > 0.0)),
    }


def _published(model: theorem.SmallSignal, turbine: PmsgTurbine, full: Variants) -> dict[str, Any]:
    """The published pair K_d, T_dc, and what is used instead, against the conditions and both models."""
    used = float(turbine.control.T_dc)
    result: dict[str, Any] = {
        "K_d_gsc": float(np.asarray(model.K_d_gsc)),
        "T_dc_limit": float(np.asarray(model.K_d_gsc) / np.asarray(model.K_gsc)),
    }
    for name, T_dc in (("published", PUBLISHED_T_DC), ("used", used)):
        system = _eigenvalues(full.linear("wt", {"control.T_dc": T_dc}))
        simple = theorem.eigenvalues(model, T_dc)
        result[name] = {
            "T_dc": T_dc,
            "conditions": {
                c.name: {"holds": c.holds, "detail": c.detail}
                for c in [*theorem.conditions(model), theorem.filter_condition(model, T_dc)]
            },
            "rightmost_simplified": _pair(simple[np.argmax(simple.real)]),
            "rightmost_rms": _pair(system[np.argmax(system.real)]),
        }
    return result


# ---- sweeps ----


def _sweep_filter(model: theorem.SmallSignal, turbine: PmsgTurbine, full: Variants, _: Variants) -> Sweep:
    values = np.geomspace(5e-4, 0.1, 49)
    ratio = float(np.asarray(model.K_d_gsc) / np.asarray(model.K_gsc))
    return Sweep(
        "T_dc", "filter time constant T_dc", "s", True, float(turbine.control.T_dc),
        {"K_d/K_theta": ratio, "published": PUBLISHED_T_DC},
        [
            _curve("simplified", "simplified", values, lambda T: theorem.eigenvalues(model, T), True),
            _curve("rms", "full rms", values, lambda T: _eigenvalues(full.linear("wt", {"control.T_dc": T})), True),
        ],
    )  # fmt: skip


def _sweep_ratio(model: theorem.SmallSignal, turbine: PmsgTurbine, full: Variants, _: Variants) -> Sweep:
    values = np.geomspace(1e-3, 1e4, 57)
    balanced = float(np.asarray(model.K_d_gsc) * np.asarray(model.K_msc) / np.asarray(model.K_gsc))
    T_dc = float(turbine.control.T_dc)

    def simple(q: float) -> theorem.SmallSignal:
        return replace(model, K_d_msc=balanced * q)

    return Sweep(
        "K_d_ratio", "ratio K_d_msc K_gsc/(K_d_gsc K_msc)", "", True, 1.0, {"theorem": 1.0},
        [
            _curve("simplified", "simplified", values, lambda q: theorem.eigenvalues(simple(q)), True),
            _curve(
                "simplified_filtered", f"simplified, T_dc {1e3 * T_dc:g} ms", values,
                lambda q: theorem.eigenvalues(simple(q), T_dc), True,
            ),
            _curve(
                "rms", "full rms", values,
                lambda q: _eigenvalues(full.linear("wt", {"control.K_d_msc": balanced * q})), True,
            ),
        ],
    )  # fmt: skip


def _sweep_slope(model: theorem.SmallSignal, turbine: PmsgTurbine, full: Variants, silent: Variants) -> Sweep:
    values = np.linspace(-3.0, 1.0, 81)
    slope, J_r = float(np.asarray(model.K_wt)), float(np.asarray(model.J_r))

    def sloped(system: LinearSystem) -> Callable[[float], ComplexArray]:
        """J_r d(omega_r)/dt = -K_wt omega_r + ... in the row of the rotor."""
        rotor = [q.name for q in system.states].index(_ROTOR)

        def at(K_wt: float) -> ComplexArray:
            A = system.A.copy()
            A[rotor, rotor] -= (K_wt - slope) / J_r
            return _eigenvalues(replace(system, A=A))

        return at

    mute = replace(model, k_g=0.0)
    return Sweep(
        "K_wt", "slope K_wt = K_wr + K_beta K_p", "pu", False, slope, {"theorem": 0.0},
        [
            _curve("simplified", "simplified", values, lambda K: theorem.eigenvalues(replace(model, K_wt=K)), False),
            _curve(
                "simplified_no_governor", "simplified, k_g = 0", values,
                lambda K: theorem.eigenvalues(replace(mute, K_wt=K)), False,
            ),
            _curve("rms", "full rms", values, sloped(full.linear("wt", {})), False),
            _curve("rms_dead_band", "full rms, in the dead band", values, sloped(silent.linear("wt", {})), False),
            _moved(turbine, silent),
        ],
    )  # fmt: skip


def _moved(turbine: PmsgTurbine, silent: Variants) -> Curve:
    """The full model in the dead band with the operating point at other rotor speeds, all gains as they were."""
    kept = {"K_msc": float(turbine.K_msc), "K_p": 0.0, "beta_del": 0.0}
    slopes, found = [], []
    for omega in np.linspace(0.70, 1.19, 15):
        values = {**kept, "omega_del": float(omega)}
        variant = silent.component("wt", values)
        assert isinstance(variant, PmsgTurbine)
        slopes.append(theorem.power_slope(variant)[0])
        found.append(_eigenvalues(silent.linear("wt", values, moves=True)))
    order = np.argsort(slopes)
    curve = Curve(
        "rms_dead_band_moved", "same, operating point moved", np.array(slopes)[order], [found[k] for k in order], []
    )
    real = curve.rightmost.real
    # between two points: no value of the parameter belongs to a point in between by itself
    crossings = [
        float(np.interp(0.0, sorted(real[k : k + 2]), curve.values[[k, k + 1]][np.argsort(real[k : k + 2])]))
        for k in np.flatnonzero(np.sign(real[:-1]) != np.sign(real[1:]))
    ]
    return replace(curve, limits=crossings)


def _curve(model: str, label: str, values: Array, at: Callable[[float], ComplexArray], logarithmic: bool) -> Curve:
    found = [at(float(value)) for value in values]
    stable = np.array([_stable(e) for e in found])
    limits = []
    for k in np.flatnonzero(stable[:-1] != stable[1:]):
        low, high = float(values[k]), float(values[k + 1])
        while abs(high - low) > _LIMIT_TOLERANCE * max(abs(high), abs(low), 1e-3):
            middle = (low * high) ** 0.5 if logarithmic else 0.5 * (low + high)
            if _stable(at(middle)) == stable[k]:
                low = middle
            else:
                high = middle
        limits.append(0.5 * (low + high))
    return Curve(model, label, values, found, limits)


def _stable(eigenvalues: ComplexArray) -> bool:
    return bool(eigenvalues.real.max() < 0.0)


def _eigenvalues(system: LinearSystem) -> ComplexArray:
    """Eigenvalues of the full model without that of the reference angle."""
    found = modes(system)
    keep = [k for k, kind in enumerate(found.kinds) if kind not in (REFERENCE, CONSTANT)]
    return found.eigenvalues[keep]


# ---- what is written and printed ----


def _pair(value: complex) -> list[float]:
    return [float(value.real), float(value.imag)]


def _pairs(values: ComplexArray) -> list[list[float]]:
    return [_pair(value) for value in sorted(values, key=lambda v: (-v.real, abs(v.imag), -v.imag))]


def _write_tables(sweeps: Sequence[Sweep], files: dict[str, Path]) -> None:
    import io

    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["parameter", "unit", "model", "value", "real_per_s", "imag_rad_per_s", "frequency_hz", "stable"])
    for s in sweeps:
        for c in s.curves:
            for value, e in zip(c.values, c.rightmost, strict=True):
                frequency = abs(e.imag) / (2.0 * np.pi)
                rows.writerow(
                    [s.key, s.unit, c.model, f"{value:.8g}", f"{e.real:.8g}", f"{abs(e.imag):.8g}", f"{frequency:.6g}",
                     "yes" if e.real < 0.0 else "no"]
                )  # fmt: skip
    write_text(files["sweeps"], text.getvalue())
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["parameter", "unit", "model", "from", "to", "stable"])
    for s in sweeps:
        for c in s.curves:
            for low, high, stable in _ranges(c):
                rows.writerow([s.key, s.unit, c.model, f"{low:.6g}", f"{high:.6g}", "yes" if stable else "no"])
    write_text(files["limits"], text.getvalue())


def _ranges(curve: Curve) -> list[tuple[float, float, bool]]:
    """Stretches of the swept range that are stable or not."""
    ends = [float(curve.values[0]), *curve.limits, float(curve.values[-1])]
    first = bool(curve.rightmost.real[0] < 0.0)
    return [(low, high, first ^ bool(k % 2)) for k, (low, high) in enumerate(pairwise(ends))]


def _limit_text(curve: Curve, unit: str) -> str:
    parts = [f"{'stable' if stable else 'unstable'} {low:.4g} ... {high:.4g}" for low, high, stable in _ranges(curve)]
    return f"{curve.label}: {', '.join(parts)}{' ' + unit if unit else ''}"


def as_text(study: Study) -> str:
    """What the study found, in lines; then the paths."""
    checked, published = study.summary["theorem"], study.summary["published"]
    first = (
        f"{checked['sets']} random sets that meet its conditions: {checked['counter_examples']} counter-examples, "
        f"largest real part {checked['largest_real_part']:.3g} 1/s"
    )
    blind = (
        f"of the same sets, {checked['unstable_without_ratio_condition']} are unstable with another ratio of K_d, "
        f"{checked['unstable_with_negative_slope']} with K_wt < 0"
    )
    identity = f"dV/dt = -x'Wx holds to {checked['identity_error']:.2g} (relative)"
    lines = [f"theorem   {first}", f"          {identity}", f"          {blind}"]
    for name in ("published", "used"):
        one = published[name]
        holds = one["conditions"]["T_dc < K_d/K_theta"]["holds"]
        lines.append(
            f"{name:9} T_dc = {one['T_dc']:g} s, K_d = {published['K_d_gsc']:g} s: T_dc < K_d/K_theta = "
            f"{published['T_dc_limit']:.4g} s {'holds' if holds else 'is broken'}; rightmost eigenvalue "
            f"{_complex(one['rightmost_simplified'])} simplified, {_complex(one['rightmost_rms'])} full rms"
        )
    for sweep in study.sweeps:
        lines += ["", sweep.title]
        lines += [f"  {_limit_text(curve, sweep.unit)}" for curve in sweep.curves]
    return "\n".join([*lines, "", *(f"{name:8}  {path}" for name, path in study.files.items())])


def _complex(pair: Sequence[float]) -> str:
    return f"{pair[0]:.3g} ± {abs(pair[1]):.3g}j" if pair[1] else f"{pair[0]:.3g}"

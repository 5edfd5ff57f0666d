"""What the trade-off study found, in sentences whose numbers are computed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from gustform.mechanical.two_mass import TwoMass
from gustform_cli.study.tradeoff_capacitor import LARGEST
from gustform_cli.study.tradeoff_design import FR, MPPT, RANGES, Design
from gustform_cli.study.tradeoff_results import (
    BREAK_EVEN,
    CAPACITOR,
    DROOP,
    ENERGY,
    FATIGUE,
    FATIGUE_WIND,
    NADIR,
    OVERSPEED,
    PITCH,
    ROCOF,
    SHOCK,
    STABLE,
    TORSION,
    TORSION_HZ,
    Measure,
    Row,
    best,
    compromise,
    correlations,
    cost,
)

SHARE = 0.9  # of the paper's gain in nadir that a cheaper design must keep
_STRONG = 0.3  # rank correlation from which a parameter is said to move a measure
CORRELATED = (FATIGUE, FATIGUE_WIND, SHOCK, PITCH, CAPACITOR, NADIR, ROCOF, DROOP, ENERGY, OVERSPEED, TORSION)

Correlations = Mapping[str, Mapping[str, float]]


def described(design: Design) -> str:
    """The varied values of a design."""
    return (
        f"{100.0 * design.curtailment:.3g} % curtailment, K_msc x {design.K_msc_factor:.3g}, K_p x "
        f"{design.K_p_factor:.3g}, K_gsc {design.K_gsc:.3g}, K_d {1e3 * design.K_d_gsc:.3g} ms, T_dc "
        f"{1e3 * design.T_dc:.3g} ms, speed margin {design.speed_margin:.3g} pu"
    )


def findings(found: Sequence[Row], objectives: Sequence[Measure], steps_per_day: float) -> list[str]:
    """Sentences, the most important first."""
    by_name = {row.design.name: row for row in found if not row.problem}
    lines: list[str] = []
    if FR.name in by_name and MPPT.name in by_name:
        fr, mppt = by_name[FR.name], by_name[MPPT.name]
        lines += [_support(fr, mppt, steps_per_day), _fatigue(fr), *_cheaper(found, fr, mppt), *_smaller(found, fr)]
    lines += _moves(correlations(found, list(RANGES), CORRELATED))
    lines += [_front(found, objectives), *_capacitor(found), *_torsion(found), *_left_out(found)]
    return lines


def _support(fr: Row, mppt: Row, steps_per_day: float) -> str:
    a, b = mppt.measures, fr.measures
    return (
        f"**What support costs with the paper's gains.** {FR.name} ({100.0 * FR.curtailment:g} % curtailment) against "
        f"{MPPT.name}: the nadir of a 20 MW step rises by {1e3 * (b[NADIR.key] - a[NADIR.key]):.0f} mHz "
        f"({a[NADIR.key]:.3f} to {b[NADIR.key]:.3f} Hz), RoCoF falls from {abs(a[ROCOF.key]):.3f} to "
        f"{abs(b[ROCOF.key]):.3f} Hz/s. It costs {b[ENERGY.key]:.1f} % of the energy, "
        f"{_times(b[PITCH.key], a[PITCH.key])} the pitch travel ({a[PITCH.key]:.3f} to {b[PITCH.key]:.3f} deg/s) and "
        f"{_capacitors(a, b)}. The shaft's DEL changes by "
        f"{_percent(b[FATIGUE.key], a[FATIGUE.key])} at {steps_per_day:g} steps a day and by "
        f"{_percent(b[FATIGUE_WIND.key], a[FATIGUE_WIND.key])} in wind alone ({a[FATIGUE_WIND.key]:.3f} to "
        f"{b[FATIGUE_WIND.key]:.3f} MN m), while a step adds up to {b[SHOCK.key]:.2f} MN m to the torque instead of "
        f"{a[SHOCK.key]:.2f}."
    )


def _capacitors(a: Mapping[str, float], b: Mapping[str, float]) -> str:
    if math.isnan(a[CAPACITOR.key]) or math.isnan(b[CAPACITOR.key]):
        return "no capacitor in the range keeps the DC voltage for one of the two"
    return f"a DC-link capacitor of {b[CAPACITOR.key]:.3g} instead of {a[CAPACITOR.key]:.3g} mF"


def _fatigue(fr: Row) -> str:
    limit = fr.measures[BREAK_EVEN.key]
    if limit == 0.0:
        return "**Fatigue.** Its shaft is stressed more than that of GFM MPPT in wind alone."
    until = "however many steps there are" if math.isinf(limit) else f"up to {limit:.3g} such steps a day"
    return (
        f"**Wind and steps pull in opposite directions.** Turbulence moves the frequency of this grid, and a rotor "
        f"that follows the frequency gives way to it instead of passing it on: its shaft is stressed less than that "
        f"of {MPPT.name}, {until}. Each step then costs the shaft more."
    )


def _cheaper(found: Sequence[Row], fr: Row, mppt: Row) -> list[str]:
    """The least energy for most of the paper's nadir."""
    wanted = mppt.measures[NADIR.key] + SHARE * (fr.measures[NADIR.key] - mppt.measures[NADIR.key])
    cheap = best(
        found, lambda row: row.measures[ENERGY.key], lambda row: row.measures[NADIR.key] >= wanted and _usable(row)
    )
    if cheap is None or cheap is fr:
        return []
    m = cheap.measures
    text = (
        f"**Most of it for less energy.** At least {100.0 * SHARE:g} % of that gain in nadir is had for "
        f"{m[ENERGY.key]:.1f} % of the energy instead of {fr.measures[ENERGY.key]:.1f} %: {cheap.design.name} "
        f"({described(cheap.design)}) has {m[NADIR.key]:.3f} Hz, a DEL of {m[FATIGUE.key]:.3f} MN m (that of "
        f"{FR.name}: {fr.measures[FATIGUE.key]:.3f}), {m[PITCH.key]:.3f} deg/s and needs {m[CAPACITOR.key]:.3g} mF; "
        f"its rotor goes up to {m[OVERSPEED.key]:.3f} pu."
    )
    return [text]


def _smaller(found: Sequence[Row], fr: Row) -> list[str]:
    """The design that needs least capacitor for the paper's nadir."""
    own = fr.measures[CAPACITOR.key]
    small = best(
        found,
        lambda row: row.measures[CAPACITOR.key],
        lambda row: row.measures[NADIR.key] >= fr.measures[NADIR.key] and row is not fr,
    )
    if small is None or small.measures[CAPACITOR.key] >= own:
        return [f"**The capacitor of that nadir.** No sampled design has it with less than {FR.name}, {_or_none(own)}."]
    m = small.measures
    text = (
        f"**The capacitor of that nadir.** {small.design.name} ({described(small.design)}) has {m[NADIR.key]:.3f} Hz "
        f"with {m[CAPACITOR.key]:.3g} mF, where {FR.name} needs {_or_none(own)} (energy lost {m[ENERGY.key]:.1f} %, "
        f"DEL {m[FATIGUE.key]:.3f} MN m)."
    )
    return [text]


def _moves(ranks: Correlations) -> list[str]:
    if not ranks:
        return []
    parts = []
    for measure in (NADIR, FATIGUE_WIND, SHOCK, PITCH, ENERGY, CAPACITOR):
        strong = sorted(
            ((name, by[measure.key]) for name, by in ranks.items() if abs(by[measure.key]) >= _STRONG),
            key=lambda item: -abs(item[1]),
        )
        if strong:
            parts.append(f"{measure.name} by " + ", ".join(f"{name} ({rank:+.2f})" for name, rank in strong))
    return [
        f"**What moves what** (rank correlation over the sampled designs, {_STRONG:g} and more): {'; '.join(parts)}."
    ]


def _front(found: Sequence[Row], objectives: Sequence[Measure]) -> str:
    front = [row for row in found if row.front]
    names = ", ".join(objective.name for objective in objectives)
    text = f"**The front.** {len(front)} of {len(found)} designs are not dominated in {names}."
    inside = [row.design.name for row in front if row.design in (FR, MPPT)]
    text += f" The paper's {' and '.join(inside)} {'are' if len(inside) > 1 else 'is'} among them." if inside else ""
    chosen = compromise(found, objectives)
    if chosen is not None:
        m = chosen.measures
        text += (
            f" Nearest to the best of each is {chosen.design.name} ({described(chosen.design)}): nadir "
            f"{m[NADIR.key]:.3f} Hz, DEL {m[FATIGUE.key]:.3f} MN m, {_or_none(m[CAPACITOR.key])}, "
            f"{m[PITCH.key]:.3f} deg/s, energy lost {m[ENERGY.key]:.1f} %."
        )
    return text


def _capacitor(found: Sequence[Row]) -> list[str]:
    good = [row for row in found if not row.problem]
    if not good:
        return []
    unstable = [row for row in good if row.measures[STABLE.key] == 0.0]
    none = [row for row in good if math.isnan(row.measures[CAPACITOR.key])]
    known = [row.measures[CAPACITOR.key] for row in good if not math.isnan(row.measures[CAPACITOR.key])]
    text = f"**The capacitor.** With the source paper's 31.88 mF, {len(unstable)} of {len(good)} designs are unstable"
    text += f"; for {len(none)} no capacitor up to {1e3 * LARGEST:g} mF does." if none else "."
    if known:
        text += f" The others need {min(known):.3g} to {max(known):.3g} mF."
    return [text]


def _torsion(found: Sequence[Row]) -> list[str]:
    good = [row for row in found if not row.problem]
    if not good:
        return []
    shaft = TwoMass()
    inertia = 1.0 / shaft.J_r + 1.0 / shaft.J_g
    free = math.sqrt(shaft.K * inertia)
    damping = 0.5 * shaft.D * inertia / free
    lowest = min(good, key=lambda row: row.measures[TORSION.key])
    highest = max(good, key=lambda row: row.measures[TORSION.key])
    hertz = [row.measures[TORSION_HZ.key] for row in good]
    stable = "no design makes it unstable" if lowest.measures[TORSION.key] > 0.0 else "it becomes unstable"
    text = (
        f"**The shaft's own mode** is at {free / (2.0 * math.pi):.2f} Hz with a damping ratio of "
        f"{100.0 * damping:.1f} % between free ends. With the control it is at {min(hertz):.2f} to {max(hertz):.2f} Hz "
        f"with {100.0 * lowest.measures[TORSION.key]:.1f} % ({lowest.design.name}) to "
        f"{100.0 * highest.measures[TORSION.key]:.1f} % ({highest.design.name}): {stable}."
    )
    return [text]


def _left_out(found: Sequence[Row]) -> list[str]:
    bad = [row for row in found if row.problem]
    if not bad:
        return []
    return [f"**Left out** are {len(bad)} designs, e.g. {bad[0].design.name}: {bad[0].problem}"]


def _usable(row: Row) -> bool:
    return not math.isnan(cost(row, CAPACITOR))


def _times(value: float, base: float) -> str:
    return f"{value / base:.2f} times" if base > 0.0 else "more than"


def _or_none(capacitor: float) -> str:
    return "no capacitor that does" if math.isnan(capacitor) else f"{capacitor:.3g} mF"


def _percent(value: float, base: float) -> str:
    return f"{100.0 * (value / base - 1.0):+.0f} %"

"""From the records of both campaigns to one row for each design: what it costs and what it gives.

Over wind speeds and seeds, which count alike:

    DEL (1 Hz)      (mean damage rate + steps a day / 86400 s * mean damage of a step)^(1/4)
    nadir, RoCoF    means; the deepest nadir beside them
    droop           -(mean settling deviation of frequency, pu) / (mean gain of turbine power, pu)
    energy lost     1 - energy / energy of GFM MPPT in the same winds
    capacitor       largest over the wind speeds; none if the slow part of the DC voltage alone leaves the band
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gustform.conventions import NOMINAL_FREQUENCY
from gustform_cli.study.pareto import non_dominated
from gustform_cli.study.tradeoff_capacitor import BAND
from gustform_cli.study.tradeoff_design import MPPT, Design
from gustform_cli.study.tradeoff_wind import EXPONENT
from gustform_cli.sweep.store import Record

Measures = Mapping[str, float]
DAY = 86400.0  # s


@dataclass(frozen=True)
class Measure:
    """A column: its key, unit and name, and whether more of it is better."""

    key: str
    unit: str
    name: str
    more: bool = False


FATIGUE = Measure("del_mnm", "MN m", "shaft DEL, steps included")
FATIGUE_WIND = Measure("del_wind_mnm", "MN m", "shaft DEL in wind alone")
SHOCK = Measure("shock_mnm", "MN m", "largest shaft torque that the step adds")
PITCH = Measure("pitch_travel_deg_per_s", "deg/s", "pitch travel")
CAPACITOR = Measure("capacitor_mf", "mF", "smallest DC-link capacitor")
NADIR = Measure("nadir_hz", "Hz", "nadir", more=True)
NADIR_WORST = Measure("nadir_worst_hz", "Hz", "deepest nadir", more=True)
ROCOF = Measure("rocof_hz_per_s", "Hz/s", "RoCoF over 0.5 s", more=True)
SETTLE = Measure("settle_hz", "Hz", "40 to 60 s after the step", more=True)
DROOP = Measure("droop_percent", "%", "droop")
ENERGY = Measure("energy_lost_percent", "%", "energy lost")
WANDER = Measure("frequency_std_hz", "Hz", "standard deviation of the frequency in wind alone")
V_DC_MIN = Measure("v_dc_min_pu", "pu", "lowest DC voltage", more=True)
V_DC_MAX = Measure("v_dc_max_pu", "pu", "highest DC voltage")
OVERSPEED = Measure("omega_r_max_pu", "pu", "highest rotor speed")
BREAK_EVEN = Measure("break_even_per_day", "1/d", "steps a day at which its shaft DEL meets that of GFM MPPT", True)
TORSION = Measure("torsion_damping", "1", "damping ratio of the shaft's mode", more=True)
TORSION_HZ = Measure("torsion_hz", "Hz", "frequency of the shaft's mode")
STABLE = Measure("stable_with_given_capacitor", "1", "1: stable with the source paper's capacitor", more=True)
MEASURES = (
    FATIGUE, FATIGUE_WIND, SHOCK, PITCH, CAPACITOR, NADIR, NADIR_WORST, ROCOF, SETTLE, DROOP, ENERGY, WANDER, V_DC_MIN,
    V_DC_MAX, OVERSPEED, BREAK_EVEN, TORSION, TORSION_HZ, STABLE,
)  # fmt: skip
OBJECTIVES = {
    "fatigue": FATIGUE,
    "pitch": PITCH,
    "capacitor": CAPACITOR,
    "nadir": NADIR,
    "rocof": ROCOF,
    "droop": DROOP,
    "energy": ENERGY,
}


@dataclass(frozen=True)
class Row:
    """A design with its measures over all winds and by wind speed; `problem` says why it is left out, if it is."""

    design: Design
    measures: Measures
    by_wind: Mapping[float, Measures]
    problem: str = ""
    front: bool = False


def rows(
    designs: Sequence[Design],
    winds: Sequence[float],
    in_wind: Mapping[str, Sequence[Record]],
    with_capacitor: Mapping[str, Sequence[Record]],
    steps_per_day: float,
    objectives: Sequence[Measure],
) -> list[Row]:
    """A row for each design, the non-dominated ones marked."""

    def row(design: Design) -> Row:
        wind, capacitor = in_wind[design.name], with_capacitor[design.name]
        problem = _problem(wind, capacitor)
        if problem:
            return Row(design, {}, {}, problem)
        seeds = len(wind) // len(winds)
        reference = in_wind[MPPT.name]
        by_wind = {
            speed: _measures(
                wind[k * seeds : (k + 1) * seeds],
                capacitor[k : k + 1],
                reference[k * seeds : (k + 1) * seeds],
                steps_per_day,
            )
            for k, speed in enumerate(winds)
        }
        return Row(design, _measures(wind, capacitor, reference, steps_per_day), by_wind)

    found = [row(design) for design in designs]
    costs = np.array([[cost(one, objective) for objective in objectives] for one in found])
    front = non_dominated(costs)
    return [replace(one, front=bool(inside)) for one, inside in zip(found, front, strict=True)]


def cost(row: Row, measure: Measure) -> float:
    """A measure so that less is better; NaN where there is none."""
    value = row.measures.get(measure.key, math.nan)
    return -value if measure.more else value


def _problem(wind: Sequence[Record], capacitor: Sequence[Record]) -> str:
    for record in (*wind, *capacitor):
        if record.fault is not None:
            return f"{record.fault.code}: {record.fault.message.splitlines()[0]}"
    if any(record.scalars["tripped"] for record in wind):
        return "the DC voltage collapsed"
    return ""


def _measures(
    wind: Sequence[Record], capacitor: Sequence[Record], reference: Sequence[Record], steps_per_day: float
) -> dict[str, float]:
    def all_of(key: str, records: Sequence[Record] = wind) -> list[float]:
        return [record.scalars[key] for record in records]

    def mean(key: str, records: Sequence[Record] = wind) -> float:
        return float(np.mean(all_of(key, records)))

    rate, step = mean("damage_rate"), mean("damage_of_step")
    low, high = min(all_of("v_dc_min_pu")), max(all_of("v_dc_max_pu"))
    within = 1.0 - low <= BAND and high - 1.0 <= BAND
    gained = mean("settle_power_pu")
    deviation = (NOMINAL_FREQUENCY - mean("settle_hz")) / NOMINAL_FREQUENCY
    return {
        FATIGUE.key: _equivalent(rate + step * steps_per_day / DAY),
        FATIGUE_WIND.key: _equivalent(rate),
        SHOCK.key: max(all_of("shock_nm")) / 1e6,
        PITCH.key: mean("pitch_travel_deg_per_s"),
        CAPACITOR.key: 1e3 * max(all_of("capacitor_f", capacitor)) if within else math.nan,
        NADIR.key: mean("nadir_hz"),
        NADIR_WORST.key: min(all_of("nadir_hz")),
        ROCOF.key: mean("rocof_hz_per_s"),
        SETTLE.key: mean("settle_hz"),
        DROOP.key: 100.0 * deviation / gained if gained > 0.0 else math.inf,
        ENERGY.key: 100.0 * (1.0 - mean("power_pu") / mean("power_pu", reference)),
        WANDER.key: mean("frequency_std_hz"),
        V_DC_MIN.key: low,
        V_DC_MAX.key: high,
        OVERSPEED.key: max(all_of("omega_r_max_pu")),
        BREAK_EVEN.key: _break_even(rate, step, mean("damage_rate", reference), mean("damage_of_step", reference)),
        TORSION.key: min(all_of("torsion_damping", capacitor)),
        TORSION_HZ.key: mean("torsion_hz", capacitor),
        STABLE.key: min(all_of("stable", capacitor)),
    }


def _equivalent(rate: float) -> float:
    """Damage per second as the range, MN m, that does it once a second. A step may take cycles from the wind's: less
    than none is none."""
    return float(max(rate, 0.0) ** (1.0 / EXPONENT))


def _break_even(rate: float, step: float, reference_rate: float, reference_step: float) -> float:
    """Steps a day at which both do the same damage: inf if the reference is worse at any number, 0 if better in wind
    alone."""
    if rate >= reference_rate:
        return 0.0
    return DAY * (reference_rate - rate) / (step - reference_step) if step > reference_step else math.inf


def compromise(found: Sequence[Row], objectives: Sequence[Measure]) -> Row | None:
    """The member of the front that is nearest to the best of everything, each objective measured in its range there."""
    front = [row for row in found if row.front]
    if not front:
        return None
    costs = np.array([[cost(row, objective) for objective in objectives] for row in front])
    low, high = costs.min(axis=0), costs.max(axis=0)
    distance = np.linalg.norm((costs - low) / np.where(high > low, high - low, 1.0), axis=1)
    return front[int(np.argmin(distance))]


def correlations(
    found: Sequence[Row], names: Sequence[str], measures: Sequence[Measure]
) -> dict[str, dict[str, float]]:
    """Spearman's rank correlation of each varied value with each measure, over the sampled designs."""
    from scipy.stats import spearmanr

    sampled = [row for row in found if not row.problem and row.design.name.startswith("design")]
    if len(sampled) < _FEWEST:
        return {}

    def rank(name: str, measure: Measure) -> float:
        x = np.array([getattr(row.design, name) for row in sampled])
        y = np.array([row.measures[measure.key] for row in sampled])
        known = ~np.isnan(y)
        return float(spearmanr(x[known], y[known]).statistic) if known.sum() >= _FEWEST else math.nan

    return {name: {measure.key: rank(name, measure) for measure in measures} for name in names}


_FEWEST = 10  # designs for a correlation that says something


def best(found: Sequence[Row], key: Callable[[Row], float], among: Callable[[Row], bool]) -> Row | None:
    """The row with the smallest `key` among those that are complete and pass."""
    fitting = [row for row in found if not row.problem and among(row) and not math.isnan(key(row))]
    return min(fitting, key=key, default=None)

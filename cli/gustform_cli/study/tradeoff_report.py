"""report.md of the trade-off study."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gustform_cli.study.paper_tables import markdown
from gustform_cli.study.tradeoff_capacitor import BAND
from gustform_cli.study.tradeoff_design import PAPER, RANGES
from gustform_cli.study.tradeoff_findings import CORRELATED, findings
from gustform_cli.study.tradeoff_results import (
    CAPACITOR,
    DROOP,
    ENERGY,
    FATIGUE,
    FATIGUE_WIND,
    NADIR,
    PITCH,
    ROCOF,
    SHOCK,
    Measure,
    Row,
    compromise,
    correlations,
)

_HEAD = """# Stress, capacitor and grid support traded against each other

{designs} designs (curtailment and gains of dual-port control) at {winds} m/s, {seeds} winds each of class B turbulence,
{runs} runs of 720 s with the two-mass drive train; for each design and wind speed the smallest DC-link capacitor.
Written by `gustform study tradeoff`. All designs are in `designs.csv`, the non-dominated ones in `pareto.csv`, cases
in `runs.csv` and `wind/scalars.parquet`, capacitors in `capacitor/scalars.parquet`.

![Trade-off](tradeoff.png)

## Findings
"""

_TABLE = (NADIR, ROCOF, DROOP, FATIGUE, FATIGUE_WIND, SHOCK, PITCH, CAPACITOR, ENERGY)
_NOTE = f"""Means over wind speeds and seeds; DEL: exponent 4, 1 Hz, rainflow of ASTM E1049, with {{steps:g}} steps of
20 MW a day; capacitor: the smallest that keeps the DC voltage within {100 * BAND:g} % at fidelity dq, at the wind speed
that asks for most."""


def report(
    found: Sequence[Row], objectives: Sequence[Measure], winds: Sequence[float], seeds: int, steps_per_day: float
) -> str:
    """The report as Markdown."""
    chosen = compromise(found, objectives)
    shown = [row for row in found if row.design in PAPER]
    if chosen is not None and chosen not in shown:
        shown.append(chosen)
    front = sorted((row for row in found if row.front), key=lambda row: -row.measures[NADIR.key])
    parts = [
        _HEAD.format(
            designs=len(found), winds=", ".join(f"{wind:g}" for wind in winds), seeds=seeds,
            runs=2 * len(found) * len(winds) * seeds,
        ),
        *(f"- {line}" for line in findings(found, objectives, steps_per_day)),
        "\n## By wind speed\n",
        _by_wind([row for row in shown if not row.problem], winds),
        "\n## The non-dominated designs\n",
        _NOTE.format(steps=steps_per_day) + "\n",
        _rows(front),
    ]  # fmt: skip
    ranks = correlations(found, list(RANGES), CORRELATED)
    if ranks:
        head = ["", *(measure.name for measure in CORRELATED)]
        body = [[name, *(_rank(by[measure.key]) for measure in CORRELATED)] for name, by in ranks.items()]
        parts += ["\n## Rank correlations over the sampled designs\n", markdown(head, body)]
    return "\n".join(parts) + "\n"


def _rows(rows: Sequence[Row]) -> str:
    head = ["design", *RANGES, *(f"{measure.name}, {measure.unit}" for measure in _TABLE)]
    return markdown(
        head,
        [
            [
                row.design.name,
                *(f"{getattr(row.design, name):.3g}" for name in RANGES),
                *(_number(row.measures[measure.key], measure) for measure in _TABLE),
            ]
            for row in rows
        ],
    )


def _by_wind(rows: Sequence[Row], winds: Sequence[float]) -> str:
    head = ["design", "wind, m/s", *(f"{measure.name}, {measure.unit}" for measure in _TABLE)]
    return markdown(
        head,
        [
            [
                row.design.name,
                f"{wind:g}",
                *(_number(row.by_wind[wind][measure.key], measure) for measure in _TABLE),
            ]
            for row in rows
            for wind in winds
        ],
    )


def _number(value: float, measure: Measure) -> str:
    if math.isnan(value):
        return "-"
    return f"{value:.3f}" if measure.unit in ("Hz", "Hz/s") else f"{value:.3g}"


def _rank(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:+.2f}"

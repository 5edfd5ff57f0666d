"""Tables of the trade-off study: runs.csv, designs.csv and pareto.csv."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gustform_cli.study.tradeoff_design import RANGES, Design
from gustform_cli.study.tradeoff_results import MEASURES, Row
from gustform_cli.sweep.store import Record
from gustform_cli.writing import writing

_DIGITS = 7


def write_runs(
    file: Path, designs: Sequence[Design], winds: Sequence[float], in_wind: Mapping[str, Sequence[Record]]
) -> None:
    """One row for each case in wind: what was set and what was measured, without the times it took."""
    scalars = list(dict.fromkeys(name for records in in_wind.values() for record in records for name in record.scalars))
    head = ["design", *RANGES, "wind_m_per_s", "seed", "status", *scalars]
    rows = []
    for design in designs:
        records = in_wind[design.name]
        seeds = len(records) // len(winds)
        for k, record in enumerate(records):
            rows.append(
                [
                    design.name,
                    *_numbers(getattr(design, name) for name in RANGES),
                    f"{winds[k // seeds]:g}",
                    k % seeds + 1,
                    record.status,
                    *_numbers(record.scalars.get(name, math.nan) for name in scalars),
                ]
            )
    _write(file, head, rows)


def write_designs(file: Path, rows: Iterable[Row]) -> None:
    """One row for each design."""
    head = ["design", *RANGES, *(measure.key for measure in MEASURES), "non_dominated", "problem"]
    _write(
        file,
        head,
        [
            [
                row.design.name,
                *_numbers(getattr(row.design, name) for name in RANGES),
                *_numbers(row.measures.get(measure.key, math.nan) for measure in MEASURES),
                int(row.front),
                row.problem,
            ]
            for row in rows
        ],
    )


def _numbers(values: Iterable[float]) -> list[str]:
    """Numbers as text; empty where there is none."""
    return ["" if math.isnan(value) else f"{value:.{_DIGITS}g}" for value in values]


def _write(file: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with writing(file), file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)

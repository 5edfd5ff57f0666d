"""The source paper's open question by campaign: stress of the turbine, size of the DC-link capacitor and support of the
grid, traded against each other over the gains of dual-port control and curtailment in turbulent wind."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.interrupt import Interrupt
from gustform_cli.quantity import parse_quantity
from gustform_cli.result import prepare_folder
from gustform_cli.study.tradeoff_campaigns import Swept, capacitor_campaign, run, wind_campaign
from gustform_cli.study.tradeoff_design import RANGES, designs
from gustform_cli.study.tradeoff_findings import CORRELATED, findings
from gustform_cli.study.tradeoff_report import report
from gustform_cli.study.tradeoff_results import OBJECTIVES, Row, compromise, correlations, rows
from gustform_cli.study.tradeoff_tables import write_designs, write_runs
from gustform_cli.versions import versions
from gustform_cli.writing import write_text

WIND, CAPACITOR = "wind", "capacitor"
FIGURE, REPORT, SUMMARY = "tradeoff.png", "report.md", "summary.json"
RUNS, DESIGNS, PARETO = "runs.csv", "designs.csv", "pareto.csv"


@dataclass(frozen=True)
class Settings:
    """How large the study is and what it judges by. Wind speeds in m/s; `objectives`: keys of OBJECTIVES."""

    n: int = 96
    winds: tuple[float, ...] = (8.0, 10.0, 12.0)
    seeds: int = 2
    seed: int = 1
    steps_per_day: float = 24.0
    objectives: tuple[str, ...] = ("fatigue", "capacitor", "nadir", "energy")


@dataclass(frozen=True)
class Study:
    """What the study left behind. `status`: completed or interrupted."""

    status: str
    lines: Sequence[str]
    summary: Mapping[str, Any]
    paths: Mapping[str, str]
    ran: int
    kept: int
    seconds: float

    def as_json(self) -> str:
        """The summary."""
        return json.dumps(self.summary, indent=2)

    def as_text(self) -> str:
        """The findings, without the marks of Markdown, and the files."""
        lines = [line.replace("**", "") for line in self.lines]
        files = [f"{name:10} {path}" for name, path in self.paths.items()]
        cases = f"{self.ran} cases run, {self.kept} had been run before; {self.seconds:.1f} s"
        return "\n\n".join([*lines, "\n".join([*files, cases])])


def speeds(texts: Sequence[str]) -> tuple[float, ...]:
    """Wind speeds as they are written, m/s, in order. GF23xx for what is no speed, GF2003 for one given twice."""
    found = [parse_quantity(text, "m/s", "--wind", "mean wind speed") for text in texts]
    if len(set(found)) < len(found):
        twice = next(speed for speed in found if found.count(speed) > 1)
        raise GustformError(
            "GF2003", f"--wind must be given once for each speed; got {twice:g} m/s twice", hint="--seeds 2"
        )
    return tuple(sorted(found))


def tradeoff(out: Path, settings: Settings, workers: int, interrupt: Interrupt) -> Study:
    """Run what is missing of both campaigns, then write tables, figure and report into the folder `out`."""
    begin = time.perf_counter()
    chosen = designs(settings.n, settings.seed)
    winds = settings.winds
    # Before anything is written: a wind that has no operating point is refused here.
    in_wind = wind_campaign(chosen, winds, settings.seeds)
    prepare_folder(out)
    interrupt.running(lambda: None)  # from here on a signal ends the study, with what it has
    wind = run(in_wind, out / WIND, workers, interrupt)
    capacitor = run(capacitor_campaign(chosen, winds), out / CAPACITOR, workers, interrupt) if wind.complete else None
    if capacitor is None or not capacitor.complete:
        there = {"wind": wind.table, **({"capacitor": capacitor.table} if capacitor is not None else {})}
        return _interrupted(there, [wind, *([capacitor] if capacitor is not None else [])], begin)
    interrupt.closing()
    objectives = [OBJECTIVES[name] for name in settings.objectives]
    found = rows(chosen, winds, wind.records, capacitor.records, settings.steps_per_day, objectives)
    paths = {
        "figure": out / FIGURE, "report": out / REPORT, "pareto": out / PARETO, "designs": out / DESIGNS,
        "runs": out / RUNS, "wind": wind.table, "capacitor": capacitor.table, "summary": out / SUMMARY,
    }  # fmt: skip
    lines = findings(found, objectives, settings.steps_per_day)
    summary = _summary(settings, found, lines) | {"paths": {name: str(path) for name, path in paths.items()}}
    write_runs(paths["runs"], chosen, winds, wind.records)
    write_designs(paths["designs"], found)
    write_designs(paths["pareto"], (row for row in found if row.front))
    write_text(paths["report"], report(found, objectives, winds, settings.seeds, settings.steps_per_day))
    write_text(paths["summary"], json.dumps(summary, indent=2) + "\n")
    from gustform_cli.study.tradeoff_figure import draw  # a second of imports

    draw(found, objectives, settings.steps_per_day, paths["figure"])
    return Study(
        "completed", lines, summary, {name: str(path) for name, path in paths.items()}, wind.ran + capacitor.ran,
        wind.kept + capacitor.kept, time.perf_counter() - begin,
    )  # fmt: skip


def _interrupted(there: Mapping[str, Path], swept: Sequence[Swept], begin: float) -> Study:
    paths = {name: str(path) for name, path in there.items()}
    ran, kept = sum(one.ran for one in swept), sum(one.kept for one in swept)
    return Study("interrupted", [], {}, paths, ran, kept, time.perf_counter() - begin)


def _summary(settings: Settings, found: Sequence[Row], lines: Sequence[str]) -> dict[str, Any]:
    chosen = compromise(found, [OBJECTIVES[name] for name in settings.objectives])
    return {
        "settings": asdict(settings),
        "findings": [line.replace("**", "") for line in lines],
        "designs": [_as_dict(row) for row in found],
        "pareto": [row.design.name for row in found if row.front],
        "compromise": chosen.design.name if chosen is not None else None,
        "rank_correlation": _finite(correlations(found, list(RANGES), CORRELATED)),
        "versions": versions(),
    }


def _as_dict(row: Row) -> dict[str, Any]:
    return {
        "name": row.design.name,
        **{name: getattr(row.design, name) for name in RANGES},
        "non_dominated": row.front,
        "problem": row.problem or None,
        "measures": _finite(row.measures),
        "by_wind": {f"{wind:g}": _finite(measures) for wind, measures in row.by_wind.items()},
    }


def _finite(tree: Any) -> Any:
    """null where JSON has no number."""
    if isinstance(tree, Mapping):
        return {key: _finite(value) for key, value in tree.items()}
    return tree if not isinstance(tree, float) or math.isfinite(tree) else None

"""The paper's case study as one command: nine cases side by side, figures, tables beside the published, a report."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.errors import ErrorList
from gustform_cli.interrupt import Interrupt
from gustform_cli.result import prepare_folder
from gustform_cli.run import Ended
from gustform_cli.study import paper_findings as findings
from gustform_cli.study import published
from gustform_cli.study.droop_map import draw as draw_droop_map
from gustform_cli.study.paper_cases import CASES, GFM_FR, TURBINE, WINDS, Case, build, run
from gustform_cli.study.paper_report import closing, report
from gustform_cli.writing import write_text
from gustform_codegen.modes import modes

CASES_FOLDER, SUMMARY, REPORT = "cases", "summary.json", "report.md"
CASE_FIGURE, EIGENVALUES, DROOP_MAP = "paper_{}ms.png", "eigenvalues.png", "droop_map.png"


@dataclass(frozen=True)
class Study:
    """What the study left behind. Interrupted: no summary, and of the cases those that had begun."""

    status: str  # completed, interrupted
    summary: dict[str, Any]
    numbers: dict[str, float]
    paths: dict[str, str]

    def as_text(self) -> str:
        """Paths and one table."""
        return closing(self.numbers, self.paths)

    def as_json(self) -> str:
        """The summary with the paths of the files."""
        return json.dumps({**self.summary, "paths": self.paths}, indent=2)


def paper(out: Path, fidelity: str, jobs: int, interrupt: Interrupt) -> Study:
    """Run the study into the folder `out`. Raises what went wrong in building, or in a case after all others ran."""
    cases = out / CASES_FOLDER
    prepare_folder(out)
    prepare_folder(cases)
    begin = time.perf_counter()

    def say(text: str) -> None:
        print(f"[{time.perf_counter() - begin:5.1f} s] {text}", file=sys.stderr, flush=True)

    built = [build(case, fidelity) for case in CASES]
    compiled = sum(b.model.built.compilations for b in built)
    say(f"{len(built)} cases built at fidelity {fidelity}, {compiled} component types compiled now")
    _clear(out, cases)
    ended = run(built, cases, jobs, interrupt)
    complete = [case for case, end in ended.items() if end.summary.status == "completed"]
    say(f"{len(complete)} of {len(built)} cases run, {jobs} at a time")
    if interrupt.requested:
        return Study("interrupted", {}, {}, {case.name: str(end.result) for case, end in ended.items()})
    _raise_failures(ended)
    results = {case: end.result for case, end in ended.items()}

    found = {case: modes(findings.linear(case, fidelity).linear(TURBINE, {})) for case in CASES}
    T_dc = next(p.value for p in published.CONTROL if p.key == "control.T_dc")
    stability = findings.stability(Case(GFM_FR, WINDS[0]), fidelity, [T_dc])
    eigenvalues: dict[str, dict[str, list[list[float]]]] = {}
    for case, one in found.items():
        eigenvalues.setdefault(case.control.key, {})[str(case.wind)] = findings.as_pairs(one)
    droop = findings.droop(built)
    summary: dict[str, Any] = {
        "frequency": findings.frequency(ended),
        "gains": findings.gains(built),
        "droop_map": {"eta": droop.eta, "wind": droop.wind, "m_p_percent": droop.percent()},
        "eigenvalues": eigenvalues,
    }
    numbers = {
        **findings.flat({"frequency": summary["frequency"], "gains": summary["gains"]}),
        **findings.details(built),
        **findings.theorem_check(),
    }
    say("linearised, droop map, theorem checked")

    from gustform_cli.study import paper_figures as draw  # half a second of imports, after the runs

    figures = {
        f"20 MW load step at {wind} m/s": draw.case_figure(
            wind, results, summary["frequency"], out / CASE_FIGURE.format(wind)
        )
        for wind in WINDS
    }
    figures["Smallest achievable droop"] = draw_droop_map(droop, out / DROOP_MAP)
    figures["Eigenvalues before the load step"] = draw.eigenvalue_figure(found, out / EIGENVALUES)
    rtol = built[0].model.assembled.scenario.run.rtol
    text = report(fidelity, rtol, summary["frequency"], numbers, stability, droop, figures)
    paths = {
        "report": str(write_text(out / REPORT, text)),
        "summary": str(write_text(out / SUMMARY, json.dumps(summary, indent=2) + "\n")),
        "cases": str(cases),
        **{file.stem: str(file) for file in figures.values()},
    }
    say("figures and report written")
    return Study("completed", summary, numbers, paths)


def _clear(out: Path, cases: Path) -> None:
    """What an earlier study left would not belong to this one."""
    figures = [CASE_FIGURE.format(wind) for wind in WINDS]
    for name in (SUMMARY, REPORT, EIGENVALUES, DROOP_MAP, *figures):
        (out / name).unlink(missing_ok=True)
    for case in CASES:
        for name in (f"{case.name}.nc", f"{case.name}.nc.part"):
            (cases / name).unlink(missing_ok=True)


def _raise_failures(ended: Mapping[Case, Ended]) -> None:
    """What made cases fail, each with the name of its case."""
    failures = [
        GustformError(end.error.code, f"case {case.name}: {end.error.message}", hint=end.error.hint)
        for case, end in ended.items()
        if end.error is not None
    ]
    if failures:
        raise ErrorList(failures)

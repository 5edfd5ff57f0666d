"""`make bench`: tables of ratios, each measured in this one run.

(a) the turbulent scenario against a bare IDA + KLU program on the same condensed equations;
(b) the farm against CasADi's `idas`, with and without JIT, for N = 1, 10, 100 turbines, building apart from solving;
(c) building and time per turbine-step for N = 1, 10, 100, 1000 turbines, and the way from the YAML to the first row;
(d) a day of 20 Hz wind and a year of measured wind against both, and what statistics, rows, checkpoints, events cost;
(e) sampled controls against the continuous one.

Machines are noisy: runs of both sides alternate, the smallest time of each counts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.bench.long_runs import long_runs
from tests.bench.peers import BareProgram, CasadiIdas, NotCompiledError, Wind
from tests.bench.samples import samples
from tests.support.case import SCENARIOS, Case, open_case

_RTOL = 1e-6
_ATOL = 1e-6  # of nominal, for all sides
console = Console(width=120)


def _timed(case: Case, until: float, **sink: float) -> tuple[float, dict[str, int | float], Any]:
    """Seconds of the integration alone, statistics, unknowns at the end; with `every=` rows are produced too."""
    channels = tuple(c.name for c in case.model.channels) if sink else ()
    with case.simulation(channels, rtol=_RTOL, atol=_ATOL) as simulation:
        if sink:
            simulation.set_sink(sink["every"], lambda t, rows: None)
        simulation.initialise(0.0)
        begin = time.perf_counter()
        simulation.advance(until)
        seconds = time.perf_counter() - begin
        return seconds, simulation.statistics(), simulation.state()[1]


def _table(title: str, columns: list[str], rows: list[list[str]]) -> None:
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(columns):
        table.add_column(column, justify="left" if number == 0 else "right")
    for row in rows:
        table.add_row(*row)
    console.print(table)


def _difference(a: Any, b: Any, nominal: Any) -> float:
    return float(np.max(np.abs(a - b) / nominal))


def bare(hours: float, repeats: int, folder: Path) -> dict[str, Any]:
    """(a) Against the bare program."""
    until = 3600.0 * hours
    case = open_case("turbulent_10min", f"run.until={until} s")
    every = case.assembled.scenario.output.every
    dt, samples = case.wind(until)
    wind = Wind(dt, samples)
    program = BareProgram(case.model.built.linked, case.table, folder / "bare")
    runs = []
    for _ in range(repeats):  # the sides alternate, so that a busy moment hits both
        runs.append((_timed(case, until), program.run(wind, until, _RTOL, _ATOL), _timed(case, until, every=every)[0]))
    mine = min(seconds for (seconds, _, _), _, _ in runs)
    with_output = min(seconds for _, _, seconds in runs)
    theirs = min(peer.solve_seconds for _, peer, _ in runs)
    (_, statistics, final), peer, _ = runs[0]
    steps = int(statistics["steps"])
    ratio, ratio_with_output = theirs / mine, theirs / with_output
    difference = _difference(final, peer.final, case.table.nominal)
    n = case.table.n_unknowns

    def row(name: str, steps: int, seconds: float, ratio: float) -> list[str]:
        return [name, str(steps), f"{1e6 * seconds / steps:.2f}", f"{until / seconds:,.0f}", f"{ratio:.2f}"]

    _table(
        f"(a) turbulent scenario, {hours:g} h of 20 Hz wind, {n} unknowns, rtol {_RTOL:g}, atol {_ATOL:g} of nominal",
        ["", "steps", "us/step", "x real time", "bare / gustform (goal: 3 or more)"],
        [
            row("bare IDA + KLU program", peer.steps, theirs, 1.0),
            row("gustform", steps, mine, ratio),
            row(f"gustform, every channel each {every:g} s", steps, with_output, ratio_with_output),
        ],
    )
    console.print(f"largest difference of an unknown at the end: {difference:.1e} of nominal\n")
    return {
        "unknowns": n,
        "simulated_seconds": until,
        "steps": {"gustform": steps, "bare": peer.steps},
        "seconds": {"gustform": mine, "gustform with output": with_output, "bare": theirs},
        "ratio": ratio,
        "ratio_with_output": ratio_with_output,
        "difference_at_end_of_nominal": difference,
    }


def casadi(counts: list[int], seconds: dict[int, float], repeats: int, jit_limit: int) -> dict[str, Any]:
    """(b) Against CasADi's idas."""
    result: dict[str, Any] = {}
    rows = []
    for n in counts:
        until = seconds[n]
        case = open_case("farm", f"turbines={n}", f"run.until={until} s")
        build = [_fresh_build(n) for _ in range(2)]
        dt, samples = case.wind(until)
        wind = Wind(dt, samples)
        ours = [_timed(case, until) for _ in range(repeats)]
        mine = min(t for t, _, _ in ours)
        entry: dict[str, Any] = {"build_seconds": min(build), "solve_seconds": mine}
        rows.append([f"N = {n}: gustform", f"{min(build):.2f}", "1", f"{mine:.3f}", "1", str(ours[0][1]["steps"]), ""])
        for jit in (None, jit_limit):
            label, name = ("casadi_jit", "CasADi idas, JIT") if jit else ("casadi", "CasADi idas")
            try:
                peer = CasadiIdas(case.model.built.linked, case.table, wind, until, _RTOL, _ATOL, jit=jit)
            except NotCompiledError as error:
                entry[label] = {"error": str(error)}
                rows.append([f"N = {n}: {name}", f"gave up {error}", "-", "-", "-", "-", "-"])
                continue
            runs = [peer.run() for _ in range(repeats if n < 100 else 1)]
            theirs = min(r.solve_seconds for r in runs)
            entry[label] = {
                "build_seconds": peer.build_seconds,
                "solve_seconds": theirs,
                "build_ratio": peer.build_seconds / min(build),
                "solve_ratio": theirs / mine,
                "difference_at_end_of_nominal": _difference(ours[0][2], runs[0].final, case.table.nominal),
            }
            rows.append(
                [f"N = {n}: {name}", f"{peer.build_seconds:.2f}",
                 f"{entry[label]['build_ratio']:.1f}", f"{theirs:.3f}", f"{entry[label]['solve_ratio']:.1f}",
                 str(runs[0].steps), f"{entry[label]['difference_at_end_of_nominal']:.0e}"]
            )  # fmt: skip
        result[str(n)] = entry
    _table(
        "(b) farm against CasADi (goals: solving 2.5 x at N = 1 with JIT; 5 x solving and 20 x building at N = 100)",
        ["", "build s", "ratio", "solve s", "ratio", "steps", "difference"],
        rows,
    )
    console.print("gustform's build: flatten, print, compile with an empty kernel cache, and link\n")
    return result


_BUILD = """
import sys, time
from gustform_cli.model import link, load
from pathlib import Path
assembled = load(Path(sys.argv[1]), [f"turbines={sys.argv[2]}"])
begin = time.perf_counter()
model = link(assembled)
print(time.perf_counter() - begin, model.built.compilations)
"""


def _fresh_build(n: int, cache: str | None = None) -> float:
    """Seconds to build the farm in a new process, with an empty kernel cache unless one is given."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "GUSTFORM_CACHE": cache or folder, "PYTHONPATH": os.pathsep.join(sys.path)}
        run = subprocess.run(
            [sys.executable, "-c", _BUILD, str(SCENARIOS / "farm.yaml"), str(n)],
            check=True, capture_output=True, text=True, env=environment,
        )  # fmt: skip
    return float(run.stdout.split()[0])


_FIRST_ROW = """
import sys, time
from pathlib import Path
import gustform_cli.main
from tests.support.case import open_case
case = open_case("farm", f"turbines={sys.argv[1]}")
with case.simulation(tuple(c.name for c in case.model.channels)) as simulation:
    simulation.set_sink(case.assembled.scenario.output.every, lambda t, rows: None, 1)
    simulation.initialise(0.0)
    simulation.advance(case.assembled.scenario.output.every)
print(case.model.built.compilations)
"""


def scaling(counts: list[int], seconds: dict[int, float]) -> dict[str, Any]:
    """(c) What N costs."""
    result: dict[str, Any] = {}
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        _fresh_build(1, cache)
        for n in counts:
            cold, warm = _fresh_build(n), _fresh_build(n, cache)
            case = open_case("farm", f"turbines={n}", f"run.until={seconds[n]} s")
            best = min((_timed(case, seconds[n]) for _ in range(3)), key=lambda r: r[0])
            steps = int(best[1]["steps"])
            environment = {**os.environ, "GUSTFORM_CACHE": cache, "PYTHONPATH": os.pathsep.join(sys.path)}
            begin = time.perf_counter()
            first = subprocess.run(
                [sys.executable, "-c", _FIRST_ROW, str(n)], check=True, capture_output=True, text=True, env=environment
            )
            to_first_row = time.perf_counter() - begin
            result[str(n)] = {
                "unknowns": case.table.n_unknowns,
                "build_cold_seconds": cold,
                "build_warm_seconds": warm,
                "compilations_warm": int(first.stdout.split()[-1]),
                "steps": steps,
                "us_per_turbine_step": 1e6 * best[0] / steps / n,
                "seconds_to_first_row": to_first_row,
            }
            r = result[str(n)]
            counts_text = [str(n), str(r["unknowns"]), f"{cold:.2f}", f"{warm:.2f}", str(r["compilations_warm"])]
            rows.append([*counts_text, str(steps), f"{r['us_per_turbine_step']:.3f}", f"{to_first_row:.2f}"])
    _table(
        "(c) farm of N turbines",
        ["N", "unknowns", "build s, empty cache", "build s, cached", "compilations, cached", "steps",
         "us per turbine-step", "process start to first row s"],
        rows,
    )  # fmt: skip
    if "10" in result and "1000" in result:
        ratio = result["1000"]["us_per_turbine_step"] / result["10"]["us_per_turbine_step"]
        result["ratio_1000_to_10"] = ratio
        console.print(f"time per turbine-step at N = 1000 over N = 10: {ratio:.2f} (goal: 1.5 or less)\n")
    return result


def main() -> None:
    """Run the benchmarks named, all by default."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=...", description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("parts", nargs="*", default=["a", "b", "c", "d", "e"], help="a ... e (default: all)")
    parser.add_argument("--hours", type=float, default=1.0, help="simulated hours of (a)")
    parser.add_argument("--days", type=float, default=1.0, help="simulated days of (d)")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--most", type=int, default=100, help="largest N of (b)")
    parser.add_argument("--jit-limit", type=int, default=1800, help="seconds that CasADi's C code may compile in (b)")
    parser.add_argument("--least", type=int, default=1, help="smallest N of (b)")
    parser.add_argument("--json", type=Path, help="write the figures to this file too")
    arguments = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        if "a" in arguments.parts:
            figures["bare"] = bare(arguments.hours, arguments.repeats, Path(folder))
        if "b" in arguments.parts:
            counts = [n for n in (1, 10, 100) if arguments.least <= n <= arguments.most]
            figures["casadi"] = casadi(counts, {1: 600.0, 10: 300.0, 100: 60.0}, arguments.repeats, arguments.jit_limit)
        if "c" in arguments.parts:
            figures["scaling"] = scaling([1, 10, 100, 1000], {1: 600.0, 10: 600.0, 100: 60.0, 1000: 20.0})
        if "d" in arguments.parts:
            figures["long_runs"] = long_runs(min(arguments.repeats, 3), Path(folder), arguments.days)
        if "e" in arguments.parts:
            figures["samples"] = samples(arguments.repeats)
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()

"""(e) Sampled controls: multiples of real time beside those of the continuous control, in the same run."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.support.case import Case, open_case

UNTIL = 90.0  # s; a load step at 30 s
console = Console(width=120)
_VARIANTS = {
    "in the equations": [],
    "sampled at 2 ms": ["wt.control.sampled=2 ms"],
    "sampled at 1 ms": ["wt.control.sampled=1 ms"],
    "sampled at 1 ms, double": ["wt.control.sampled=1 ms", "wt.control.real=double"],
    "sampled at 0.5 ms": ["wt.control.sampled=0.5 ms"],
}


def _timed(case: Case) -> tuple[float, dict[str, int | float]]:
    with case.simulation(rtol=1e-6) as simulation:
        simulation.initialise(0.0)
        begin = time.perf_counter()
        simulation.advance(UNTIL)
        return time.perf_counter() - begin, simulation.statistics()


def samples(repeats: int) -> dict[str, Any]:
    """Least seconds of each variant; they take turns, so that a busy moment hits all."""
    cases = {name: open_case("load_step_8ms", *changes) for name, changes in _VARIANTS.items()}
    least: dict[str, float] = {}
    effort: dict[str, dict[str, int | float]] = {}
    for _ in range(repeats):
        for name, case in cases.items():
            seconds, effort[name] = _timed(case)
            least[name] = min(seconds, least.get(name, seconds))
    table = Table(title="(e) Load step, dual-port control, rtol 1e-6, no rows", title_justify="left")
    for number, column in enumerate(("control", "x real time", "steps", "restarts", "us a sample")):
        table.add_column(column, justify="left" if number == 0 else "right")
    figures = {}
    for name, seconds in least.items():
        events, steps, restarts = (int(effort[name][key]) for key in ("events", "steps", "restarts"))
        each = 1e6 * seconds / events if events > 1 else float("nan")
        table.add_row(name, f"{UNTIL / seconds:.0f}", f"{steps}", f"{restarts}", f"{each:.1f}" if events > 1 else "")
        figures[name] = {"seconds": seconds, "real_time_factor": UNTIL / seconds, "steps": steps, "restarts": restarts}
    console.print(table)
    return figures

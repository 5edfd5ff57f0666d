"""(d) Long runs: a day of 20 Hz wind and a year of measured 10-minute wind, and what each addition to the solve costs.

Ours are whole runs of the command's own machinery (`Run`), with the wind made or read meanwhile; the peers get it as
samples and write nothing. CasADi is too slow for the whole time: it gets a part, and its seconds are scaled by the
simulated time, which favours it where later wind is harder.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from gustform_cli.run import Run
from tests.bench.peers import BareProgram, CasadiIdas, Wind
from tests.support.case import Case, open_case

DAY, YEAR = 86_400.0, 365 * 86_400.0
MEASURED = Path(__file__).parents[3] / "shared/data/lhb/la-haute-borne_R80711_2014-2015.csv.gz"
_TOLERANCE = 1e-6  # relative, and absolute of nominal
_NOTHING = ("events=[]", "output.statistics=false", "run.checkpoint=1000 d")  # but the solve
console = Console(width=120)


@dataclass(frozen=True)
class Variant:
    """A run of ours: what it is called, the changes to the scenario, and whether it writes a file."""

    name: str
    changes: Sequence[str]
    stored: bool


def _without(key: str) -> list[str]:
    return [change for change in _NOTHING if not change.startswith(key)]


def _variants(rows: str, statistics: str) -> list[Variant]:
    """Each addition alone, then all."""
    add = f"output.statistics={statistics}"
    # For a minute only, since the rest of the run would be another one with another load.
    step = "events=[{at: 600 s, set: {load.active: 120 MW}}, {at: 660 s, set: {load.active: 100 MW}}]"
    spacing = f"output.every={rows}"
    return [
        Variant("gustform, the solve alone", [*_NOTHING, spacing], False),
        Variant(f"+ statistics of all channels, {statistics}", [*_without("output.stat"), spacing, add], False),
        Variant(f"+ rows each {rows} in a file", [*_NOTHING, spacing], True),
        Variant("+ 50 checkpoints, and rows", [*_without("run.check"), spacing], True),
        Variant("+ two events, watched at 20 Hz", [*_without("events"), spacing, step], False),
        Variant("gustform, all of it", [spacing, add, step], True),
    ]


def _runs(variants: Sequence[Variant], base: Sequence[str], folder: Path, repeats: int) -> dict[str, tuple[float, int]]:
    """Least seconds of each variant, and its steps. The variants take turns, so that a busy moment hits all."""
    cases = {v.name: open_case("turbulent_10min", *base, *v.changes) for v in variants}
    best: dict[str, tuple[float, int]] = {}
    for _ in range(repeats):
        for variant in variants:
            case = cases[variant.name]
            file = folder / "long" / "result.nc" if variant.stored else None
            if file is not None:
                file.parent.mkdir(exist_ok=True)
            with Run(case.model, case.table, file) as run:
                ended = run.execute()
            if ended.error is not None:
                raise ended.error
            seconds = ended.summary.wall_seconds
            if variant.name not in best or seconds < best[variant.name][0]:
                best[variant.name] = seconds, ended.summary.solver["steps"]
    return best


def _samples(case: Case, until: float, spacing: float) -> Wind:
    """The wind of the only series, at equal distances, as the peers take it."""
    reader = case.reader(case.table.series[0].name)
    times, speeds = reader(0, int(until / spacing) + 3)
    grid = np.arange(int(until / spacing) + 3) * spacing
    values = np.tile(case.table.input_value, (grid.size, 1))
    for slot in case.table.series[0].slots:
        values[:, slot] = np.interp(grid, times, speeds)
    return Wind(spacing, values)


def _consistent(case: Case) -> Case:
    """The case with start values that fit the wind it starts in: idas finds none from the operating point."""
    with case.simulation() as simulation:
        simulation.initialise(0.0)
        _, y, yp = simulation.state()
    return replace(case, table=replace(case.table, start=y, start_derivative=yp))


def _compare(
    title: str, base: Sequence[str], variants: Sequence[Variant], until: float, spacing: float, part: float,
    folder: Path, repeats: int,
) -> dict[str, Any]:  # fmt: skip
    case = _consistent(open_case("turbulent_10min", *base, *_NOTHING))
    bare = BareProgram(case.model.built.linked, case.table, folder / f"bare {until:.0f}")
    wind = _samples(case, until, spacing)
    theirs = min((bare.run(wind, until, _TOLERANCE, _TOLERANCE) for _ in range(repeats)), key=lambda r: r.solve_seconds)
    short = _samples(case, part, spacing)
    linked = case.model.built.linked
    idas = CasadiIdas(linked, case.table, short, part, _TOLERANCE, _TOLERANCE).run()
    scaled = idas.solve_seconds * until / part
    ours = _runs(variants, base, folder, repeats)
    alone = ours[variants[0].name][0]
    table = Table(title=title, title_justify="left")
    for number, column in enumerate(["", "steps", "s", "x real time", "bare / this", "idas / this", "price, %"]):
        table.add_column(column, justify="left" if number == 0 else "right")

    def row(name: str, steps: str, seconds: float, price: str) -> None:
        speed = f"{until / seconds:,.0f}"
        ratios = f"{theirs.solve_seconds / seconds:.2f}", f"{scaled / seconds:.1f}"
        table.add_row(name, steps, f"{seconds:.2f}", speed, *ratios, price)

    row("bare IDA + KLU program", str(theirs.steps), theirs.solve_seconds, "")
    row(f"CasADi idas, {part / until:.2g} of it, scaled", "", scaled, "")
    for variant in variants:
        seconds, steps = ours[variant.name]
        row(variant.name, str(steps), seconds, f"{100.0 * (seconds / alone - 1.0):+.0f}")
    console.print(table)
    return {
        "simulated_seconds": until,
        "seconds": {"bare": theirs.solve_seconds, "casadi scaled": scaled, **{k: s for k, (s, _) in ours.items()}},
        "steps": {"bare": theirs.steps, **{k: n for k, (_, n) in ours.items()}},
        "casadi_part": part / until,
    }


def long_runs(repeats: int, folder: Path, days: float = 1.0) -> dict[str, Any]:
    """(d) The day, and the year where its data are there."""
    until = DAY * days
    result = {
        "day": _compare(
            f"(d) {24 * days:g} h of 20 Hz rotor-effective wind, one turbine and the grid, rtol {_TOLERANCE:g} "
            "(goal: 20,000 x real time with all of it)",
            [f"run.until={until} s"], _variants("1 s", "{every: 50 ms}"), until, 0.05, min(3600.0, until),
            folder, repeats,
        )
    }  # fmt: skip
    if MEASURED.exists():
        wind = (
            f"wind.wt={{type: file, path: {MEASURED}, columns: {{time: Date_time, speed: Ws_avg}}, gaps: interpolate, "
            'longest_gap: 20 d, start: "2014-01-01T01:00:00+01:00", is: rotor_effective, interpolation: %s}'
        )
        base = [f"run.until={YEAR} s", wind % "pchip"]
        variants = _variants("10 min", "{every: 1 min}")
        linear = [*_NOTHING, "output.every=10 min", wind % "linear"]
        variants.insert(1, Variant("gustform, the solve alone, linear as the peers", linear, False))
        result["year"] = _compare(
            "(d) a year of measured 10-minute wind, PCHIP (goal: under 30 s)",
            base, variants, YEAR, 600.0, 30 * DAY, folder, repeats,
        )  # fmt: skip
    else:
        console.print(f"no year: {MEASURED} is not there\n")
    console.print("price: time beyond that of the solve alone; checkpoints restart the solver 50 times\n")
    return result

"""The two campaigns of the trade-off study, as files that `gustform sweep` knows, and the loop that runs them.

    wind        rms, turbulence: designs x mean wind speeds x seeds, each with and without a load step
    capacitor   dq, constant wind: designs x wind speeds, each with several capacitors

A folder holds the scenario, the campaign, the journal that makes a rerun do only what is missing, and the table.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from gustform.language.errors import GustformError
from gustform_cli.interrupt import Interrupt
from gustform_cli.result import prepare_folder
from gustform_cli.study import tradeoff_capacitor, tradeoff_wind
from gustform_cli.study.tradeoff_case import TURBINE
from gustform_cli.study.tradeoff_design import Design
from gustform_cli.sweep.case import Fault, Outcome, Task, failed
from gustform_cli.sweep.case_progress import CaseProgress
from gustform_cli.sweep.local import LocalPool, Lost
from gustform_cli.sweep.plan import Case, Plan, plan
from gustform_cli.sweep.store import Record, Store
from gustform_cli.sweep.table import write_table

SCENARIOS = Path(__file__).parent.parent / "scenarios"
CAMPAIGN, SCENARIO = "campaign.yaml", "scenario.yaml"
TRANSIENT, ANALYSIS, STEP_AT = 120.0, 600.0, 420.0  # s
_WIND_EVERY, _DC_EVERY = "20 ms", "1 ms"  # 20 samples of a swing of the shaft; the loops of the converters
# Counts in the keys of cases: with another one, cases are measured anew.
_EDITION = "1"


@dataclass(frozen=True)
class Campaign:
    """What is run in a folder. `measure` takes a case to its scalars."""

    title: str
    doing: str
    scenario: str
    set: Mapping[str, Any]
    rows: Sequence[Mapping[str, Any]]
    seeds: Sequence[int]
    transient: float
    measure: Callable[[Task], Outcome]


@dataclass(frozen=True)
class Swept:
    """Records by the name of the design, in the order of its cases. `complete`: all cases have ended."""

    records: Mapping[str, Sequence[Record]]
    table: Path
    ran: int
    kept: int
    complete: bool


def wind_campaign(designs: Sequence[Design], winds: Sequence[float], seeds: int) -> Campaign:
    """Every design in every wind."""
    return Campaign(
        title="Trade-off: turbulent wind with a load step",
        doing="wind",
        scenario="turbulent_10min.yaml",
        set={
            f"{TURBINE}.drive.type": "TwoMass",
            f"{TURBINE}.schedule.type": "CurtailmentSchedule",
            "events[0].at": f"{STEP_AT:g} s",
            "run.until": f"{TRANSIENT + ANALYSIS:g} s",
            "output.every": _WIND_EVERY,
            "output.channels": list(tradeoff_wind.CHANNELS),
        },
        rows=[
            {"name": design.name, f"wind.{TURBINE}.mean": f"{wind:g} m/s", **design.values(wind)}
            for design in designs
            for wind in winds
        ],
        seeds=tuple(range(1, seeds + 1)),
        transient=TRANSIENT,
        measure=tradeoff_wind.measure,
    )


def capacitor_campaign(designs: Sequence[Design], winds: Sequence[float]) -> Campaign:
    """Every design at every wind speed."""
    return Campaign(
        title="Trade-off: the smallest DC-link capacitor",
        doing="capacitor",
        scenario="load_step_8ms.yaml",
        set={
            "fidelity": "dq",
            f"{TURBINE}.drive.type": "TwoMass",
            "events[0].at": "0.5 s",
            "run.until": "3.5 s",
            "output.every": _DC_EVERY,
            "output.channels": [tradeoff_capacitor.V_DC],
        },
        rows=[
            {"name": design.name, f"wind.{TURBINE}.speed": f"{wind:g} m/s", **design.values(wind)}
            for design in designs
            for wind in winds
        ],
        seeds=(),
        transient=0.0,
        measure=tradeoff_capacitor.measure,
    )


def run(campaign: Campaign, folder: Path, workers: int, interrupt: Interrupt) -> Swept:
    """Run what the journal of the folder does not have. A case that fails is noted; after Ctrl-C those that ended stay.
    GF7001 if something cannot be written, GF7004 if another study has the folder."""
    the_plan = written(campaign, folder)
    with Store(folder) as store:
        missing = [one for one in the_plan.cases if not _done(store, one)]
        tasks = [task_of(campaign, the_plan, one) for one in missing]
        done = 0
        with LocalPool(workers) as pool, CaseProgress(len(tasks), campaign.doing) as progress:
            results = pool.map(campaign.measure, tasks, lambda: interrupt.requested)
            for done, (task, result) in enumerate(results, start=1):
                outcome = _lost(task, result) if isinstance(result, Lost) else result
                store.add(task.key, outcome)
                progress.failed += outcome.status == "failed"
                progress.show(done)
        table = write_table(the_plan, store.records, store.units, folder)
        records: dict[str, list[Record]] = {}
        for one in the_plan.cases:
            if one.key in store.records:
                records.setdefault(str(one.labels["name"]), []).append(store.records[one.key])
        return Swept(records, table, done, len(the_plan.cases) - len(missing), done == len(tasks))


def task_of(campaign: Campaign, the_plan: Plan, one: Case) -> Task:
    """A case as a worker takes it."""
    return Task(
        number=one.number,
        key=one.key,
        model=one.model,
        file=str(the_plan.base_file),
        text=the_plan.base_text,
        changes=one.changes,
        transient=campaign.transient,
    )


def _done(store: Store, one: Case) -> bool:
    record = store.records.get(one.key)
    return record is not None and record.status == "completed"


def _lost(task: Task, lost: Lost) -> Outcome:
    fault = Fault("GF6901", f"the worker process died: {lost.reason}", "fewer --workers", None)
    return failed(task.number, fault)


def written(campaign: Campaign, folder: Path) -> Plan:
    """The campaign as files in the folder, and its plan. Keys say what is measured too."""
    prepare_folder(folder)
    axes: list[dict[str, Any]] = [{"type": "list", "rows": [dict(row) for row in campaign.rows]}]
    if campaign.seeds:
        axes.append({"type": "grid", "values": {f"wind.{TURBINE}.seed": list(campaign.seeds)}})
    text = io.StringIO()
    writer = YAML()
    writer.width = 200
    writer.dump(
        {
            "name": campaign.title,
            "base": SCENARIO,
            "set": dict(campaign.set),
            "axes": axes,
            "transient_time": f"{campaign.transient:g} s",
        },
        text,
    )
    for name, content in (
        (SCENARIO, (SCENARIOS / campaign.scenario).read_text(encoding="utf-8")),
        (CAMPAIGN, text.getvalue()),
    ):
        try:
            (folder / name).write_text(content, encoding="utf-8")
        except OSError as error:
            raise GustformError(
                "GF7001", f"{str(folder / name)!r} cannot be written; {error.strerror}", hint="--out another folder"
            ) from None
    the_plan = plan(folder / CAMPAIGN)
    return replace(the_plan, cases=tuple(replace(one, key=_key(campaign, one)) for one in the_plan.cases))


def _key(campaign: Campaign, one: Case) -> str:
    return hashlib.sha256(f"{campaign.doing} {_EDITION} {one.key}".encode()).hexdigest()[:32]

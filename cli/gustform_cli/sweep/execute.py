"""A campaign from its file to its table: plan, check, run what is missing, write."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from gustform_cli.interrupt import Interrupt
from gustform_cli.result import prepare_folder
from gustform_cli.sweep import case
from gustform_cli.sweep.case import RUNS, SUMMARY_SCALARS, Fault, Outcome, Task, is_left_over, result_name
from gustform_cli.sweep.case_progress import CaseProgress
from gustform_cli.sweep.checks import by_model, check_all, check_scalars, distinct
from gustform_cli.sweep.local import LocalPool, Lost
from gustform_cli.sweep.plan import Case, Plan, plan
from gustform_cli.sweep.store import Record, Store
from gustform_cli.sweep.table import write_table
from gustform_cli.writing import writing

_TABLE_EVERY = 60.0  # s between tables while running; the journal has everything in between

T = TypeVar("T")
R = TypeVar("R")


class Pool(Protocol):
    """Where cases are run."""

    def map(
        self, function: Callable[[T], R], tasks: Sequence[T], stopped: Callable[[], bool]
    ) -> Iterator[tuple[T, R | Lost]]:
        """(task, function(task)) in the order in which they end."""


@dataclass(frozen=True)
class Swept:
    """What a sweep left behind: how many cases ran now, had been run before, and were not come to."""

    plan: Plan
    folder: Path
    table: Path
    ran: int
    kept: int
    missing: int
    failures: tuple[tuple[Case, Record], ...]
    check_seconds: float
    run_seconds: float


def sweep(file: Path, out: Path, workers: int, scheduler: str | None, interrupt: Interrupt) -> Swept:
    """Run what is missing of a campaign. Errors that can be known before are raised before anything runs; a case that
    fails is noted, and the others go on. After Ctrl-C the cases that have ended are kept."""
    begin = time.perf_counter()
    the_plan = plan(file)
    prepare_folder(out)
    with Store(out) as store:
        missing = [one for one in the_plan.cases if not _done(one, the_plan, store, out)]
        with LocalPool(workers) as local:
            _check(the_plan, missing, store, local)
            interrupt.running(lambda: None)  # from here on a signal ends the sweep, with what it has
            before = time.perf_counter()
            with _folder_of_results(the_plan, out) as mark:
                tasks = [_task(the_plan, one, out, mark) for one in by_model(missing)]
                if scheduler is None:
                    ran = _run(the_plan, store, local, tasks, out, interrupt)
                else:
                    ran = _run_there(scheduler, the_plan, store, tasks, out, interrupt)
        interrupt.closing()
        after = time.perf_counter()
        return Swept(
            plan=the_plan,
            folder=out,
            table=write_table(the_plan, store.records, store.units, out),
            ran=ran,
            kept=len(the_plan.cases) - len(missing),
            missing=len(missing) - ran,
            failures=tuple(
                (one, store.records[one.key])
                for one in the_plan.cases
                if one.key in store.records and store.records[one.key].status == "failed"
            ),
            check_seconds=before - begin,
            run_seconds=after - before,
        )


def _done(one: Case, the_plan: Plan, store: Store, out: Path) -> bool:
    """Whether a case has been run with success, and its file is there if it is to be kept."""
    record = store.records.get(one.key)
    if record is None or record.status != "completed":
        return False
    return the_plan.campaign.keep != "all" or (out / RUNS / result_name(one.key)).is_file()


@contextmanager
def _folder_of_results(the_plan: Plan, out: Path) -> Iterator[str | None]:
    """The folder of result files with a mark in it by which workers elsewhere see whether they share it."""
    if the_plan.campaign.keep == "none":
        yield None
        return
    folder = out / RUNS
    prepare_folder(folder)
    mark = folder / f".{uuid.uuid4().hex}"
    mark.touch()
    try:
        yield mark.name
    finally:
        mark.unlink(missing_ok=True)
        for file in filter(is_left_over, folder.iterdir()):
            file.unlink(missing_ok=True)


def _task(the_plan: Plan, one: Case, out: Path, mark: str | None) -> Task:
    return Task(
        one.number,
        one.key,
        one.model,
        str(the_plan.base_file.resolve()),
        the_plan.base_text,
        one.changes,
        the_plan.campaign.transient,
        the_plan.campaign.keep,
        str((out / RUNS).resolve()) if mark is not None else None,
        mark,
    )


def _check(the_plan: Plan, missing: list[Case], store: Store, pool: LocalPool) -> None:
    """Build every case that differs in more than the seed of its wind, before the first one runs."""
    tasks = [(one, _task(the_plan, one, Path(), None)) for one in distinct(missing)]
    with CaseProgress(len(tasks), "checking") as progress:
        units = check_all(the_plan, tasks, pool, progress)
    check_scalars(the_plan, [*SUMMARY_SCALARS, *store.units, *units])


def _run_there(scheduler: str, the_plan: Plan, store: Store, tasks: list[Task], out: Path, interrupt: Interrupt) -> int:
    """The same on a cluster."""
    from gustform_cli.sweep.cluster import ClusterPool

    with ClusterPool(scheduler) as cluster:
        cluster.refuse_other_versions()
        return _run(the_plan, store, cluster, tasks, out, interrupt)


def _run(the_plan: Plan, store: Store, pool: Pool, tasks: list[Task], out: Path, interrupt: Interrupt) -> int:
    """Run tasks and note how they ended; returns how many did."""
    written, done = time.monotonic(), 0
    with CaseProgress(len(tasks), "running") as progress:
        for done, (task, result) in enumerate(pool.map(case.run, tasks, lambda: interrupt.requested), start=1):
            outcome = _outcome(task, result)
            _keep(outcome, out / RUNS / result_name(task.key))
            store.add(task.key, outcome)
            progress.failed += outcome.status == "failed"
            progress.show(done)
            if time.monotonic() - written > _TABLE_EVERY:
                write_table(the_plan, store.records, store.units, out)
                written = time.monotonic()
    return done


def _outcome(task: Task, result: Outcome | Lost) -> Outcome:
    if isinstance(result, Outcome):
        return result
    hint = "more memory for each worker, or fewer workers"
    return case.failed(task.number, Fault("GF6901", f"the worker process died: {result.reason}", hint, None))


def _keep(outcome: Outcome, file: Path) -> None:
    """Give the result its name: only now, for a case that nobody notes must not leave one."""
    part = file.with_name(outcome.file or f"{file.name}-part")
    with writing(file):
        if outcome.data is not None:
            part.write_bytes(outcome.data)
        if outcome.data is not None or outcome.file is not None:
            part.replace(file)

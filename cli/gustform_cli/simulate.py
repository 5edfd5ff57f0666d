"""One run from the scenario file to result.nc, summary.json and figure.png."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_cli.assemble import Assembled, assemble
from gustform_cli.checkpoint import SUFFIX, Checkpoint, read
from gustform_cli.checkpointing import check_same
from gustform_cli.document import parse
from gustform_cli.interrupt import Interrupt
from gustform_cli.model import link, load, placed, print_warnings
from gustform_cli.progress import RunProgress
from gustform_cli.result import PARTIAL, RESULT, prepare_folder
from gustform_cli.run import Attachment, Ended, Run
from gustform_cli.run_data import RunData
from gustform_cli.summary import Summary, write_summary
from gustform_codegen.initial import steady_state

FIGURE = "figure.png"
_POLL = 0.1  # s between looks at the time reached


@dataclass(frozen=True)
class Outcome:
    """What a run left behind."""

    result: Path
    summary_file: Path
    figure: Path | None
    summary: Summary
    error: GustformError | None  # why it failed, if it did


def simulate(
    file: Path,
    out: Path,
    overrides: Sequence[str],
    interrupt: Interrupt,
    *,
    figure: bool = True,
    attached: Attachment | None = None,
) -> Outcome:
    """Run a scenario. Errors before the run are raised; what stops the run itself is in the outcome, with the
    results so far written. `attached` takes part in the run."""
    return _simulate(lambda: load(file, overrides), out, interrupt, None, figure, attached)


def resume(folder: Path, interrupt: Interrupt, *, figure: bool = True) -> Outcome:
    """Go on with the run in a folder from its last checkpoint. GF7006 if there is none, GF7007 if the model or the
    versions have changed, GF7008 if it is damaged.

    A run that is complete may have been killed before its summary or its figure was whole: they are made again.
    """
    if (summary := _of_complete(folder)) is not None:
        print(f"the run is complete, up to {summary.simulated_seconds:g} s", file=sys.stderr)
        interrupt.closing()
        return _leave(folder, folder / RESULT, summary, None, figure)
    found = read(folder)

    def again() -> Assembled:
        assembled = assemble(parse(found.scenario, found.scenario_file))
        check_same(found, assembled)
        return assembled

    print(f"resuming at {found.time:g} s", file=sys.stderr)
    return _simulate(again, folder, interrupt, found, figure)


def _simulate(
    assembled_from: Callable[[], Assembled],
    out: Path,
    interrupt: Interrupt,
    found: Checkpoint | None,
    figure: bool,
    attached: Attachment | None = None,
) -> Outcome:
    begin = time.perf_counter()
    assembled = assembled_from()
    print_warnings(assembled)
    prepare_folder(out)
    model = link(assembled)
    linked = model.built.linked
    try:
        table = steady_state(linked).table.with_channels(model.channels)
    except GustformError as unsolved:
        raise placed(unsolved, assembled) from None
    build_seconds = time.perf_counter() - begin
    print(
        f"model: {len(linked.types)} types ({model.built.compilations} compiled now), {table.n_instances} units, "
        f"{table.n_unknowns} unknowns; built in {build_seconds:.2f} s",
        file=sys.stderr,
    )
    name = found.result if found is not None else RESULT
    with Run(model, table, out / name, resume=found, attached=attached) as run:
        ended = _watch(run, build_seconds, interrupt, found.time if found is not None else 0.0)
    return _leave(out, ended.result, ended.summary, ended.error, figure and run.rows >= 2)


def _of_complete(folder: Path) -> Summary | None:
    """The summary of a run that needs no going on, as its result has it; None for all others."""
    result = folder / RESULT
    if any(folder.glob(f"*{SUFFIX}")) or (folder / PARTIAL).exists() or not result.exists():
        return None
    with RunData(result) as run:
        return Summary.from_dict(run.json("statistics")) if run.attribute("status") == "completed" else None


def _leave(out: Path, result: Path, summary: Summary, error: GustformError | None, figure: bool) -> Outcome:
    """Summary and figure beside a closed result."""
    summary_file = write_summary(summary, out)
    drawn = out / FIGURE
    drawn.unlink(missing_ok=True)  # one of an earlier run would not belong to this result
    if not figure:
        return Outcome(result, summary_file, None, summary, error)
    from gustform_cli.figures import draw  # a second of imports, after the run

    return Outcome(result, summary_file, draw(result, drawn), summary, error)


def _watch(run: Run, build_seconds: float, interrupt: Interrupt, start: float) -> Ended:
    """Run in a worker; the main thread shows progress and takes Ctrl-C."""
    interrupt.running(run.request_stop)
    with ThreadPoolExecutor(1, thread_name_prefix="gustform-run") as worker, RunProgress(run.until, start) as progress:
        future = worker.submit(run.execute, build_seconds)
        while not wait([future], _POLL).done:
            progress.show(run.time)
        interrupt.closing()
        return future.result()

"""One run from the scenario file to result.nc, summary.json and figure.png."""

from __future__ import annotations

import contextlib
import json
import math
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.assemble import Assembled
from gustform_cli.frequency import FrequencyWatch
from gustform_cli.interrupt import Interrupt
from gustform_cli.model import Model, link, load, placed
from gustform_cli.names import short_aliases
from gustform_cli.progress import RunProgress
from gustform_cli.result import Quantity, ResultWriter, prepare_folder
from gustform_cli.summary import Summary, solver_figures, write_summary
from gustform_cli.versions import versions
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SystemTable

if TYPE_CHECKING:
    from gustform_runtime import Simulation, Status

_BLOCK_BYTES = 1 << 20  # of one block of rows, at most: some 20 rows of a thousand turbines
_BLOCKS = 20  # of a run, at least: what a killed run may lose
_BLOCK_ROWS = (1024, 4096)  # fewer cost time, more cost memory
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


def simulate(file: Path, out: Path, overrides: Sequence[str], interrupt: Interrupt, *, figure: bool = True) -> Outcome:
    """Run a scenario. Errors before the run are raised; what stops the run itself is in the outcome, with the
    results so far written."""
    begin = time.perf_counter()
    assembled = load(file, overrides)
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
    run = _Run(assembled, model, table, out, interrupt)
    summary, result, error = run.execute(build_seconds)
    summary_file = write_summary(summary, out)
    drawn = out / FIGURE
    drawn.unlink(missing_ok=True)  # one of an earlier run would not belong to this result
    if not figure or run.writer.rows < 2:
        return Outcome(result, summary_file, None, summary, error)
    from gustform_cli.figures import draw  # a second of imports, after the run

    return Outcome(result, summary_file, draw(result, drawn), summary, error)


class _Run:
    """The run itself: readers in, rows out, one worker thread under the eyes of the main thread."""

    def __init__(self, assembled: Assembled, model: Model, table: SystemTable, out: Path, interrupt: Interrupt) -> None:
        scenario = assembled.scenario
        self.assembled, self.model, self.table, self.interrupt = assembled, model, table, interrupt
        self.until, self.every = scenario.run.until, scenario.output.every
        rows = math.floor(self.until / self.every * (1.0 + 1e-9)) + 2
        fitting = max(16, _BLOCK_BYTES // (4 * max(1, len(model.channels))))
        self.block_rows = min(fitting, int(np.clip(rows // _BLOCKS, *_BLOCK_ROWS)))
        event = min((event.at for event in scenario.events), default=None)
        self.watch = FrequencyWatch(event, self.until) if assembled.frequency in _names(model) else None
        self.watched = _names(model).index(assembled.frequency) if self.watch is not None else -1
        self.writer = ResultWriter(
            out,
            [Quantity(channel.name, channel.unit, channel.description) for channel in model.channels],
            assembled.counts,
            most_rows=rows,
            block_rows=self.block_rows,
            attributes=self._attributes(),
        )
        self.failure: BaseException | None = None
        self.stopped_early = False
        self.wall_seconds = 0.0

    def _attributes(self) -> dict[str, str]:
        assembled = self.assembled
        return {
            "title": assembled.scenario.name,
            "description": assembled.scenario.description,
            "source": "gustform",
            "scenario": assembled.document.text(),
            "scenario_file": assembled.document.file,
            "aliases": json.dumps(short_aliases(self.model.aliases, assembled.counts)),
            "events": json.dumps([{"at": e.at, "set": e.set} for e in assembled.scenario.events]),
            "frequency_channel": assembled.frequency or "",
            "versions": json.dumps(versions()),
        }

    def execute(self, build_seconds: float) -> tuple[Summary, Path, GustformError | None]:
        """Run to the end or to what stops it; the result file is closed in every case."""
        from gustform_runtime import Simulation

        statistics: dict[str, int | float] = {}
        reached = 0.0
        try:
            with Simulation(self.table.to_bytes()) as simulation:
                self._prepare(simulation)
                self._watch_over(simulation)
                self.interrupt.closing()
                statistics, reached = simulation.statistics(), simulation.time
        except Exception as raised:
            self.failure = self.failure or raised
        self.interrupt.closing()
        error = self._explained()
        status = "failed" if error is not None else "interrupted" if self.stopped_early else "completed"
        summary = Summary(
            status=status,
            message=str(error) if error is not None else None,
            simulated_seconds=reached,
            wall_seconds=self.wall_seconds,
            build_seconds=build_seconds,
            compiled_types=self.model.built.compilations,
            unknowns=self.table.n_unknowns,
            solver=solver_figures(statistics),
            frequency=self.watch.summary(self.every) if self.watch is not None else None,
        )
        result = self.writer.finish(status, summary.as_dict())
        return summary, result, error

    def _prepare(self, simulation: Simulation) -> None:
        run = self.assembled.scenario.run
        simulation.set_option("rtol", run.rtol)
        simulation.set_option("kinks", float(run.limiters == "locate"))
        if run.atol is not None:
            simulation.set_option("atol", run.atol)
        if run.max_step is not None:
            simulation.set_option("max_step", run.max_step)
        for number, series in enumerate(self.table.series):
            if series.name in self.assembled.readers:
                simulation.set_series_reader(number, self.assembled.readers[series.name])
        simulation.set_sink(self.every, self._take, self.block_rows)

    def _take(self, times: NDArray[np.float64], rows: NDArray[np.float32]) -> None:
        """A block of rows from the solver's thread."""
        self.writer.append(times, rows)
        if self.watch is not None:
            self.watch.add(times, rows[:, self.watched].astype(np.float64))

    def _watch_over(self, simulation: Simulation) -> None:
        """Advance in a worker; the main thread shows progress and takes Ctrl-C."""

        def work() -> None:
            begin = time.perf_counter()
            try:
                simulation.initialise(0.0)
                self._judge(simulation.advance(self.until), simulation.message)
            except BaseException as error:
                self.failure = error
            self.wall_seconds = time.perf_counter() - begin

        worker = threading.Thread(target=work, name="gustform-run")
        self.interrupt.running(simulation.request_stop)
        with RunProgress(self.until) as progress:
            worker.start()
            while worker.is_alive():
                worker.join(_POLL)
                progress.show(simulation.time)

    def _judge(self, status: Status, message: str) -> None:
        """What a stop before the end means: a request is an interruption, anything else went wrong."""
        if status.name == "STOP_REQUESTED":
            self.stopped_early = True
        elif status != 0:
            raise GustformError(f"GF60{int(status):02d}", message, hint="a look at the wind and its end")

    def _explained(self) -> GustformError | None:
        """What made the run fail, as an error of ours; defects of gustform itself are raised."""
        from gustform_runtime import RunError

        if self.failure is None:
            return None
        if isinstance(self.failure, GustformError):
            return self.failure
        if isinstance(self.failure, RunError):
            return _run_error(self.failure)
        with contextlib.suppress(GustformError):
            self.writer.finish("failed", {})
        raise self.failure


def _names(model: Model) -> list[str | None]:
    return [channel.name for channel in model.channels]


def _run_error(error: Any) -> GustformError:
    """A status of the runtime as one of our codes: -301 -> GF6301, initialisation GF5xxx, results GF7xxx."""
    number = -int(error.code)
    family = {2: 5, 6: 7}.get(number // 100, 6)
    hints = {
        2: "another operating point (wind, load), or better start values",
        3: "a larger run.rtol, or a look at the last rows of the result",
        5: "a look at the wind",
    }
    return GustformError(f"GF{family}{number:03d}", error.message, hint=hints.get(number // 100, ""))

"""One run of a linked model from its steady state into a result file."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from gustform.language.errors import GustformError
from gustform_cli.assemble import Assembled
from gustform_cli.checkpoint import Checkpoint, discard, interval
from gustform_cli.checkpointing import Keeper, new_part
from gustform_cli.frequency import FrequencyWatch
from gustform_cli.grid_events import SAMPLES, EventWatch, windows
from gustform_cli.model import Model
from gustform_cli.names import short_aliases
from gustform_cli.result import Quantity, ResultWriter
from gustform_cli.rows import RowBlocks, Rows, Times
from gustform_cli.sampled import controller_warnings
from gustform_cli.sampling import RowSampler, Sampler, WindowSampler, advance
from gustform_cli.statistics import Plan, Report, as_dict, needs_starts, plan, report
from gustform_cli.statistics_group import write_statistics
from gustform_cli.summary import Summary, solver_figures
from gustform_cli.trips import TripWatch
from gustform_cli.versions import versions
from gustform_codegen.table import SystemTable

if TYPE_CHECKING:
    from gustform_runtime import Simulation, Statistics, Status

_BLOCK_BYTES = 1 << 20  # of one block of rows, at most: some 20 rows of a thousand turbines
_BLOCKS = 20  # of a run, at least: what a killed run may lose
_BLOCK_ROWS = (1024, 4096)  # fewer cost time, more cost memory


@dataclass(frozen=True)
class Ended:
    """How a run ended."""

    summary: Summary
    file: Path | None  # None for a run without one
    error: GustformError | None  # why it failed, if it did

    @property
    def result(self) -> Path:
        """The result file of a run that writes one."""
        assert self.file is not None
        return self.file


class Attachment(Protocol):
    """What takes part in a run from outside of it, as a controller on a bus does."""

    def attach(self, simulation: Simulation) -> None:
        """Before the simulation is initialised."""
        ...

    def stop(self) -> None:
        """The run is to end; from any thread."""
        ...

    def detach(self) -> None:
        """The last sample has been made, however the run ends; what is written and drawn after it may take long."""
        ...


class Run:
    """A run into `file`, or into none. A context; `execute` may work in any thread while others use `time` and
    `request_stop`.

    `table` starts in the steady state. `watchers` see every portion of the stored rows as well. With `resume` the run
    goes on from there; its result is then the same as without the break, bit for bit. `attached` takes part in it.
    """

    def __init__(
        self,
        model: Model,
        table: SystemTable,
        file: Path | None,
        watchers: Sequence[Callable[[Times, Rows], None]] = (),
        resume: Checkpoint | None = None,
        attached: Attachment | None = None,
    ) -> None:
        scenario = model.assembled.scenario
        self.model, self._table = model, table
        self.until, self.every = scenario.run.until, scenario.output.every
        self.plan: Plan = plan(model)
        self.statistics: Report | None = None  # of a run that is over
        rows = math.floor(self.until / self.every * (1.0 + 1e-9)) + 2
        fitting = max(16, _BLOCK_BYTES // (4 * max(1, len(model.channels))))
        self.block_rows = min(fitting, int(np.clip(rows // _BLOCKS, *_BLOCK_ROWS)))
        names, frequency = [channel.name for channel in model.channels], model.assembled.frequency
        event = min((event.at for event in scenario.events), default=None)
        self.watch = FrequencyWatch(event, self.until) if frequency in names else None
        self.watched = names.index(frequency) if frequency in names else -1
        happening = [(event.at, event.set) for event in scenario.events] if frequency in names else []
        self.events = EventWatch(windows(happening, self.until))
        self._sparse = self.every > SAMPLES  # rows are too far apart for what comes after an event
        self._blocks = RowBlocks(self.block_rows, len(names), scenario.output.precision, self._write)
        self.trips = TripWatch(names)
        self.most_rows = rows
        self.file = file
        self._watchers = watchers
        self._attached = attached
        self._resume = resume
        self._resumed = False  # the rows before the break are in the result
        self._between = interval(self.until, scenario.run.checkpoint)
        self._samplers: list[Sampler] = []
        self._keeper: Keeper | None = None
        self._begin = 0.0
        self._writer: ResultWriter | None = None
        self._simulation: Simulation | None = None
        self._stop = False

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Not by execute(): another thread may be asking for the time just then.
        if self._simulation is not None:
            self._simulation.close()

    @property
    def rows(self) -> int:
        """Rows written so far."""
        return self._writer.rows if self._writer is not None else 0

    @property
    def time(self) -> float:
        """Simulated time reached, s."""
        return self._simulation.time if self._simulation is not None else 0.0

    def request_stop(self) -> None:
        """End at the next step, or before the first one."""
        self._stop = True
        if self._simulation is not None:
            self._simulation.request_stop()
        if self._attached is not None:
            self._attached.stop()

    @property
    def table(self) -> SystemTable:
        """The system with the channels of the rows: those to be stored, then those of statistics only."""
        return self._table.with_channels(list(self.plan.columns))

    def execute(self, build_seconds: float = 0.0) -> Ended:
        """Run to the end or to what stops it; the result file, if any, is closed in every case. Defects are raised."""
        from gustform_runtime import RunError, Simulation

        error, status = None, "completed"
        counters: dict[str, int | float] = {}
        signalled: list[str] = []
        if needs_starts(self.model):
            self.plan = plan(self.model, self._starts())
        self._begin = time.perf_counter() - (self._resume.wall if self._resume is not None else 0.0)
        writer = self._writer = self._new_writer() if self.file is not None else None
        try:
            self._simulation = Simulation(self.table.to_bytes())
            statistics = self.plan.create() if self.plan.needed else None
            try:
                try:
                    status = self._integrate(self._simulation, statistics)
                finally:
                    if self._attached is not None:
                        self._attached.detach()
            finally:
                counters = self._simulation.statistics()
                signalled = controller_warnings(self._simulation)
                if statistics is not None:
                    self.statistics = report(self.plan, statistics)
        except GustformError as failure:
            error, status = failure, "failed"
        except RunError as failure:
            error, status = run_error(failure), "failed"
        except BaseException:
            if writer is not None:
                self._leave(writer)
            raise
        if error is not None and writer is not None and self._resume is not None and not self._resumed:
            self._leave(writer)
            raise error
        try:
            self._blocks.flush()
        except GustformError as failure:
            error, status = error or failure, "failed"
        summary = Summary(
            status=status,
            message=str(error) if error is not None else None,
            simulated_seconds=self.time,
            wall_seconds=time.perf_counter() - self._begin,
            build_seconds=build_seconds,
            compiled_types=self.model.built.compilations,
            unknowns=self.table.n_unknowns,
            solver=solver_figures(counters),
            frequency=self.watch.summary(self.every) if self.watch is not None else None,
            events=self.events.summary(),
            trips=self.trips.times,
            warnings=(
                *self.model.assembled.warnings,
                *signalled,
                *(self._keeper.warnings if self._keeper is not None else ()),
            ),
            statistics=as_dict(self.statistics) if self.statistics is not None else {},
        )
        file = self._finish(writer, summary) if writer is not None else None
        return Ended(summary, file, error)

    def _leave(self, writer: ResultWriter) -> None:
        """End without a summary. A run that was to be resumed and could not be leaves what it found as it was."""
        if self._resume is None or self._resumed:
            writer.finish("failed", {})
        else:
            writer.abandon()

    def _finish(self, writer: ResultWriter, summary: Summary) -> Path:
        file = writer.finish(
            summary.status, summary.as_dict(), lambda file: write_statistics(file, self.statistics, summary.events)
        )
        if summary.status == "completed":  # all others can be gone on with
            discard(file)
        return file

    def _new_writer(self) -> ResultWriter:
        assert self.file is not None
        writer = ResultWriter(
            self.file.parent,
            [Quantity(channel.name, channel.unit, channel.description) for channel in self.model.channels],
            self.model.assembled.counts,
            most_rows=self.most_rows,
            block_rows=self.block_rows,
            attributes=_attributes(self.model),
            name=self.file.name,
            precision=self.model.assembled.scenario.output.precision,
            part=None if self._resume is None else new_part(self.file, self._resume),
            closing=self.plan.size,
        )
        if self._resume is None:  # not before: the folder may be that of a run that goes on, which the writer refuses
            discard(self.file)
        if math.isfinite(self._between):
            self._keeper = Keeper(self.model.assembled, self.file, writer, self.block_rows)
        return writer

    def _integrate(self, simulation: Simulation, statistics: Statistics | None) -> str:
        """Advance to the end; "completed" or "interrupted"."""
        self._prepare(simulation)
        if self.model.assembled.scenario.output.precision == "float64":
            self._samplers.append(RowSampler(self.every, self._take))
        else:
            simulation.set_sink(self.every, self._take, self.block_rows)
        if self._sparse and self.events.windows:
            self._samplers.append(WindowSampler(self.events.windows, self.watched, self.events.add))
        if statistics is not None:
            simulation.set_statistics(statistics, self.plan.start)
        if self._attached is not None:
            self._attached.attach(simulation)
        simulation.initialise(0.0)
        number = 0
        if self._resume is not None:
            number = self._go_on(simulation, self._resume)
        elif math.isfinite(self._between):
            self._checkpoint(simulation, 0)
        while not self._stop:
            number += 1
            end = min(number * self._between, self.until)
            status = advance(simulation, end, self._samplers)
            if status != 0 or end >= self.until:
                return _judged(status, simulation.message)
            self._checkpoint(simulation, number)
        return "interrupted"

    def _checkpoint(self, simulation: Simulation, number: int) -> None:
        """The solver begins anew here, whether or not a file is written: a resumed run does so too."""
        simulation.checkpoint()
        if self._keeper is not None and (number == 0 or self._keeper.due):
            watches = {
                "frequency": self.watch.state() if self.watch is not None else None,
                "events": self.events.state(),
                "trips": self.trips.times,
                "samplers": [sampler.state for sampler in self._samplers],
            }
            self._keeper.save(simulation, number, self._blocks, watches, time.perf_counter() - self._begin)

    def _go_on(self, simulation: Simulation, found: Checkpoint) -> int:
        """To the state of a checkpoint; its number."""
        from gustform_runtime import RunError

        try:
            simulation.restore(found.solver)
        except RunError as error:
            raise GustformError(
                "GF7007",
                f"the run cannot be resumed; {error.message}",
                hint="gustform simulate with the scenario, anew",
            ) from None
        assert self._keeper is not None, "a checkpoint asks for more of them"
        self._keeper.take_up(found)
        self._resumed = True
        self._blocks.add(found.times, found.rows)
        if self.watch is not None:
            self.watch.restore(found.watches["frequency"])
        self.events.restore(found.watches["events"])
        self.trips.times.update(found.watches["trips"])
        for sampler, state in zip(self._samplers, found.watches["samplers"], strict=True):
            sampler.restore(state)
        return found.number

    def _prepare(self, simulation: Simulation) -> None:
        """Options and readers."""
        assembled = self.model.assembled
        run = assembled.scenario.run
        simulation.set_option("rtol", run.rtol)
        simulation.set_option("kinks", float(run.limiters == "locate"))
        if run.atol is not None:
            simulation.set_option("atol", run.atol)
        longest = assembled.longest_step if run.max_step is None else min(run.max_step, assembled.longest_step)
        if math.isfinite(longest):
            simulation.set_option("max_step", longest)
        for number, series in enumerate(self._table.series):
            if series.name in assembled.readers:
                simulation.set_series_reader(number, assembled.readers[series.name])

    def _starts(self) -> dict[str, float]:
        """What the channels start with."""
        from gustform_runtime import Simulation

        with Simulation(self.table.to_bytes()) as simulation:
            self._prepare(simulation)
            simulation.initialise(0.0)
            row = simulation.channels()
        return {channel.name: float(value) for channel, value in zip(self.plan.columns, row, strict=True)}

    def _take(self, times: Times, rows: Rows) -> None:
        """Rows from the solver's thread, with all columns."""
        rows = rows[:, : self.plan.stored]
        if self._writer is not None:
            self._blocks.add(times, rows)
        for watcher in self._watchers:
            watcher(times, rows)
        self.trips.add(times, rows)
        if self.watch is not None:
            hertz = rows[:, self.watched].astype(np.float64)
            self.watch.add(times, hertz)
            if not self._sparse:
                self.events.add(times, hertz)

    def _write(self, times: Times, rows: Rows) -> None:
        """A whole block, or the last one."""
        if self._writer is not None:
            self._writer.append(times, rows)


def _attributes(model: Model) -> dict[str, str]:
    assembled: Assembled = model.assembled
    return {
        "title": assembled.scenario.name,
        "description": assembled.scenario.description,
        "source": "gustform",
        "scenario": assembled.document.text(),
        "scenario_file": assembled.document.file,
        "aliases": json.dumps(short_aliases(model.aliases, assembled.counts)),
        "events": json.dumps([{"at": e.at, "set": e.set} for e in assembled.scenario.events]),
        "frequency_channel": assembled.frequency or "",
        "warnings": json.dumps(assembled.warnings),
        "versions": json.dumps(versions()),
    }


def _judged(status: Status, message: str) -> str:
    """What a stop before the end means: a request is an interruption, anything else went wrong."""
    if status.name == "STOP_REQUESTED":
        return "interrupted"
    if status != 0:
        raise GustformError(f"GF60{int(status):02d}", message, hint="a look at the wind and its end")
    return "completed"


def run_error(error: Any) -> GustformError:
    """A status of the runtime as one of our codes: -301 -> GF6301, initialisation GF5xxx, results GF7xxx."""
    number = -int(error.code)
    family = {2: 5, 6: 7}.get(number // 100, 6)
    hints = {
        2: "another operating point (wind, load), or better start values",
        3: "a larger run.rtol, or a look at the last rows of the result",
        5: "a look at the wind",
    }
    return GustformError(f"GF{family}{number:03d}", error.message, hint=hints.get(number // 100, ""))

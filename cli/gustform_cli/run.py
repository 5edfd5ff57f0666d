"""One run of a linked model from its steady state into a result file."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.assemble import Assembled
from gustform_cli.frequency import FrequencyWatch
from gustform_cli.model import Model
from gustform_cli.names import short_aliases
from gustform_cli.result import Quantity, ResultWriter
from gustform_cli.summary import Summary, solver_figures
from gustform_cli.trips import TripWatch
from gustform_cli.versions import versions
from gustform_codegen.table import SystemTable

if TYPE_CHECKING:
    from gustform_runtime import Simulation, Status

Times = NDArray[np.float64]
Rows = NDArray[np.float32]

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


class Run:
    """A run into `file`, or into none. A context; `execute` may work in any thread while others use `time` and
    `request_stop`.

    `table` starts in the steady state and has the channels of the model. `watchers` see every block of rows as well.
    """

    def __init__(
        self,
        model: Model,
        table: SystemTable,
        file: Path | None,
        watchers: Sequence[Callable[[Times, Rows], None]] = (),
    ) -> None:
        scenario = model.assembled.scenario
        self.model, self.table = model, table
        self.until, self.every = scenario.run.until, scenario.output.every
        rows = math.floor(self.until / self.every * (1.0 + 1e-9)) + 2
        fitting = max(16, _BLOCK_BYTES // (4 * max(1, len(model.channels))))
        self.block_rows = min(fitting, int(np.clip(rows // _BLOCKS, *_BLOCK_ROWS)))
        names, frequency = [channel.name for channel in model.channels], model.assembled.frequency
        event = min((event.at for event in scenario.events), default=None)
        self.watch = FrequencyWatch(event, self.until) if frequency in names else None
        self.watched = names.index(frequency) if frequency in names else -1
        self.trips = TripWatch(names)
        self.most_rows = rows
        self.file = file
        self._watchers = watchers
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

    def execute(self, build_seconds: float = 0.0) -> Ended:
        """Run to the end or to what stops it; the result file, if any, is closed in every case. Defects are raised."""
        from gustform_runtime import RunError, Simulation

        error, status = None, "completed"
        statistics: dict[str, int | float] = {}
        writer = self._writer = self._new_writer() if self.file is not None else None
        begin = time.perf_counter()
        try:
            self._simulation = Simulation(self.table.to_bytes())
            try:
                status = self._integrate(self._simulation, writer)
            finally:
                statistics = self._simulation.statistics()
        except GustformError as failure:
            error, status = failure, "failed"
        except RunError as failure:
            error, status = run_error(failure), "failed"
        except BaseException:
            if writer is not None:
                writer.finish("failed", {})
            raise
        summary = Summary(
            status=status,
            message=str(error) if error is not None else None,
            simulated_seconds=self.time,
            wall_seconds=time.perf_counter() - begin,
            build_seconds=build_seconds,
            compiled_types=self.model.built.compilations,
            unknowns=self.table.n_unknowns,
            solver=solver_figures(statistics),
            frequency=self.watch.summary(self.every) if self.watch is not None else None,
            trips=self.trips.times,
            warnings=tuple(self.model.assembled.warnings),
        )
        file = writer.finish(status, summary.as_dict()) if writer is not None else None
        return Ended(summary, file, error)

    def _new_writer(self) -> ResultWriter:
        assert self.file is not None
        return ResultWriter(
            self.file.parent,
            [Quantity(channel.name, channel.unit, channel.description) for channel in self.model.channels],
            self.model.assembled.counts,
            most_rows=self.most_rows,
            block_rows=self.block_rows,
            attributes=_attributes(self.model),
            name=self.file.name,
        )

    def _integrate(self, simulation: Simulation, writer: ResultWriter | None) -> str:
        """Advance to the end; "completed" or "interrupted"."""
        assembled = self.model.assembled
        run = assembled.scenario.run
        simulation.set_option("rtol", run.rtol)
        simulation.set_option("kinks", float(run.limiters == "locate"))
        if run.atol is not None:
            simulation.set_option("atol", run.atol)
        longest = assembled.longest_step if run.max_step is None else min(run.max_step, assembled.longest_step)
        if math.isfinite(longest):
            simulation.set_option("max_step", longest)
        for number, series in enumerate(self.table.series):
            if series.name in assembled.readers:
                simulation.set_series_reader(number, assembled.readers[series.name])

        def take(times: Times, rows: Rows) -> None:
            """A block of rows from the solver's thread."""
            if writer is not None:
                writer.append(times, rows)
            for watcher in self._watchers:
                watcher(times, rows)
            self.trips.add(times, rows)
            if self.watch is not None:
                self.watch.add(times, rows[:, self.watched].astype(np.float64))

        simulation.set_sink(self.every, take, self.block_rows)
        simulation.initialise(0.0)
        if self._stop:
            return "interrupted"
        return _judged(simulation.advance(self.until), simulation.message)


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

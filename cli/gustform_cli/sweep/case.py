"""One case: from plain data to plain data, the same in a process of this machine as on a cluster.

What costs time is kept in the process: the parsed base scenario, flattened types, compiled kernels, evaluators.
"""

from __future__ import annotations

import shutil
import threading
import time
import traceback
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import gustform
from gustform.language.errors import GustformError, Place
from gustform_cli import document
from gustform_cli.assemble import assemble
from gustform_cli.document import Change, Document
from gustform_cli.errors import ErrorList
from gustform_cli.model import Model, link, placed
from gustform_cli.run import Run
from gustform_cli.summary import SOLVER_FIGURES
from gustform_cli.sweep.channel_moments import ChannelMoments
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SystemTable

RUNS = "runs"
# Of a summary, what differs from run to run of the same case, and what is no number.
_NOT_SCALARS = ("status", "message", "wall_seconds", "real_time_factor", "build_seconds", "compiled_types", "warnings")
_UNITS = {"hz": "Hz", "hz_per_s": "Hz/s", "s": "s", "seconds": "s"}

# What any summary may have, whatever the channels are.
SUMMARY_SCALARS = (
    "simulated_seconds", "unknowns", *(f"solver.{name}" for name in SOLVER_FIGURES),
    "frequency.nadir_hz", "frequency.nadir_time_s", "frequency.settle_hz", "frequency.rocof_hz_per_s",
)  # fmt: skip

# Symbols and the steady state are one thread's work: CasADi is not made for several. Runs are not held up by it.
_building = threading.Lock()
_last: dict[tuple[str, str, str], tuple[Model, SystemTable]] = {}  # one: a farm's model may be large


@dataclass(frozen=True)
class Task:
    """A case as plain data. `folder` is where result files go, None where none is kept."""

    number: int
    key: str
    model: str  # equal for cases with the same model and steady state
    file: str
    text: str
    changes: tuple[Change, ...]
    transient: float = 0.0
    keep: str = "none"
    folder: str | None = None
    mark: str | None = None  # a file in the folder; a worker that does not see it has another file system


@dataclass(frozen=True)
class Fault:
    """An error as plain data."""

    code: str
    message: str
    hint: str
    place: Place | None

    @classmethod
    def of(cls, error: GustformError) -> Fault:
        return cls(error.code, error.message, error.hint, error.place)

    def error(self, before: str = "", place: Place | None = None) -> GustformError:
        """The error again, with a text before its message, and a place where it has no better one."""
        return GustformError(self.code, before + self.message, hint=self.hint, place=place or self.place)


@dataclass(frozen=True)
class Outcome:
    """How a case ended. `status`: completed or failed. `file`: the name of its result in the folder of results, which
    it has until somebody notes the outcome; `data`: the result itself, where the worker does not see that folder.
    """

    number: int
    status: str
    fault: Fault | None
    scalars: Mapping[str, float]
    units: Mapping[str, str]
    wall_seconds: float
    solve_seconds: float
    file: str | None = None
    data: bytes | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Checked:
    """What can be said of a case before it runs; `units` are those of the columns it will have."""

    faults: tuple[Fault, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def check(task: Task) -> Checked:
    """Build a case up to its steady state."""
    try:
        model, _ = _built(task)
    except ErrorList as several:
        return Checked(tuple(Fault.of(error) for error in several.errors))
    except GustformError as error:
        return Checked((Fault.of(error),))
    trips = [channel.name.removesuffix(".tripped") for channel in model.channels if channel.name.endswith(".tripped")]
    units = {**ChannelMoments.units(model.channels), **{f"trips.{name}": "s" for name in trips}}
    return Checked((), units, tuple(model.assembled.warnings))


def run(task: Task) -> Outcome:
    """Run a case. Whatever goes wrong is in the outcome, also a defect of ours: it must not cost the other cases."""
    begin = time.perf_counter()
    try:
        return _run(task, begin)
    except (ErrorList, GustformError) as error:
        fault = Fault.of(error.errors[0] if isinstance(error, ErrorList) else error)
    except Exception as error:
        text = "".join(traceback.format_exception(error))
        fault = Fault("GF6902", f"a defect of gustform, please report it: {text.strip()}", "", None)
    return failed(task.number, fault, time.perf_counter() - begin)


def failed(number: int, fault: Fault, seconds: float = 0.0) -> Outcome:
    """A case that came to nothing."""
    return Outcome(number, "failed", fault, {}, {}, seconds, 0.0)


def _run(task: Task, begin: float) -> Outcome:
    model, table = _built(task)
    scenario = model.assembled.scenario
    moments = ChannelMoments(model.channels, scenario.output.every, task.transient)
    folder = _shared(task)
    kept = task.keep != "none"
    # A name of its own: another worker may have been given the same case after a loss of contact.
    file = (folder or _local_folder()) / f"{task.key[:16]}-{uuid.uuid4().hex}.nc" if kept else None
    left, data = None, None
    try:
        with Run(model, table, file, [moments.add]) as execution:
            ended = execution.execute()
        if file is not None and (ended.error is not None or task.keep == "all"):
            if folder is not None:
                left = file.name
            else:
                data = file.read_bytes()
    finally:
        if file is not None and folder is None:
            shutil.rmtree(file.parent, ignore_errors=True)
        elif file is not None and left is None:
            file.unlink(missing_ok=True)
    summary = ended.summary
    scalars = dict(_flat(summary.as_dict(), summary.solver))
    units = {name: _unit(name) for name in scalars}
    scalars.update(moments.scalars())
    units.update(ChannelMoments.units(model.channels))
    fault = Fault.of(ended.error) if ended.error is not None else None
    return Outcome(
        task.number,
        "completed" if fault is None else "failed",
        fault,
        scalars,
        units,
        time.perf_counter() - begin,
        summary.wall_seconds,
        left,
        data,
    )


def result_name(key: str) -> str:
    """The result file of a case. Its number would belong to another case when the campaign grows."""
    return f"{key[:16]}.nc"


def is_left_over(file: Path) -> bool:
    """Whether a file is what a worker wrote that did not come to the end."""
    return "-" in file.name


def version() -> str:
    """Of the worker that is asked."""
    return gustform.__version__


def _built(task: Task) -> tuple[Model, SystemTable]:
    """The model of a case and its table in the steady state. Raises ErrorList or GustformError.

    That of the case before serves again if only seeds differ: the winds are new, the equations are not.
    """
    with _building:
        assembled = assemble(_base(task.file, task.text).changed(task.changes))
        about = (task.file, task.text, task.model)
        if about in _last:
            model, table = _last[about]
            return replace(model, assembled=assembled), table
        model = link(assembled)
        try:
            table = steady_state(model.built.linked).table
        except GustformError as unsolved:
            raise placed(unsolved, assembled) from None
        _last.clear()
        _last[about] = model, table.with_channels(model.channels)
        return _last[about]


@lru_cache(maxsize=8)
def _base(file: str, text: str) -> Document:
    return document.parse(text, file)


def _shared(task: Task) -> Path | None:
    """The folder of the results, if this worker has it."""
    if task.folder is None:
        return None
    folder = Path(task.folder)
    return folder if task.mark is None or (folder / task.mark).is_file() else None


def _local_folder() -> Path:
    import tempfile

    return Path(tempfile.mkdtemp(prefix="gustform-"))


def _flat(summary: Mapping[str, Any], solver: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """The numbers of a summary: frequency.nadir_hz, trips.wt, solver.steps, ..."""
    for key, value in summary.items():
        if key in _NOT_SCALARS:
            continue
        if isinstance(value, list):  # of what there are several, as events: events.1.nadir_hz
            value = {str(number): item for number, item in enumerate(value, start=1)}
        if isinstance(value, Mapping):
            yield from ((f"{key}.{name}", number) for name, number in _flat(value, {}))
        elif value is None:
            yield key, float("nan")
        elif isinstance(value, int | float):
            yield f"solver.{key}" if key in solver else key, float(value)


def _unit(name: str) -> str:
    """Summaries carry units in their names."""
    if name.startswith("trips."):
        return "s"
    return next((unit for ending, unit in _UNITS.items() if name.endswith(f"_{ending}")), "1")

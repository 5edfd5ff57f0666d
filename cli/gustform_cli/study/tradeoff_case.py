"""What both campaigns of the trade-off study do with a case: build its model, and put what was measured, or what went
wrong, into an outcome that the sweep's journal keeps."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from gustform.language.errors import GustformError
from gustform_cli import document
from gustform_cli.assemble import assemble
from gustform_cli.document import Change, Document
from gustform_cli.errors import ErrorList
from gustform_cli.model import Model, link, placed
from gustform_cli.sweep.case import Fault, Outcome, Task, failed
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SystemTable

TURBINE = "wt"
Scalars = Mapping[str, float]


def built(task: Task, more: Sequence[Change] = ()) -> tuple[Model, SystemTable]:
    """The model of a case, with further changes, and its table in the steady state with the scenario's channels."""
    assembled = assemble(_base(task.file, task.text).changed((*task.changes, *more)))
    model = link(assembled)
    try:
        table = steady_state(model.built.linked).table
    except GustformError as unsolved:
        raise placed(unsolved, assembled) from None
    return model, table.with_channels(model.channels)


@lru_cache(maxsize=4)
def _base(file: str, text: str) -> Document:
    return document.parse(text, file)


def outcome(task: Task, work: Callable[[Task], tuple[Scalars, float]], units: Mapping[str, str]) -> Outcome:
    """What `work` measures, with the seconds that it solved; what it refuses is a failed case."""
    begin = time.perf_counter()
    try:
        scalars, solved = work(task)
    except (ErrorList, GustformError) as error:
        fault = Fault.of(error.errors[0] if isinstance(error, ErrorList) else error)
        return failed(task.number, fault, time.perf_counter() - begin)
    return Outcome(task.number, "completed", None, scalars, units, time.perf_counter() - begin, solved)

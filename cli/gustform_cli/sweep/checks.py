"""Before the first case runs: every case is built up to its steady state, and what cannot be is said with the place
in the campaign that makes it so."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import ErrorList, did_you_mean
from gustform_cli.sweep import case
from gustform_cli.sweep.case import Fault, Task
from gustform_cli.sweep.case_progress import CaseProgress
from gustform_cli.sweep.local import LocalPool, Lost
from gustform_cli.sweep.plan import Case, Plan
from gustform_cli.sweep.table import selected

_MOST_SHOWN = 20  # errors


def distinct(cases: Sequence[Case]) -> list[Case]:
    """The first case of each model."""
    found: dict[str, Case] = {}
    for one in cases:
        found.setdefault(one.model, one)
    return list(found.values())


def by_model(cases: Sequence[Case]) -> list[Case]:
    """Cases of the same model one after the other, so that a worker builds it once."""
    place: dict[str, int] = {}
    models = [place.setdefault(one.model, len(place)) for one in cases]
    return [one for _, one in sorted(zip(models, cases, strict=True), key=lambda pair: pair[0])]


def check_all(
    plan: Plan, tasks: Sequence[tuple[Case, Task]], pool: LocalPool, progress: CaseProgress
) -> dict[str, str]:
    """The units of the columns that these cases will have. Raises ErrorList with everything that is wrong with them;
    warnings go to stderr."""
    cases = {task.number: one for one, task in tasks}
    faults: dict[Case, tuple[Fault, ...]] = {}
    units: dict[str, str] = {}
    warnings: dict[str, None] = {}
    good: list[Case] = []
    for done, (task, result) in enumerate(pool.map(case.check, [task for _, task in tasks]), start=1):
        one = cases[task.number]
        if isinstance(result, Lost):
            faults[one] = (Fault("GF6901", f"the worker process died: {result.reason}", "", None),)
        elif result.faults:
            faults[one] = result.faults
        else:
            good.append(one)
            units.update(result.units)
            warnings.update(dict.fromkeys(result.warnings))
        progress.show(done)
    if faults:
        raise ErrorList(_errors(plan, faults, good))
    for text in warnings:
        print(f"warning: {text}", file=sys.stderr)
    return units


def check_scalars(plan: Plan, names: Sequence[str]) -> None:
    """GF2606 for a pattern of `scalars` that none of the names matches."""
    errors = [
        GustformError(
            "GF2606",
            f"scalars[{number}] must match a column; none matches {pattern!r}",
            hint=did_you_mean(pattern, names),
            place=plan.document.place(("scalars", number)),
        )
        for number, pattern in enumerate(plan.campaign.scalars)
        if not selected(names, [pattern])
    ]
    if errors:
        raise ErrorList(errors)


def _errors(plan: Plan, faults: dict[Case, tuple[Fault, ...]], good: Sequence[Case]) -> list[GustformError]:
    """One error for each fault, with the first case that has it and how many there are."""
    alike: dict[tuple[str, Any], list[Case]] = {}
    first: dict[tuple[str, Any], Fault] = {}
    for one in sorted(faults, key=lambda one: one.number):
        for fault in faults[one]:
            # The same code at the same place is the same fault, though its numbers may differ from case to case.
            key = (fault.code, fault.place)
            alike.setdefault(key, []).append(one)
            first.setdefault(key, fault)
    errors = []
    for key, cases in alike.items():
        fault = first[key]
        more = f" and {len(cases) - 1} more" if len(cases) > 1 else ""
        inside = fault.place is not None and fault.place.file == plan.document.file
        place = fault.place if inside else _culprit(plan, cases, good)
        errors.append(fault.error(f"{cases[0].text()}{more}: ", place))
    errors.sort(key=lambda error: (error.place.line, error.place.column) if error.place is not None else (0, 0))
    return errors[:_MOST_SHOWN]


def _culprit(plan: Plan, bad: Sequence[Case], good: Sequence[Case]) -> Place | None:
    """The axis value that all cases with a fault have and no case without one; else the axis values of the first."""

    def settings(one: Case) -> dict[tuple[str, str], Place | None]:
        return {(c.path, json.dumps(c.value, sort_keys=True, default=str)): c.place for c in one.changes}

    common = settings(bad[0])
    for one in bad[1:]:
        common = {key: place for key, place in common.items() if key in settings(one)}
    for one in good:
        common = {key: place for key, place in common.items() if key not in settings(one)}
    places = [place for place in common.values() if place is not None]
    if places:
        return places[0]
    return plan.document.place(("axes",) if plan.campaign.axes else ("base",))

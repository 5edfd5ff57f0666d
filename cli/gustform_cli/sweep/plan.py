"""From a campaign to its cases, each with the changes that make it and a key that says whether it has been run."""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gustform
from gustform.language.errors import GustformError
from gustform_cli import document
from gustform_cli.document import Change, Document
from gustform_cli.errors import ErrorList
from gustform_cli.sweep import axes, wind_axis
from gustform_cli.sweep.axes import Point
from gustform_cli.sweep.campaign import Campaign, read

_MOST_CASES = 1_000_000
_TITLES = ("name", "description")  # of a scenario; they change no number


@dataclass(frozen=True, eq=False)
class Case:
    """One run. `labels` are its axis values as written, by the name of their column."""

    number: int  # from 1
    key: str
    changes: tuple[Change, ...]
    labels: Mapping[str, Any]

    @property
    def model(self) -> str:
        """Equal for cases with the same model and the same steady state: they differ in the seeds of winds only."""
        return json.dumps([_without_seed(change) for change in self.changes], sort_keys=True, default=str)

    def text(self) -> str:
        """What the case is, for messages."""
        values = ", ".join(f"{name} = {value}" for name, value in self.labels.items())
        return f"case {self.number} ({values})" if values else f"case {self.number}"


def _without_seed(change: Change) -> tuple[str, Any]:
    path, value = change.path, change.value
    if path.startswith("wind.") and path.endswith(".seed"):
        return path, None
    if path.startswith("wind.") and isinstance(value, Mapping):
        return path, {key: item for key, item in value.items() if key != "seed"}
    return path, value


@dataclass(frozen=True)
class Plan:
    """A campaign with its cases."""

    campaign: Campaign
    document: Document  # the campaign's
    campaign_text: str
    base_file: Path
    base_text: str
    cases: tuple[Case, ...]


def plan(file: Path) -> Plan:
    """The cases of the campaign in a file. Everything that can be said without building a model is said here:
    GF2101 to GF2105 for both files, GF26xx for the axes; ErrorList if there are several."""
    campaign, written = read(file)
    base_file = file.parent / campaign.base
    try:
        base = document.read(base_file)
    except GustformError as error:
        if error.code != "GF2101":
            raise
        raise GustformError(
            "GF2101", f"base: {error.message} ({campaign.base!r})", hint="a path relative to the campaign",
            place=written.place(("base",)),
        ) from None  # fmt: skip
    plain = base.plain()
    constant = tuple(Change(name, value, written.place(("set", name))) for name, value in campaign.set.items())
    _applied(plain, constant)
    factors: list[list[Point]] = []
    if campaign.wind is not None:
        factors.append(wind_axis.points(campaign.wind, plain, written))
    errors: list[GustformError] = []
    for number, axis in enumerate(campaign.axes):
        try:
            factors.append(axes.points(axis, ("axes", number), written))
        except GustformError as error:
            errors.append(error)
    if errors:
        raise ErrorList(errors)
    _refuse_twice(factors, constant)
    _refuse_too_many(factors, written)
    for factor in factors:
        for point in factor:
            try:
                _applied(copy.deepcopy(plain), point.changes)
            except GustformError as error:
                errors.append(error)
    if errors:
        raise ErrorList(_each_once(errors))
    cases = tuple(_cases(campaign, base_file.parent, plain, constant, factors))
    return Plan(
        campaign,
        written,
        file.read_text(encoding="utf-8-sig"),
        base_file,
        base_file.read_text(encoding="utf-8-sig"),
        cases,
    )


def _applied(plain: dict[str, Any], changes: tuple[Change, ...]) -> dict[str, Any]:
    for change in changes:
        document.put(plain, change)
    return plain


def _cases(
    campaign: Campaign, folder: Path, plain: dict[str, Any], constant: tuple[Change, ...], factors: list[list[Point]]
) -> Iterator[Case]:
    """Every combination, the last factor changing fastest."""
    stamps: dict[str, str] = {}
    for number, chosen in enumerate(itertools.product(*factors), start=1):
        changes = tuple(change for point in chosen for change in point.changes)
        labels = {name: value for point in chosen for name, value in point.labels.items()}
        resolved = _applied(copy.deepcopy(plain), changes)
        yield Case(number, _key(resolved, campaign.transient, folder, stamps), (*constant, *changes), labels)


def _key(resolved: Mapping[str, Any], transient: float, folder: Path, stamps: dict[str, str]) -> str:
    """A hash of all that the numbers of a case follow from: the resolved scenario, files it names, this version."""
    files: dict[str, str] = {}
    _find_files(resolved, folder, files, stamps)
    content = {
        "scenario": {key: value for key, value in resolved.items() if key not in _TITLES},
        "transient": transient,
        "files": files,
        "gustform": gustform.__version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _find_files(node: Any, folder: Path, files: dict[str, str], stamps: dict[str, str]) -> None:
    """Size and time of change of every text that is the name of a file: a hash of 100 GB would take minutes."""
    if isinstance(node, Mapping):
        for value in node.values():
            _find_files(value, folder, files, stamps)
    elif isinstance(node, list):
        for value in node:
            _find_files(value, folder, files, stamps)
    elif isinstance(node, str) and "." in node:
        if node not in stamps:
            try:
                status = (folder / node).stat()
                stamps[node] = f"{status.st_size} {status.st_mtime_ns}"
            except (OSError, ValueError):
                stamps[node] = ""
        if stamps[node]:
            files[node] = stamps[node]


def _refuse_twice(factors: list[list[Point]], constant: tuple[Change, ...]) -> None:
    """A path belongs to one axis: the later one would win without a word."""
    owner: dict[str, Change] = {change.path: change for change in constant}
    for factor in factors:
        mine: dict[str, Change] = {}
        for point in factor:
            for change in point.changes:
                if change.path in owner:
                    raise GustformError(
                        "GF2602",
                        f"{change.path} must be set in one place; it is set at {owner[change.path].place} as well",
                        hint="removing one of the two",
                        place=change.place,
                    )
                mine[change.path] = change
        owner.update(mine)


def _refuse_too_many(factors: list[list[Point]], written: Document) -> None:
    count = 1
    for factor in factors:
        count *= len(factor)
    if count > _MOST_CASES:
        raise GustformError(
            "GF2601",
            f"a campaign must have at most {_MOST_CASES} cases; these axes make {count}",
            hint="a latin_hypercube instead of a grid",
            place=written.place(("axes",)),
        )


def _each_once(errors: list[GustformError]) -> list[GustformError]:
    return list({str(error): error for error in errors}.values())

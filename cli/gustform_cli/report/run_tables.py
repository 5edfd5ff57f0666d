"""The tables of a run: system, channels, solver, provenance."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import h5py

from gustform_cli.report.channel_statistics import Moments
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import count, fixed, places, plain, scale, significant, size
from gustform_cli.report.page import details
from gustform_cli.report.run_folder import RunFolder
from gustform_cli.report.tables import Cell, facts, table

_PLACES = ("at", "from", "to")
# Counters of the solver, in the words of a reader; others of the summary follow under their own names.
_SOLVER = {
    "unknowns": "unknowns",
    "steps": "steps",
    "residual_evaluations": "residuals",
    "jacobian_evaluations": "Jacobians",
    "factorisations": "factorisations",
    "refactorisations": "refactorisations with the same pivots",
    "nonlinear_iterations": "Newton iterations",
    "nonlinear_failures": "Newton failures",
    "error_test_failures": "steps refused by the error test",
    "root_evaluations": "looks for events",
    "events": "events",
    "restarts": "restarts",
    "initial_iterations": "iterations of the start",
    "rows": "rows stored",
    "compiled_types": "types compiled for this run",
    "simulated_seconds": "simulated time, s",
    "wall_seconds": "time of the run, s",
    "build_seconds": "time to build the model, s",
}
_EACH_STEP = {
    "residual_evaluations",
    "jacobian_evaluations",
    "factorisations",
    "refactorisations",
    "nonlinear_iterations",
    "error_test_failures",
}
_ELSEWHERE = {"status", "message", "warnings", "frequency", "trips", "real_time_factor"}


# ---- system ---------------------------------------------------------------------------------------------------------
def components(scenario: Mapping[str, Any]) -> Html | None:
    """Name, type, place and the parameters that the scenario gives; all others have their defaults."""
    rows: list[list[Cell | str]] = [
        [
            Cell(tag("b", name)),
            str(entry.get("type", "")) + _times(entry),
            " – ".join(str(entry[key]) for key in _PLACES if key in entry),
            Cell(_parameters({k: v for k, v in entry.items() if k not in ("type", "count", "aggregate", *_PLACES)})),
        ]
        for name, entry in _entries(scenario.get("components"))
    ]
    if not rows:
        return None
    note = tag("p", "Parameters that are not listed have their defaults: gustform info TYPE names them.", class_="soft")
    return Html(table(["name", "type", "connected to", "given parameters"], rows) + note)


def wind(scenario: Mapping[str, Any]) -> Html | None:
    """The wind of each turbine."""
    rows: list[list[Cell | str]] = [
        [Cell(tag("b", name)), str(entry.get("type", "")), Cell(_parameters(entry, without=("type",)))]
        for name, entry in _entries(scenario.get("wind"))
    ]
    return table(["wind of", "type", "given"], rows, fit=True) if rows else None


def events(run: RunFolder) -> Html | None:
    """What was set when, and who tripped."""
    found: list[tuple[float, Content]] = [
        (float(event["at"]), _parameters(event["set"], sign=" = ")) for event in run.parts["events"] or ()
    ]
    found += [(float(at), tag("b", f"{name} trips")) for name, at in (run.summary.get("trips") or {}).items()]
    rows = [[Cell(significant(at, 6), at), Cell(what)] for at, what in sorted(found, key=lambda event: event[0])]
    return table(["time, s", "what happens"], rows, fit=True) if rows else None


def settings(scenario: Mapping[str, Any]) -> Html | None:
    """How long, how accurately, what is kept."""
    pairs: list[tuple[Content, Content]] = [
        (name, _parameters(scenario[name])) for name in ("run", "output") if isinstance(scenario.get(name), Mapping)
    ]
    pairs += [
        (name, str(scenario[name])) for name in ("fidelity", "frame", "turbines") if scenario.get(name) is not None
    ]
    return facts(pairs) if pairs else None


def _entries(block: object) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if isinstance(block, Mapping):
        yield from ((name, entry) for name, entry in block.items() if isinstance(entry, Mapping))


def _times(entry: Mapping[str, Any]) -> str:
    return "".join(f", {word} {entry[word]}" for word in ("count", "aggregate") if word in entry)


def _parameters(tree: Mapping[str, Any], sign: str = " ", without: Sequence[str] = ()) -> Html:
    return tag(
        "span",
        [tag("span", tag("code", path), f"{sign}{value}") for path, value in _flat(tree) if path not in without],
        class_="parameters",
    )


def _flat(tree: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """governor: {type: TGOV1, droop: 5 %} as governor TGOV1, governor.droop 5 %."""
    for key, value in tree.items():
        path = f"{before}{key}"
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}.")
        elif key == "type" and before:
            yield before[:-1], str(value)
        elif isinstance(value, list):
            yield path, ", ".join(plain(item) for item in value)
        else:
            yield path, plain(value)


# ---- channels -------------------------------------------------------------------------------------------------------
def channels(file: h5py.File, found: Mapping[str, Moments]) -> Html | None:
    """Mean, deviation and extremes of every stored channel; those inside of components are folded away."""
    if not found:
        return None
    heads = ["channel", "unit", "mean", "std", "min", "max", "what it is"]
    rows = {name: _channel(file[name], name, moments) for name, moments in found.items()}
    outer = [row for name, row in rows.items() if name.count(".") <= 1]
    inner = [row for name, row in rows.items() if name.count(".") > 1]
    if not outer or not inner:
        return table(heads, outer or inner, sortable=True)
    folded = details(f"Channels inside of components ({len(inner)})", table(heads, inner, sortable=True))
    return Html(table(heads, outer, sortable=True) + folded)


def _channel(data: h5py.Dataset, name: str, moments: Moments) -> list[Cell | str]:
    unit = str(data.attrs.get("units", ""))
    largest = max(abs(moments.low), abs(moments.high))
    factor, shown = scale(unit, largest)
    decimals = places(moments.spread / factor, largest / factor)
    many = f" ({data.shape[1]} instances)" if data.ndim > 1 else ""
    values = (moments.mean, moments.std, moments.low, moments.high)
    return [
        Cell([tag("code", name), many]),
        shown,
        *(Cell(fixed(value / factor, decimals), value) for value in values),
        Cell(tag("span", str(data.attrs.get("long_name", "")), class_="soft")),
    ]


# ---- solver and provenance ------------------------------------------------------------------------------------------
def solver(summary: Mapping[str, Any]) -> Html | None:
    """The counters of the solver, absolute and for each step."""
    counters = {name: value for name, value in _numbers(summary) if name not in _ELSEWHERE}
    steps = counters.get("steps", 0.0)
    rows: list[list[Cell | str]] = []
    for name in (*(n for n in _SOLVER if n in counters), *(n for n in counters if n not in _SOLVER)):
        value = counters[name]
        whole = float(value).is_integer()
        each = value / steps if steps and name in _EACH_STEP else None
        rows.append(
            [
                _SOLVER.get(name, name.replace("_", " ")),
                Cell(count(value) if whole else significant(value), value),
                Cell(significant(each, 3), each) if each is not None else "",
            ]
        )
    return table(["", "in all", "each step"], rows, fit=True) if rows else None


def _numbers(tree: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    for name, value in tree.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield name, float(value)


def provenance(run: RunFolder) -> Html:
    """What the result was made with, and from what."""
    scenario = run.texts.get("scenario", "")
    versions = run.parts["versions"] or {}
    pairs: list[tuple[Content, Content]] = [
        ("folder", str(run.folder.resolve())),
        ("written", run.written),
        ("versions", ", ".join(f"{name} {version}" for name, version in versions.items()) or None),
    ]
    if run.result is not None:
        pairs.append(("result", f"{run.result.name}, {size(run.result.stat().st_size)}"))
        pairs.append(("SHA-256 of the result", tag("code", run.result_hash())))
    if scenario:
        pairs.append(("scenario", run.texts.get("scenario_file", "")))
        pairs.append(("SHA-256 of the scenario", tag("code", hashlib.sha256(scenario.encode()).hexdigest())))
    text = details("Scenario as it was run, with what --set changed", tag("pre", scenario)) if scenario else None
    return Html(facts((name, value) for name, value in pairs if value) + (text or ""))

"""A log of the bus against a result of the simulation: how far each quantity is off, as a table and as a figure.

Sample k0, the first that was answered with enabled references, is the result's time zero. A measurement is compared at
the result's times, between samples on the line between them. A command holds from sample to sample, and acts as many
samples late as the result's scenario says; a row of the result at the instant of a change has what held before it. What
the scenario's control neither reads nor commands is compared if it ever left the value of least harm, which is sent for
what nobody measures.

GF8080 the log has nothing to compare   GF8081 a tolerance that is none
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.component import suggest
from gustform.language.errors import GustformError
from gustform_cli.document import parse
from gustform_cli.export import controls, default_block
from gustform_cli.run_data import Curve, RunData
from gustform_hil.trace import Series, Trace

Floats = NDArray[np.float64]
TOLERANCE = 1e-3  # in the unit of the quantity: pu, deg, m/s
_SAME_TIME = 1e-6  # of a period
_HOLDERS = ("", "control.", "pitch.", "schedule.")  # where a turbine keeps what its control reads and commands


@dataclass(frozen=True)
class Compared:
    """One quantity: the largest difference, where it is, and the tolerance."""

    quantity: str
    channel: str
    unit: str
    points: int
    largest: float
    at: float  # s of the result
    tolerance: float

    @property
    def good(self) -> bool:
        return self.largest <= self.tolerance


@dataclass(frozen=True)
class Pair:
    """The curves behind a line of the table."""

    compared: Compared
    time: Floats
    logged: Floats
    simulated: Floats


@dataclass(frozen=True)
class Comparison:
    """All of them, and what was left out."""

    log: str
    result: str
    pairs: tuple[Pair, ...]
    missing: tuple[str, ...]  # quantities of the log that the result does not have
    idle: tuple[str, ...]  # that nobody measures or commands
    samples: int
    lost: int
    damaged: int

    @property
    def good(self) -> bool:
        return all(pair.compared.good for pair in self.pairs)


def parse_tolerances(texts: Sequence[str]) -> tuple[float, dict[str, float]]:
    """ "1e-3" for all quantities, "beta_ref=0.05" for one. GF8081."""
    general, special = TOLERANCE, {}
    for text in texts:
        name, equals, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value >= 0.0) or (equals and not name):
            raise GustformError(
                "GF8081",
                f"--tolerance must be a number at or above 0, or QUANTITY=number; got {text!r}",
                hint="--tolerance 1e-3 --tolerance beta_ref=0.05",
            )
        if equals:
            special[name] = value
        else:
            general = value
    return general, special


def compare(trace: Trace, run: RunData, turbine: str, tolerances: Sequence[str] = ()) -> Comparison:
    """GF8080 if nothing of the log is in the result over a common time."""
    general, special = parse_tolerances(tolerances)
    quantities = [*trace.measurements, *trace.references]
    for name in special:
        if name not in quantities:
            raise GustformError(
                "GF8081",
                f"--tolerance names {name!r}, which the log does not have: {', '.join(quantities)}",
                hint=suggest(name, quantities),
            )
    if trace.start is None:
        raise GustformError(
            "GF8080", f"{trace.name} must have enabled references; the controller was never started", hint="--start"
        )
    control = _control(run, turbine)
    used = _used(control)
    idle = tuple(name for name in quantities if name in trace.idle and name not in used)
    pairs, missing = [], []
    for name in quantities:
        if name in idle:
            continue
        found = _channel(run, turbine, name)
        if found is None:
            missing.append(name)
            continue
        channel, sign = found
        curve = run.curve(channel)
        simulated = sign * (curve.values if curve.values.ndim == 1 else curve.values[:, 0])
        late = int(control.get("delay", 0)) if name in trace.references else None
        series = trace.references[name] if late is not None else trace.measurements[name]
        pair = _pair(Curve(name, curve.unit, channel, simulated), run.time, series, trace, late)
        if pair is not None:
            pairs.append(_judged(pair, special.get(name, general)))
    if not pairs:
        raise GustformError(
            "GF8080",
            f"{trace.name} and {run.path.name} must have a quantity and a stretch of time in common; they have none",
            hint="output.channels: ['*'], and the log of the same scenario",
        )
    counts = (trace.samples, trace.lost, trace.damaged)
    return Comparison(trace.name, str(run.path), tuple(pairs), tuple(missing), idle, *counts)


def turbine_of(run: RunData) -> str:
    """The only turbine of a result. GF8080 where there is none or several."""
    found = sorted({name.split(".")[0] for name in run.names() if name.endswith(".omega_r")})
    if len(found) != 1:
        raise GustformError(
            "GF8080",
            f"one turbine must be named: {run.path.name} has {', '.join(found) or 'none'}",
            hint=f"--turbine {found[0]}" if found else "output.channels: ['*']",
        )
    return found[0]


def _control(run: RunData, turbine: str) -> dict[str, Any]:
    """What the result's scenario says of the turbine's control; nothing where there is none."""
    try:
        plain = parse(run.attribute("scenario"), run.path.name).plain()
        found = plain["components"][turbine.partition("[")[0]]["control"]
    except (GustformError, KeyError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}


def _used(control: Mapping[str, Any]) -> set[str]:
    """What a control reads and commands."""
    kind = control.get("type")
    if kind not in controls():
        return set()
    block = default_block(str(kind))
    return {signal.name for signal in [*block.inputs, *block.outputs]}


def _channel(run: RunData, turbine: str, quantity: str) -> tuple[str, float] | None:
    """The channel of a turbine's quantity, and its sign."""
    names, aliases = run.names(), run.json("aliases") or {}
    for holder in _HOLDERS:
        path = f"{turbine}.{holder}{quantity}"
        if path in names:
            return path, 1.0
        if path in aliases and aliases[path][0] in names:
            return aliases[path][0], float(aliases[path][1])
    return None


def _pair(curve: Curve, time: Floats, series: Series, trace: Trace, late: int | None) -> Pair | None:
    """`late`: samples from a command to its acting; None for a measurement."""
    assert trace.start is not None
    aside = trace.period * _SAME_TIME
    sampled = (series.sample - trace.start + (late or 0)) * trace.period
    if late is None:
        inside = (time >= sampled[0] - aside) & (time <= sampled[-1] + aside)
        logged = np.interp(time, sampled, series.values)
    else:
        inside = (time > sampled[0] + aside) & (time <= sampled[-1] + trace.period + aside)
        logged = series.values[np.maximum(np.searchsorted(sampled, time - aside) - 1, 0)]
    time, values, logged = time[inside], curve.values[inside], logged[inside]
    if not len(time):
        return None
    difference = np.abs(logged - values)
    worst = int(np.argmax(difference))
    largest, at = float(difference[worst]), float(time[worst])
    found = Compared(curve.name, curve.description, curve.unit, len(time), largest, at, math.inf)
    return Pair(found, time, logged, values)


def _judged(pair: Pair, tolerance: float) -> Pair:
    return Pair(Compared(**{**asdict(pair.compared), "tolerance": tolerance}), pair.time, pair.logged, pair.simulated)


def as_text(comparison: Comparison) -> str:
    """The table."""
    lines = [f"{'quantity':<12} {'channel':<24} {'largest difference':>20} {'at':>11} {'tolerance':>10}"]
    for pair in comparison.pairs:
        one = pair.compared
        unit = one.unit if one.unit != "1" else ""
        lines.append(
            f"{one.quantity:<12} {one.channel:<24} {f'{one.largest:.3g} {unit}':>20} {f'{one.at:.3f} s':>11} "
            f"{one.tolerance:>10.3g}{'' if one.good else '   BEYOND'}"
        )
    if comparison.idle:
        lines.append(f"neither measured nor commanded: {', '.join(comparison.idle)}")
    if comparison.missing:
        lines.append(f"not in the result: {', '.join(comparison.missing)}")
    lines.append(f"{comparison.samples} samples, {comparison.lost} lost, {comparison.damaged} damaged frames")
    return "\n".join(lines)


def as_json(comparison: Comparison, figure: Path | None) -> str:
    """The same for a program."""
    document: Mapping[str, object] = {
        "log": comparison.log,
        "result": comparison.result,
        "good": comparison.good,
        "quantities": [{**asdict(pair.compared), "good": pair.compared.good} for pair in comparison.pairs],
        "missing": list(comparison.missing),
        "idle": list(comparison.idle),
        "samples": comparison.samples,
        "lost": comparison.lost,
        "damaged": comparison.damaged,
        "figure": None if figure is None else str(figure),
    }
    return json.dumps(document, indent=2)

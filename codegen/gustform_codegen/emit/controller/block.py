"""A control as a block: inputs, outputs, states with explicit derivatives, parameters.

    dx/dt = f(x, u, p),      y = g(x, u, p)

It is made from the declarations alone, by `flatten` of the control as a unit. Two components make one controller: the
control of both converters and the pitch control, whose demand `beta_ref` is the output. A schedule makes a third, which
gives the other two their operating point from tables. What no output depends on is left out: the pitch servo, which is
plant; a measurement that the control does not read. What the schedule gives can be looked at as well: monitors, which
nobody is commanded by.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from gustform.language.component import Component
from gustform.language.declare import Output
from gustform_codegen.emit.controller.look_up import Grid, expanded
from gustform_codegen.emit.controller.piece import Piece
from gustform_codegen.emit.controller.signals import Signal
from gustform_codegen.symbolic import Substitution, key_of, keys_in
from gustform_codegen.unit_type import Call

# Inputs of the pitch control and of the schedule by the names of the turbine's quantities.
_RENAMED = {"P": "P_pmsg"}
_PITCH_OUTPUT = "beta_ref"


@dataclass(frozen=True, eq=False)
class Block:
    """dx/dt = rates(x, u, p); y = results(x, u, p); all SX in the symbols of states, inputs and parameters.

    `results` are the outputs and, behind them, the monitors. `calls` are the look-ups in `tables` that they contain, in
    an order in which they can be evaluated.
    """

    name: str
    description: str
    inputs: list[Signal]
    outputs: list[Signal]
    results: list[Any]
    states: list[Signal]
    rates: list[Any]
    parameters: list[Signal]
    tables: list[Grid] = field(default_factory=list)
    calls: list[Call] = field(default_factory=list)
    monitors: list[Signal] = field(default_factory=list)


def controller_block(
    control: Component,
    pitch: Component,
    values: Mapping[str, float] | None = None,
    schedule: Component | None = None,
) -> Block:
    """The controller of a turbine: both converters and the pitch demand; with `schedule` also their operating point.

    `values` are found numbers by path, "control.gsc.Q_ref" or "pitch.P_filtered": free parameters and states of a
    steady state. GF4101 if a control cannot be exported.
    """
    values = values or {}
    kind = type(control)
    parts = [
        Piece(control, "control", {}, list(kind.declared(Output)), values),
        Piece(pitch, "pitch", _RENAMED, [_PITCH_OUTPUT], values),
    ]
    given: dict[str, Any] = {}
    monitors: list[Signal] = []
    if schedule is not None:
        part = Piece(schedule, "schedule", _RENAMED, list(type(schedule).declared(Output)), values)
        given = {s.name: result for s, result in zip(part.outputs, part.results, strict=True)}
        monitors, part.outputs, part.results = part.outputs, [], []
        parts.append(part)
    inputs: dict[str, Signal] = {}
    same, point = Substitution(), Substitution()
    for part in parts:
        for signal in part.inputs:
            if signal.name in given:
                point.add(signal.symbol, given[signal.name])
            elif signal.name in inputs:
                same.add(signal.symbol, inputs[signal.name].symbol)
            else:
                inputs[signal.name] = signal

    def joined(expressions: list[Any]) -> list[Any]:
        return same.apply(point.apply(expressions))

    states = [s for part in parts for s in part.states]
    rates = joined([r for part in parts for r in part.rates])
    outputs = [s for part in parts for s in part.outputs]
    results = joined([*(r for part in parts for r in part.results), *given.values()])
    tables = [grid for part in parts for grid in part.tables]
    calls = []
    for part in parts:
        first = sum(len(p.tables) for p in parts[: parts.index(part)])
        for call in part.calls:
            x, y = joined([call.x, call.y])
            calls.append(replace(call, table=first + call.table, x=x, y=y))
    kept = _needed(states, rates, results, calls)
    states, rates = [states[k] for k in kept], [rates[k] for k in kept]
    used = {key for e in [*rates, *results] for part in expanded(e, calls) for key in keys_in(part)}
    calls = [call for call in calls if key_of(call.value) in used]
    looked_up = sorted({call.table for call in calls})
    return Block(
        kind.__name__,
        (kind.__doc__ or kind.__name__).strip().splitlines()[0],
        [s for s in inputs.values() if key_of(s.symbol) in used],
        outputs,
        results,
        states,
        rates,
        [s for part in parts for s in part.parameters if key_of(s.symbol) in used],
        [tables[k] for k in looked_up],
        [replace(call, table=looked_up.index(call.table)) for call in calls],
        monitors,
    )


def _needed(states: list[Signal], rates: list[Any], results: list[Any], calls: list[Call]) -> list[int]:
    """The states that an output depends on, directly or through others or a table."""
    index = {key_of(s.symbol): k for k, s in enumerate(states)}

    def read(expression: Any) -> list[int]:
        return [index[key] for part in expanded(expression, calls) for key in keys_in(part) if key in index]

    wanted: set[int] = set()
    pending = [k for r in results for k in read(r)]
    while pending:
        k = pending.pop()
        if k not in wanted:
            wanted.add(k)
            pending += read(rates[k])
    return sorted(wanted)

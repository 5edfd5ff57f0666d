"""A control as a block: inputs, outputs, states with explicit derivatives, parameters.

    dx/dt = f(x, u, p),      y = g(x, u, p)

It is made from the declarations alone, by `flatten` of the control as a unit. Two components make one controller: the
control of both converters and the pitch control, whose demand `beta_ref` is the output. A schedule makes a third, which
gives the other two their operating point from tables. What no output depends on is left out: the pitch servo, which is
plant; a measurement that the control does not read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca

from gustform.language.component import Component
from gustform.language.declare import Input, Output, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.look_up import Grid, expanded
from gustform_codegen.emit.controller.ranges import INPUT_RANGES, OUTPUT_RANGES
from gustform_codegen.flatten import flatten
from gustform_codegen.symbolic import Substitution, key_of, keys_in, solve_for
from gustform_codegen.unit_type import Call, UnitType

# Inputs of the pitch control and of the schedule by the names of the turbine's quantities.
_RENAMED = {"P": "P_pmsg"}
_PITCH_OUTPUT = "beta_ref"


@dataclass(frozen=True, eq=False)
class Signal:
    """A named quantity of the controller. `value`: default of a parameter, start of a signal or state.

    `exclusive`: the lower bound itself is not allowed.
    """

    name: str
    symbol: Any
    unit: str
    description: str
    low: float
    high: float
    value: float
    nominal: float = 1.0
    exclusive: bool = False


@dataclass(frozen=True, eq=False)
class Block:
    """dx/dt = rates(x, u, p); y = results(x, u, p); all SX in the symbols of states, inputs and parameters.

    `calls` are the look-ups in `tables` that they contain, in an order in which they can be evaluated.
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
        _Piece(control, "control", {}, list(kind.declared(Output)), values),
        _Piece(pitch, "pitch", _RENAMED, [_PITCH_OUTPUT], values),
    ]
    given: dict[str, Any] = {}
    if schedule is not None:
        part = _Piece(schedule, "schedule", _RENAMED, list(type(schedule).declared(Output)), values)
        given = {s.name: result for s, result in zip(part.outputs, part.results, strict=True)}
        part.outputs, part.results = [], []
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
    results = joined([r for part in parts for r in part.results])
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
    )


def alone(component: Component) -> Component:
    """A copy without a parent, in which everything bound by the parent is a number."""
    given: dict[str, Any] = {}
    for name, declaration in component.declarations().items():
        if isinstance(declaration, Parameter):
            given[name] = component.value(name)
        elif isinstance(declaration, Table):
            given[name] = component.table(name)
        elif isinstance(declaration, Part):
            given[name] = alone(component.part(name))
        elif isinstance(declaration, Variable) and not isinstance(declaration, Input):
            given[name] = component.start_value(declaration)
    return type(component)(**given)


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


class _Piece:
    """One component of the controller, flattened by itself."""

    def __init__(
        self,
        component: Component,
        place: str,
        renamed: Mapping[str, str],
        outputs: list[str],
        values: Mapping[str, float],
    ) -> None:
        self.name, self.place, self.values = type(component).__name__, place, values
        self.original = component
        self.copy = alone(component)
        self.unit = flatten(self.copy)
        self._refuse()
        self.bound = self._bound_parameters()
        self.inputs = [self._input(s.symbol, renamed.get(s.path, s.path), s) for s in self.unit.inputs]
        self.parameters = self._parameters()
        states = [u for u in self.unit.unknowns if u.der is not None]
        self.states = [
            Signal(
                self._c_name(u.path),
                u.symbol,
                u.declared.unit,
                u.declared.description,
                -ca.inf,
                ca.inf,
                self._start(u.path, u.declared),
            )
            for u in states
        ]
        self.rates = self.bound.apply([self._rate(u.path, u.der) for u in states])
        self.outputs, self.results = [], []
        for name in outputs:
            sign, expression = _value_of(self.unit, name)
            low, high = self._range(
                {**INPUT_RANGES, **OUTPUT_RANGES}, name
            )  # what a schedule gives is an input of others
            d = self.copy.declared(Variable)[name]
            start, nominal = self.copy.start_value(d), self.copy.number(d.nominal)
            self.outputs.append(Signal(name, None, d.unit, d.description, low, high, start, nominal))
            self.results.append(sign * expression)
        self.results = self.bound.apply(self.results)
        self.tables = [self._grid(ref.owner.path, ref.declaration) for ref in self.unit.tables]
        self.calls = [
            replace(call, x=x, y=y) for call in self.unit.calls for x, y in [self.bound.apply([call.x, call.y])]
        ]

    def _grid(self, owner: str, declared: Any) -> Grid:
        path = f"{owner}.{declared.name}" if owner else declared.name
        return Grid(self._c_name(path), declared, self.copy.at(owner).table(declared.name).spline())

    def _fail(self, what: str, hint: str) -> GustformError:
        return GustformError("GF4101", f"{self.name} cannot be exported as a sampled controller: {what}", hint=hint)

    def _refuse(self) -> None:
        unit = self.unit
        loops = [u.path for u in unit.unknowns if u.der is None]
        if loops:
            raise self._fail(f"{', '.join(loops)} must be iterated on", "explicit equations")
        if unit.discretes or unit.whens:
            raise self._fail("it has events", "limit(), maximum(), minimum()")
        if unit.externals:
            raise self._fail(f"it has a connector ({unit.externals[0].path})", "inputs and outputs only")

    def _range(self, ranges: Mapping[str, tuple[float, float]], name: str) -> tuple[float, float]:
        if name not in ranges:
            raise self._fail(f"no range is known for the signal {name}", "a line in emit/controller/ranges.py")
        return ranges[name]

    def _input(self, symbol: Any, name: str, declared: Any) -> Signal:
        low, high = self._range(INPUT_RANGES, name)
        start = self.copy.number(declared.declaration.start)
        nominal = self.copy.number(declared.declaration.nominal)
        return Signal(name, symbol, declared.unit, declared.description, low, high, start, nominal)

    def _bound_parameters(self) -> Substitution:
        """Parameters of parts that only repeat one of their parent: the parent's own symbol stands for them."""
        symbols = {p.path: p.symbol for p in self.unit.parameters}
        result = Substitution()
        for parameter in self.unit.parameters:
            target = parameter.path
            while True:
                head, _, name = target.rpartition(".")
                owner = self.original.at(head)
                above = _repeated(owner, name) if head else None
                if above is None:
                    break
                parent = head.rpartition(".")[0]
                target = f"{parent}.{above}" if parent else above
            if target != parameter.path and target in symbols:
                result.add(parameter.symbol, symbols[target])
        return result

    def _parameters(self) -> list[Signal]:
        numbers = self.copy.parameter_values()
        result = []
        for p in self.unit.parameters:
            if key_of(p.symbol) in self.bound.known:
                continue
            d = p.declaration
            assert isinstance(d, Parameter)
            low = d.above if d.above is not None else d.min if d.min is not None else -ca.inf
            high = d.max if d.max is not None else ca.inf
            value = self.values.get(f"{self.place}.{p.path}", numbers[p.path])
            result.append(
                Signal(
                    self._c_name(p.path),
                    p.symbol,
                    p.unit,
                    p.description,
                    low,
                    high,
                    value,
                    exclusive=d.above is not None,
                )
            )
        return result

    def _c_name(self, path: str) -> str:
        return (path if self.place == "control" else f"{self.place}.{path}").replace(".", "_")

    def _start(self, path: str, declared: Any) -> float:
        found = self.values.get(f"{self.place}.{path}")
        return self.copy.at(declared.owner.path).start_value(declared.declaration) if found is None else found

    def _rate(self, path: str, der: Any) -> Any:
        for row in self.unit.rows:
            if key_of(der) in keys_in(row.expression):
                rate = solve_for(row.expression, der)
                ders = {key_of(u.der) for u in self.unit.unknowns if u.der is not None}
                if ders.isdisjoint(keys_in(rate)):
                    return rate
        raise self._fail(f"der({path}) is not explicit", "an equation der(x) = ...")


def _value_of(unit: UnitType, path: str) -> tuple[int, Any]:
    """Sign and expression of a variable of a unit."""
    target, sign = unit.aliases.get(path, (path, 1))
    symbols = {u.path: u.symbol for u in unit.unknowns} | {s.path: s.symbol for s in unit.inputs}
    if target in symbols:
        return sign, symbols[target]
    return sign, next(r.expression for r in unit.recorded if r.path == target)


def _repeated(owner: Component, name: str) -> str | None:
    """The parameter of the parent that `owner.name` repeats, if its binding is nothing but that."""
    if not owner.is_bound(name):
        return None
    seen: list[str] = []

    class Probe:
        def __getattr__(self, wanted: str) -> float:
            seen.append(wanted)
            return _MARK

    try:
        result = owner._modifiers[name](Probe())
    except TypeError:  # it does more than repeat
        return None
    return seen[0] if result is _MARK and len(seen) == 1 else None


_MARK = 0.123456789  # told apart by identity

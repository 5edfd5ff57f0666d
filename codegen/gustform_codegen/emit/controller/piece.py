"""One component of a controller, flattened by itself: signals, rates, results, look-ups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from gustform.language.component import Component
from gustform.language.declare import Input, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.look_up import Grid
from gustform_codegen.emit.controller.ranges import INPUT_RANGES, OUTPUT_RANGES
from gustform_codegen.emit.controller.signals import Signal
from gustform_codegen.flatten import flatten
from gustform_codegen.symbolic import Substitution, key_of, keys_in, solve_for
from gustform_codegen.unit_type import UnitType

_MARK = 0.123456789  # told apart by identity


class Piece:
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

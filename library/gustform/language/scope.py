"""Elaboration: from a component to its symbols and equations.

`elaborate(component)` walks the tree of parts once, makes a CasADi symbol for every declared quantity, runs every
`equations()` and returns an `Elaborated`: plain lists, nothing simplified, nothing judged yet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from gustform.language.component import AnyDeclaration, Component, Source
from gustform.language.connector import Connector, Flow, Port, Potential
from gustform.language.declare import Declaration, Discrete, Input, Output, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError
from gustform.language.units import SECOND, Dimension


@dataclass(frozen=True)
class Symbol:
    """A declared quantity with its CasADi symbol.

    kind: parameter, variable, output, input, potential, flow, discrete. `owner` is the numeric component that
    declares it (for its start and nominal), `port` the connector of a potential or flow.
    """

    path: str
    kind: str
    symbol: Any
    unit: str
    dimension: Dimension
    description: str
    declaration: Declaration
    owner: Component
    port: Any = None  # the Connector; Any because type checkers would take it for a descriptor here


@dataclass(frozen=True)
class Equation:
    """lhs = rhs as written, with its component's path and source line."""

    lhs: Any
    rhs: Any
    path: str
    source: Source

    def __str__(self) -> str:
        return f"{self.path + ': ' if self.path else ''}{self.source}"


@dataclass(frozen=True)
class When:
    """A when-clause: `condition` (None for a sampled one), `period` symbol (None for a condition)."""

    condition: Any
    period: Any
    assign: list[tuple[Any, Any]]
    reinit: list[tuple[Any, Any]]
    path: str
    source: Source


@dataclass(frozen=True)
class TableRef:
    """A declared table of one component instance, as `table2` takes it."""

    declaration: Table
    owner: Component


@dataclass
class Elaborated:
    """Everything a unit declares and states. `symbols` maps a CasADi element hash to its Symbol."""

    component: Component
    symbols: dict[int, Symbol] = field(default_factory=dict)
    equations: list[Equation] = field(default_factory=list)
    initial: list[Equation] = field(default_factory=list)
    connections: list[tuple[Port, Port, str, Source]] = field(default_factory=list)
    whens: list[When] = field(default_factory=list)
    derivatives: dict[int, Any] = field(default_factory=dict)  # variable hash -> der symbol
    ports: dict[str, Port] = field(default_factory=dict)
    tables: list[TableRef] = field(default_factory=list)

    def of_kind(self, *kinds: str) -> Iterator[Symbol]:
        return (symbol for symbol in self.symbols.values() if symbol.kind in kinds)

    def by_path(self, path: str) -> Symbol | None:
        return next((symbol for symbol in self.symbols.values() if symbol.path == path), None)


class Scope:
    """The symbols of one component of the tree while its equations are collected."""

    def __init__(self, elaborated: Elaborated, component: Component) -> None:
        self.elaborated = elaborated
        self.component = component
        self.path = component.path
        self._items: dict[str, Any] = {}

    # ---- symbols ----
    def symbol(self, declaration: AnyDeclaration) -> Any:
        if declaration.name not in self._items:
            raise GustformError("GF1011", f"{self.path}.{declaration.name} is used before its component is set up")
        return self._items[declaration.name]

    def _label(self, name: str) -> str:
        return f"{self.path}.{name}" if self.path else name

    def _new(self, declaration: Declaration, path: str, kind: str, port: Connector | None = None) -> Any:
        symbol = ca.SX.sym(path)
        self.elaborated.symbols[symbol.element_hash()] = Symbol(
            path,
            kind,
            symbol,
            declaration.unit,
            declaration.dimension,
            declaration.description,
            declaration,
            self.component,
            port,
        )
        return symbol

    def declare(self, held: Sequence[str] = ()) -> None:
        """Make the symbols of every declaration except parts. Where values are held: of those, inputs and outputs."""
        for name, declaration in self.component.declarations().items():
            label = self._label(name)
            if name in held:
                assert isinstance(declaration, Variable)
                self._items[name] = self._new(declaration, label, "discrete")
            elif held and not _stays(declaration):
                continue
            elif isinstance(declaration, Parameter):
                if declaration.structural:
                    self._items[name] = self.component.value(name)
                else:
                    self._items[name] = self._new(declaration, label, "parameter")
            elif isinstance(declaration, Table):
                reference = TableRef(declaration, self.component)
                self._items[name] = reference
                self.elaborated.tables.append(reference)
            elif isinstance(declaration, Input):
                self._items[name] = self._new(declaration, label, "input")
            elif isinstance(declaration, Output):
                self._items[name] = self._new(declaration, label, "output")
            elif isinstance(declaration, Variable):
                self._items[name] = self._new(declaration, label, "variable")
            elif isinstance(declaration, Discrete):
                self._items[name] = self._new(declaration, label, "discrete")
            elif isinstance(declaration, Connector):
                members: dict[str, Any] = {}
                for key, item in {**declaration._potentials, **declaration._flows}.items():
                    kind = "potential" if isinstance(item, Potential) else "flow"
                    assert isinstance(item, Potential | Flow)
                    members[key] = self._new(item, f"{label}.{key}", kind, declaration)
                port = Port(label, declaration, members)
                self._items[name] = port
                self.elaborated.ports[label] = port

    def add_part(self, name: str, view: Component) -> None:
        self._items[name] = view

    # ---- statements ----
    def _expression(self, value: Any, source: Source) -> Any:
        try:
            expression = ca.SX(value)
        except (NotImplementedError, TypeError):
            raise GustformError(
                "GF1012", f"{self.path or type(self.component).__name__}: {value!r} is not an expression in {source}"
            ) from None
        if expression.numel() != 1:
            raise GustformError("GF1012", f"{source}: equations are scalar; got {expression.shape}")
        return expression

    def add_equation(self, lhs: Any, rhs: Any, source: Source) -> None:
        self.elaborated.equations.append(
            Equation(self._expression(lhs, source), self._expression(rhs, source), self.path, source)
        )

    def add_initial(self, lhs: Any, rhs: Any, source: Source) -> None:
        self.elaborated.initial.append(
            Equation(self._expression(lhs, source), self._expression(rhs, source), self.path, source)
        )

    def add_connection(self, a: Any, b: Any, source: Source) -> None:
        if isinstance(a, Port) and isinstance(b, Port):
            if type(a.connector) is not type(b.connector):
                raise GustformError(
                    "GF3001",
                    f"cannot connect {a.path} ({type(a.connector).__name__}) to {b.path} "
                    f"({type(b.connector).__name__}) in {source}",
                    hint="ports of one connector type",
                )
            self.elaborated.connections.append((a, b, self.path, source))
        elif isinstance(a, Port) or isinstance(b, Port):
            raise GustformError("GF3001", f"cannot connect a port to a signal in {source}")
        else:
            self.add_equation(a, b, source)

    def derivative(self, variable: Any, source: Source) -> Any:
        expression = self._expression(variable, source)
        known = self.elaborated.symbols.get(expression.element_hash()) if expression.is_symbolic() else None
        if known is None or known.kind not in ("variable", "output", "potential"):
            raise GustformError(
                "GF1013",
                f"der() takes a declared variable; got {expression} in {source}",
                hint="a Variable for the quantity and der() of it",
            )
        key = expression.element_hash()
        if key not in self.elaborated.derivatives:
            self.elaborated.derivatives[key] = ca.SX.sym(f"der({known.path})")
        return self.elaborated.derivatives[key]

    def _assignments(self, items: dict[Any, Any], kinds: tuple[str, ...], source: Source) -> list[tuple[Any, Any]]:
        pairs = []
        for target, value in items.items():
            known = self.elaborated.symbols.get(target.element_hash()) if isinstance(target, ca.SX) else None
            if known is None or known.kind not in kinds:
                raise GustformError("GF1014", f"{target} cannot be set here: not a {' or '.join(kinds)} in {source}")
            pairs.append((target, self._expression(value, source)))
        return pairs

    def add_when(self, condition: Any, assign: dict[Any, Any], reinit: dict[Any, Any], source: Source) -> None:
        self.elaborated.whens.append(
            When(
                self._expression(condition, source),
                None,
                self._assignments(assign, ("discrete",), source),
                self._assignments(reinit, ("variable", "output"), source),
                self.path,
                source,
            )
        )

    def add_sampled(self, period: Any, assign: dict[Any, Any], reinit: dict[Any, Any], source: Source) -> None:
        self.elaborated.whens.append(
            When(
                None,
                self._expression(period, source),
                self._assignments(assign, ("discrete",), source),
                self._assignments(reinit, ("variable", "output"), source),
                self.path,
                source,
            )
        )


def _stays(declaration: AnyDeclaration) -> bool:
    """Whether a component that holds values has this one in the system."""
    if isinstance(declaration, Parameter):
        return declaration.structural
    return isinstance(declaration, Input | Output | Connector)


def elaborate(component: Component) -> Elaborated:
    """The symbols and equations of a unit. The component itself is not changed."""
    elaborated = Elaborated(component)
    views: list[tuple[Component, bool]] = []

    def view_of(numeric: Component) -> Component:
        view = object.__new__(type(numeric))
        view._modifiers, view._parts, view._path = numeric._modifiers, {}, numeric.path
        view._numbers = {}
        scope = Scope(elaborated, numeric)
        view._scope = scope
        held = numeric.held()
        scope.declare(held)
        for name, declaration in numeric.declarations().items():
            if isinstance(declaration, Part) and (not held or name in numeric.kept_parts):
                scope.add_part(name, view_of(numeric.part(name)))
        views.append((view, bool(held)))
        return view

    view_of(component)
    for view, holds in views:
        if holds:
            view.held_equations()
        else:
            view.equations()
    return elaborated


def derivative_dimension(symbol: Symbol) -> Dimension:
    """The dimension of a variable's time derivative."""
    return symbol.dimension / SECOND

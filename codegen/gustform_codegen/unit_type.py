"""UnitType: the flattened, compiled-once form of one unit. A frozen result; later phases only read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gustform.language.component import Component
from gustform.language.scope import Symbol, TableRef


@dataclass(frozen=True, eq=False)
class Unknown:
    """A local unknown of the DAE: a state (with `der` symbol) or an iteration variable (der None)."""

    path: str
    symbol: Any
    der: Any | None
    declared: Symbol


@dataclass(frozen=True, eq=False)
class External:
    """A value read from the system: a connector potential or a wired signal."""

    path: str
    symbol: Any
    declared: Symbol


@dataclass(frozen=True, eq=False)
class Row:
    """A residual row, or an initial equation: expression = 0, and how it was written."""

    expression: Any
    text: str


@dataclass(frozen=True, eq=False)
class BoundaryFlow:
    """A flow into the unit at one of its ports, and the potential whose sum row it enters."""

    path: str
    potential: str
    expression: Any


@dataclass(frozen=True, eq=False)
class Recorded:
    """A variable that is not an unknown but can be computed from the unknowns for recording."""

    path: str
    expression: Any
    declared: Symbol


@dataclass(frozen=True, eq=False)
class Call:
    """value = table(x, y), with symbols for the value and its two slopes."""

    value: Any
    x_slope: Any
    y_slope: Any
    table: int
    x: Any
    y: Any


@dataclass(frozen=True, eq=False)
class WhenClause:
    """root: index of its zero-crossing function, or -1; period: index of the parameter with its period, or -1."""

    root: int
    period: int
    assign: list[tuple[int, Any]]  # (discrete index, value)
    reinit: list[tuple[int, Any]]  # (unknown index, value)
    text: str


@dataclass(frozen=True, eq=False)
class Root:
    """A zero-crossing function. kind 0: a bend of a limiter; 1: the condition of a when-clause."""

    kind: int
    expression: Any
    text: str


@dataclass(frozen=True, eq=False)
class UnitType:
    """0 = rows(y, der y, w, u, d, p); flows(y, der y, w, u, d, p). All expressions are CasADi SX in these symbols
    and in the values of `calls`, which may be used in order."""

    name: str
    component: Component
    parameters: list[Symbol]
    unknowns: list[Unknown]
    externals: list[External]
    inputs: list[Symbol]
    discretes: list[Symbol]
    tables: list[TableRef]
    calls: list[Call]
    rows: list[Row]
    flows: list[BoundaryFlow]
    recorded: list[Recorded]
    aliases: dict[str, tuple[str, int]]  # path -> (path of the unknown, external or recorded variable, sign)
    roots: list[Root]
    whens: list[WhenClause]
    initial: list[Row]
    free_parameters: list[int]
    substituted: int  # explicit algebraic variables that never reach the solver
    declared_equations: int

    @property
    def n_states(self) -> int:
        return sum(unknown.der is not None for unknown in self.unknowns)

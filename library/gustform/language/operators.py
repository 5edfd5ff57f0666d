"""Limiters, table look-ups and constants with a unit, for use in equations.

A limiter is continuous; where it bends, the compiled type gets a zero-crossing function, so that the solver can stop
at the bend and go on from there (`run: limiters: locate`) or pass over it under its error control
(`run: limiters: pass`). Because the residual always evaluates the limiter itself and never a remembered branch,
it cannot chatter.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gustform.language.declare import Table
from gustform.language.errors import GustformError
from gustform.language.units import Dimension, dimension_of

_numbers = itertools.count()


@dataclass(frozen=True)
class Constant:
    """A symbol that stands for a number with a dimension; replaced by the number when a type is flattened."""

    symbol: Any
    value: float
    dimension: Dimension


@dataclass(frozen=True)
class TableCall:
    """A symbol that stands for table(x, y)."""

    symbol: Any
    table: Table
    owner: Any
    x: Any
    y: Any


constants: dict[int, Constant] = {}
table_calls: dict[int, TableCall] = {}


def quantity(value: float, unit: str) -> Any:
    """A constant with a unit: `x / quantity(1, "deg")` is the number of degrees."""
    symbol = ca.SX.sym(f"{value:g} {unit}")
    constants[symbol.element_hash()] = Constant(symbol, float(value), dimension_of(unit))
    return symbol


def maximum(a: Any, b: Any) -> Any:
    """The larger of two expressions; bends where they are equal."""
    return ca.fmax(a, b)


def minimum(a: Any, b: Any) -> Any:
    """The smaller of two expressions; bends where they are equal."""
    return ca.fmin(a, b)


def limit(x: Any, lower: Any, upper: Any) -> Any:
    """x kept within [lower, upper]."""
    return ca.fmin(ca.fmax(x, lower), upper)


def dead_band(x: Any, half_width: Any) -> Any:
    """0 within +-half_width, x -+ half_width outside (no step at the edges)."""
    return x - limit(x, -half_width, half_width)


def table2(table: Any, x: Any, y: Any) -> Any:
    """The value of a declared `Table` at (x, y): C2 in both arguments, arguments clamped to the grid."""
    declaration, owner = getattr(table, "declaration", None), getattr(table, "owner", None)
    if declaration is None or owner is None:
        raise GustformError(
            "GF1010", "table2 takes a declared Table as its first argument", hint="table2(self.cp, ...)"
        )
    symbol = ca.SX.sym(f"{owner.path}.{declaration.name}#{next(_numbers)}")
    table_calls[symbol.element_hash()] = TableCall(symbol, declaration, owner, ca.SX(x), ca.SX(y))
    return symbol

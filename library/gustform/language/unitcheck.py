"""Unit check of equations, by walking CasADi's instruction list with a dimension for every value.

Rules: a number that is not zero is dimensionless; both sides of +, -, min, max and comparisons agree; arguments of
sin, exp, ... are dimensionless; sqrt halves and a constant power multiplies the exponents.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import casadi as ca

from gustform.language.errors import GustformError, Place
from gustform.language.operators import constants, table_calls
from gustform.language.scope import Elaborated, Equation, derivative_dimension
from gustform.language.units import DIMENSIONLESS, SECOND, Dimension

# A dimension, or None for the number 0, which fits anywhere; with the value if the node is a number.
_Node = tuple[Dimension | None, float | None]

_SAME = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_FMIN: "min", ca.OP_FMAX: "max", ca.OP_HYPOT: "hypot"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_KEEP = {ca.OP_NEG, ca.OP_FABS, ca.OP_TWICE, ca.OP_ASSIGN}


class _Mismatch(Exception):
    pass


class _Undeclared(Exception):
    pass


def _agree(a: _Node, b: _Node, what: str) -> Dimension | None:
    if a[0] is None:
        return b[0]
    if b[0] is None or a[0] == b[0]:
        return a[0]
    raise _Mismatch(f"{what} joins {a[0]} and {b[0]}")


def _walk(expression: Any, dimension: Callable[[Any], Dimension]) -> Dimension | None:
    symbols = ca.symvar(expression)
    function = ca.Function("f", symbols, [expression])
    work: dict[int, _Node] = {}
    result: Dimension | None = None
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        o = function.instruction_output(k)
        if op == ca.OP_INPUT:
            work[o[0]] = (dimension(symbols[function.instruction_input(k)[0]]), None)
            continue
        if op == ca.OP_CONST:
            value = function.instruction_constant(k)
            work[o[0]] = (None if value == 0 else DIMENSIONLESS, value)
            continue
        a = [work[i] for i in function.instruction_input(k)]
        if op == ca.OP_OUTPUT:
            result = a[0][0]
        elif op in _SAME:
            work[o[0]] = (_agree(a[0], a[1], f"'{_SAME[op]}'"), None)
        elif op in _COMPARE:
            _agree(a[0], a[1], f"'{_COMPARE[op]}'")
            work[o[0]] = (DIMENSIONLESS, None)
        elif op == ca.OP_MUL:
            work[o[0]] = (None if a[0][0] is None or a[1][0] is None else a[0][0] * a[1][0], None)
        elif op == ca.OP_DIV:
            work[o[0]] = (None if a[0][0] is None else a[0][0] / (a[1][0] or DIMENSIONLESS), None)
        elif op == ca.OP_SQ:
            work[o[0]] = (None if a[0][0] is None else a[0][0] ** 2, None)
        elif op == ca.OP_INV:
            work[o[0]] = (DIMENSIONLESS / (a[0][0] or DIMENSIONLESS), None)
        elif op == ca.OP_SQRT:
            work[o[0]] = (None if a[0][0] is None else a[0][0] ** Fraction(1, 2), None)
        elif op == ca.OP_IF_ELSE_ZERO:
            work[o[0]] = a[1]
        elif op in _KEEP:
            work[o[0]] = a[0]
        elif op in (ca.OP_POW, ca.OP_CONSTPOW) and a[1][1] is not None and a[0][0] is not None:
            work[o[0]] = (a[0][0] ** Fraction(a[1][1]).limit_denominator(1000), None)
        elif op == ca.OP_ATAN2:
            _agree(a[0], a[1], "atan2")
            work[o[0]] = (DIMENSIONLESS, None)
        else:
            for node in a:
                if node[0] is not None and node[0] != DIMENSIONLESS:
                    raise _Mismatch(f"a function of {node[0]}, where a dimensionless number is needed")
            work[o[0]] = (DIMENSIONLESS, None)
    return result


def check_units(elaborated: Elaborated) -> None:
    """Raise GF1020 at the first equation whose sides or terms have different units."""
    dimensions = {key: symbol.dimension for key, symbol in elaborated.symbols.items()}
    for key, der in elaborated.derivatives.items():
        dimensions[der.element_hash()] = derivative_dimension(elaborated.symbols[key])

    def dimension(symbol: Any) -> Dimension:
        key = symbol.element_hash()
        if key in dimensions:
            return dimensions[key]
        if key in constants:
            return constants[key].dimension
        if key in table_calls:
            return table_calls[key].table.dimension
        raise _Undeclared(str(symbol))

    def arguments(expression: Any) -> None:
        for symbol in ca.symvar(expression):
            call = table_calls.get(symbol.element_hash())
            if call is not None:
                for argument, wanted, axis in (
                    (call.x, call.table.x_dimension, "x"),
                    (call.y, call.table.y_dimension, "y"),
                ):
                    _agree((_walk(argument, dimension), None), (wanted, None), f"the table's {axis}")
                    arguments(argument)

    def both(equation: Equation, what: str = "'='") -> None:
        place = Place(equation.source.file, equation.source.line)
        try:
            lhs, rhs = _walk(equation.lhs, dimension), _walk(equation.rhs, dimension)
            _agree((lhs, None), (rhs, None), what)
            arguments(equation.lhs)
            arguments(equation.rhs)
        except _Mismatch as mismatch:
            raise GustformError(
                "GF1020",
                f"units do not match in {equation}: {mismatch}",
                hint="the unit of each term (gustform info lists the declared ones)",
                place=place,
            ) from None
        except _Undeclared as symbol:
            raise GustformError(
                "GF1019",
                f"{symbol} in {equation} is not declared in this model",
                hint="a Variable or Parameter of the component, reached through self",
                place=place,
            ) from None

    second = ca.SX.sym("1 s")
    dimensions[second.element_hash()] = SECOND
    for equation in [*elaborated.equations, *elaborated.initial]:
        both(equation)
    for when in elaborated.whens:
        for target, value in [*when.assign, *when.reinit]:
            both(Equation(target, value, when.path, when.source))
        if when.condition is not None:
            both(Equation(when.condition, when.condition, when.path, when.source))
        else:
            both(Equation(when.period, second, when.path, when.source), "the sample period")

"""Small symbolic tools: substitution, and exact solutions of scalar and small linear equations."""

from __future__ import annotations

from typing import Any

import casadi as ca


def key_of(symbol: Any) -> int:
    """The identity of a CasADi symbol."""
    return int(symbol.element_hash())


def keys_in(expression: Any) -> list[int]:
    """The identities of the symbols an expression contains."""
    return [key_of(s) for s in ca.symvar(expression)]


class Substitution:
    """Symbols and what they are replaced by, applied in one pass."""

    def __init__(self) -> None:
        self.symbols: list[Any] = []
        self.values: list[Any] = []
        self.known: set[int] = set()

    def add(self, symbol: Any, value: Any) -> None:
        self.symbols.append(symbol)
        self.values.append(value)
        self.known.add(key_of(symbol))

    def and_also(self, symbol: Any, value: Any) -> Substitution:
        """A copy with one more."""
        result = Substitution()
        result.symbols, result.values = [*self.symbols, symbol], [*self.values, value]
        result.known = self.known | {key_of(symbol)}
        return result

    def apply(self, expressions: list[Any]) -> list[Any]:
        if not self.symbols or not expressions:
            return expressions
        used = {key for e in expressions for key in keys_in(e)} & self.known
        if not used:
            return expressions
        chosen = [k for k, s in enumerate(self.symbols) if key_of(s) in used]
        return list(ca.substitute(expressions, [self.symbols[k] for k in chosen], [self.values[k] for k in chosen]))

    def one(self, expression: Any) -> Any:
        return self.apply([expression])[0]


def solve_for(expression: Any, symbol: Any) -> Any:
    """The value of `symbol` in expression = 0, which is linear in it."""
    for op, sign in ((ca.OP_SUB, 1), (ca.OP_ADD, -1)):
        if expression.is_op(op):
            a, b = expression.dep(0), expression.dep(1)
            if a.is_symbolic() and key_of(a) == key_of(symbol) and not ca.depends_on(b, symbol):
                return sign * b
            if b.is_symbolic() and key_of(b) == key_of(symbol) and not ca.depends_on(a, symbol):
                return sign * a
    slope = ca.jacobian(expression, symbol)
    rest = ca.substitute(expression, symbol, ca.SX(0))
    return -rest / slope


def solve_linear(residuals: list[Any], symbols: list[Any]) -> list[Any] | None:
    """Cramer's rule for up to three unknowns; None if the residuals are not linear in them."""
    vector, unknown = ca.vertcat(*residuals), ca.vertcat(*symbols)
    matrix = ca.jacobian(vector, unknown)
    if ca.depends_on(matrix, unknown):
        return None
    right = -ca.substitute(vector, unknown, ca.SX.zeros(len(symbols)))
    matrix = ca.densify(matrix)
    determinant = _det(matrix)
    if determinant.is_zero():
        return None
    inverse = 1 / determinant
    result = []
    for k in range(len(symbols)):
        replaced = ca.SX(matrix)
        replaced[:, k] = right
        result.append(_det(replaced) * inverse)
    return result


def _det(m: Any) -> Any:
    if m.shape[0] == 1:
        return m[0, 0]
    if m.shape[0] == 2:
        return m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    return (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )

"""From a CasADi SX function to straight-line C, with value numbering and hoisting.

CasADi's instruction list is walked once. Equal subexpressions get one name (value numbering across everything printed
for one C function), and whatever depends on parameters alone moves into the `prepare` function that runs once per
parameter change: the `Hoister` collects it for all functions of a kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from gustform.language.errors import GustformError

_INFIX = {
    ca.OP_ADD: "+",
    ca.OP_SUB: "-",
    ca.OP_MUL: "*",
    ca.OP_DIV: "/",
    ca.OP_LT: "<",
    ca.OP_LE: "<=",
    ca.OP_EQ: "==",
    ca.OP_NE: "!=",
    ca.OP_AND: "&&",
    ca.OP_OR: "||",
}
_BOOLEAN = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT}
_CALL = {
    ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_SINH: "sinh", ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh", ca.OP_ASINH: "asinh", ca.OP_ACOSH: "acosh", ca.OP_ATANH: "atanh", ca.OP_FABS: "fabs",
    ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow", ca.OP_ATAN2: "atan2",
    ca.OP_HYPOT: "hypot", ca.OP_COPYSIGN: "copysign", ca.OP_FMOD: "fmod", ca.OP_ERF: "erf",
    ca.OP_LOG1P: "log1p", ca.OP_EXPM1: "expm1",
}  # fmt: skip
_COMMUTATIVE = {ca.OP_ADD, ca.OP_MUL, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR}


def literal(value: float) -> str:
    """A C double literal that reads back to the same bits."""
    text = repr(float(value))
    if text in ("inf", "-inf", "nan"):
        return {"inf": "INFINITY", "-inf": "(-INFINITY)", "nan": "NAN"}[text]
    text = text if any(c in text for c in ".en") else text + ".0"
    return f"({text})" if text.startswith("-") else text


def _c_expression(op: int, a: Sequence[str]) -> str:
    if op in _BOOLEAN:
        inner = (
            f"{a[0]} == 0.0"
            if op == ca.OP_NOT
            else (
                f"{a[0]} != 0.0 {_INFIX[op]} {a[1]} != 0.0"
                if op in (ca.OP_AND, ca.OP_OR)
                else f"{a[0]} {_INFIX[op]} {a[1]}"
            )
        )
        return f"({inner}) ? 1.0 : 0.0"
    if op in _INFIX:
        return f"{a[0]} {_INFIX[op]} {a[1]}"
    if op in _CALL:
        return f"{_CALL[op]}({', '.join(a)})"
    if op == ca.OP_NEG:
        return f"-{a[0]}"
    if op == ca.OP_SQ:
        return f"{a[0]} * {a[0]}"
    if op == ca.OP_TWICE:
        return f"2.0 * {a[0]}"
    if op == ca.OP_INV:
        return f"1.0 / {a[0]}"
    if op == ca.OP_FMIN:
        return f"({a[0]} < {a[1]}) ? {a[0]} : {a[1]}"
    if op == ca.OP_FMAX:
        return f"({a[0]} > {a[1]}) ? {a[0]} : {a[1]}"
    if op == ca.OP_SIGN:
        return f"({a[0]} > 0.0) ? 1.0 : (({a[0]} < 0.0) ? -1.0 : {a[0]})"
    if op == ca.OP_IF_ELSE_ZERO:
        return f"({a[0]} != 0.0) ? {a[1]} : 0.0"
    raise GustformError(
        "GF4004",
        f"a function in the equations (CasADi operation {op}) has no C form here",
        hint="sin, cos, exp, log, sqrt, ... and the operators of gustform.language",
    )


def _small_power(text: str) -> int:
    """The exponent if it is the literal of a whole number from 2 to 16, else 0."""
    try:
        value = float(text)
    except ValueError:
        return 0
    return int(value) if value == int(value) and 2 <= value <= 16 else 0


class Hoister:
    """Expressions of parameters alone, shared by all functions of a kernel; printed into `prepare`."""

    def __init__(self) -> None:
        self._names: dict[tuple[object, ...], str] = {}
        self._order: list[tuple[str, str, bool]] = []  # name, expression, is a plain leaf
        self._text: dict[str, str] = {}
        self._slot: dict[str, int] = {}

    def node(self, key: tuple[object, ...], expression: str) -> str:
        """The name of a parameter-only value inside `prepare`."""
        if key not in self._names:
            name = f"h{len(self._names)}"
            self._names[key] = name
            self._order.append((name, expression, False))
            self._text[name] = expression
        return self._names[key]

    def slot(self, name: str) -> int:
        """The place in c[] of a value that another function reads."""
        return self._slot.setdefault(name, len(self._slot))

    @property
    def n_constants(self) -> int:
        return len(self._slot)

    def body(self) -> list[str]:
        """Statements of `prepare`: only what is needed for the values in c[]."""
        needed: set[str] = set()
        position = {name: k for k, (name, _, _) in enumerate(self._order)}
        stack = list(self._slot)
        while stack:
            name = stack.pop()
            if name in needed:
                continue
            needed.add(name)
            text = self._text[name]
            for word in text.replace("(", " ").replace(")", " ").replace(",", " ").split():
                word = word.lstrip("-")
                if word in position:
                    stack.append(word)
        lines = [f"const double {name} = {text};" for name, text, _ in self._order if name in needed]
        lines += [f"c[{slot}] = {name};" for name, slot in self._slot.items()]
        return lines


class Printer:
    """Prints one C function: call `load` for each input, then `run` for its outputs."""

    def __init__(self, hoister: Hoister) -> None:
        self.hoister = hoister
        self.lines: list[str] = []
        self._names: dict[tuple[object, ...], str] = {}
        self._is_parameter: dict[str, bool] = {}
        self._hoisted_names: dict[str, str] = {}

    def _leaf(self, text: str, parameter: bool) -> str:
        self._is_parameter[text] = parameter
        return text

    def run(
        self,
        symbols: Sequence[Any],
        texts: Sequence[str],
        parameters: Sequence[bool],
        expressions: Sequence[Any],
        on_output: Callable[[int, str], None],
    ) -> None:
        """Print the statements that compute `expressions` of `symbols`.

        texts[i] is the C text of symbols[i]; parameters[i] tells whether it depends on parameters only. `on_output`
        is called with (index, C text) as each output is ready, in order.
        """
        if not expressions:
            return
        function = ca.Function("f", list(symbols), list(expressions), {"cse": False})
        work: dict[int, str] = {}
        for k in range(function.n_instructions()):
            op = function.instruction_id(k)
            inputs, outputs = function.instruction_input(k), function.instruction_output(k)
            if op == ca.OP_INPUT:
                work[outputs[0]] = self._leaf(texts[inputs[0]], parameters[inputs[0]])
            elif op == ca.OP_CONST:
                work[outputs[0]] = self._leaf(literal(function.instruction_constant(k)), True)
            elif op == ca.OP_OUTPUT:
                on_output(outputs[0], self.readable(work[inputs[0]]))
            elif op == ca.OP_ASSIGN:
                work[outputs[0]] = work[inputs[0]]
            else:
                # CasADi lists one-argument operations with one input, two-argument ones with two.
                work[outputs[0]] = self._operation(op, [work[i] for i in inputs])

    def _operation(self, op: int, arguments: list[str]) -> str:
        if op == ca.OP_DIV and self._is_parameter[arguments[1]] and not self._is_parameter[arguments[0]]:
            # A division by something constant is a multiplication by its hoisted reciprocal.
            arguments = [arguments[0], self._operation(ca.OP_INV, [arguments[1]])]
            op = ca.OP_MUL
        if op in (ca.OP_POW, ca.OP_CONSTPOW) and (power := _small_power(arguments[1])):
            # x^3 as products: a call of pow() costs more than a whole polynomial.
            result = arguments[0]
            for bit in bin(power)[3:]:
                result = self._operation(ca.OP_SQ, [result])
                if bit == "1":
                    result = self._operation(ca.OP_MUL, [result, arguments[0]])
            return result
        ordered = sorted(arguments) if op in _COMMUTATIVE else arguments
        key = (op, *ordered)
        if key in self._names:
            return self._names[key]
        if all(self._is_parameter[a] for a in arguments):
            if not any(a.startswith(("p[", "h")) for a in arguments):
                name = f"({_c_expression(op, arguments)})"  # numbers only: the C compiler folds it
            else:
                name = self.hoister.node(key, _c_expression(op, arguments))
            self._is_parameter[name] = True
        else:
            text = _c_expression(op, [self.readable(a) for a in arguments])
            name = f"v{len(self.lines)}"
            self.lines.append(f"const double {name} = {text};")
            self._is_parameter[name] = False
        self._names[key] = name
        return name

    def define(self, text: str) -> str:
        """Append a statement as it is."""
        self.lines.append(text)
        return text

    def readable(self, name: str) -> str:
        """The C text by which this function reads a value: hoisted ones come from c[]."""
        if name.startswith("h") and self._is_parameter.get(name, False):
            return f"c[{self.hoister.slot(name)}]"
        return name

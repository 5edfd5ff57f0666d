"""A CasADi SX function as straight-line C99 in a type `real`, from its instruction list.

Literals are written R(0.5), a macro that gives them the type. min, max and sign are expressions; sqrt and floor come
from the C library, where they are exact; sin and cos are this module's own, because those of C libraries differ.

sin, cos: x = k pi/2 + r by Cody and Waite in two parts (double) or three (float), k = floor(2 x/pi + 1/2); fdlibm's
polynomials of r. For |x| <= 1000 the error is at most 2^-52 (2.3e-16) in double and 2^-23 (1.2e-7) in float.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from gustform.language.errors import GustformError

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}


def literal(value: float) -> str:
    """A C constant of type `real`."""
    text = repr(float(value))
    if text in ("inf", "-inf", "nan"):
        raise GustformError(
            "GF4101", f"the number {text} cannot be part of an exported controller", hint="a finite one"
        )
    text = text if any(c in text for c in ".e") else text + ".0"
    return f"(-R({text[1:]}))" if text.startswith("-") else f"R({text})"


def statements(
    function: Any, read: Callable[[int, int], str], write: Callable[[int, str], str], named: str = "v"
) -> tuple[list[str], set[str]]:
    """The statements of a function with one output vector, and which of "sin", "cos", "sqrt", "floor" they call.

    `read(argument, element)` is the C text of an input; `write(element, text)` the statement that stores an output.
    Intermediate values have the names `named`0, `named`1 and so on.
    """
    lines: list[str] = []
    calls: set[str] = set()
    work: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op, a, out = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            work[out[0]] = read(a[0], a[1])
        elif op == ca.OP_CONST:
            work[out[0]] = literal(function.instruction_constant(k))
        elif op == ca.OP_OUTPUT:
            lines.append(write(out[1], work[a[0]]))
        elif op == ca.OP_ASSIGN:
            work[out[0]] = work[a[0]]
        else:
            name = f"{named}{k}"
            lines.append(f"const real {name} = {_expression(op, [work[i] for i in a], calls)};")
            work[out[0]] = name
    return lines, calls


def _expression(op: int, a: Sequence[str], calls: set[str]) -> str:
    if op in _INFIX:
        return f"{a[0]} {_INFIX[op]} {a[1]}"
    if op == ca.OP_NEG:
        return f"-{a[0]}"
    if op == ca.OP_SQ:
        return f"{a[0]} * {a[0]}"
    if op == ca.OP_TWICE:
        return f"R(2.0) * {a[0]}"
    if op == ca.OP_INV:
        return f"R(1.0) / {a[0]}"
    if op == ca.OP_FMIN:
        return f"({a[0]} < {a[1]}) ? {a[0]} : {a[1]}"
    if op == ca.OP_FMAX:
        return f"({a[0]} > {a[1]}) ? {a[0]} : {a[1]}"
    if op == ca.OP_FABS:
        return f"({a[0]} < R(0.0)) ? -{a[0]} : {a[0]}"
    if op == ca.OP_LE:
        return f"({a[0]} <= {a[1]}) ? R(1.0) : R(0.0)"
    for known, name in ((ca.OP_SQRT, "sqrt"), (ca.OP_FLOOR, "floor"), (ca.OP_SIN, "sin"), (ca.OP_COS, "cos")):
        if op == known:
            calls.add(name)
            return f"{name}_real({a[0]})"
    raise GustformError(
        "GF4101",
        f"a function of the equations (CasADi operation {op}) has no form in an exported controller",
        hint="+ - * /, sqrt, sin, cos, limit(), maximum(), minimum()",
    )


_ROOTS = """
static real {name}_real(real x)
{{
#if {upper}_DOUBLE
    return {name}(x);
#else
    return {name}f(x);
#endif
}}
"""

_TURN = """
/* x - k pi/2 in [-pi/4, pi/4], and k modulo 4; |x| <= 1000. */
static real quarter_turns(real x, real *quadrant)
{{
    const real k = floor_real(x * R(0.63661977236758134308) + R(0.5));
    *quadrant = k - R(4.0) * floor_real(k * R(0.25));
#if {upper}_DOUBLE
    return (x - k * R(1.57079632673412561417)) - k * R(6.07710050650619224932e-11);
#else
    return ((x - k * R(1.5703125)) - k * R(4.837512969970703125e-4)) - k * R(7.54978995489188216e-8);
#endif
}}

static real sin_near_zero(real r)
{{
    const real z = r * r;
#if {upper}_DOUBLE
    const real tail = R(8.33333333332248946124e-03)
                      + z * (R(-1.98412698298579493134e-04)
                             + z * (R(2.75573137070700676789e-06)
                                    + z * (R(-2.50507602534068634195e-08) + z * R(1.58969099521155010221e-10))));
#else
    const real tail = R(8.3333293858894631756e-3)
                      + z * (R(-1.9839334836096632425e-4) + z * R(2.7183114939898219064e-6));
#endif
    return r + z * r * (R(-1.66666666666666324348e-01) + z * tail);
}}

static real cos_near_zero(real r)
{{
    const real z = r * r;
#if {upper}_DOUBLE
    const real tail = R(4.16666666666666019037e-02)
                      + z * (R(-1.38888888888741095749e-03)
                             + z * (R(2.48015872894767294178e-05)
                                    + z * (R(-2.75573143513906633035e-07)
                                           + z * (R(2.08757232129817482790e-09)
                                                  + z * R(-1.13596475577881948265e-11)))));
#else
    const real tail = R(4.1666623323739063189e-2)
                      + z * (R(-1.3886763774609929421e-3) + z * R(2.4390448796277409065e-5));
#endif
    return (R(1.0) - R(0.5) * z) + z * z * tail;
}}
"""

_WAVE = """
static real {name}_real(real x)
{{
    real quadrant = R(0.0);
    const real r = quarter_turns(x, &quadrant);
    const real value = ({odd}) ? {first}_near_zero(r) : {second}_near_zero(r);
    return ({negative}) ? -value : value;
}}
"""


def helpers(calls: set[str], upper: str) -> str:
    """C of the functions that statements call."""
    needed = set(calls)
    waves = needed & {"sin", "cos"}
    if waves:
        needed.add("floor")
    text = "".join(_ROOTS.format(name=name, upper=upper) for name in ("sqrt", "floor") if name in needed)
    if waves:
        text += _TURN.format(upper=upper)
    odd = "(quadrant > R(0.5) && quadrant < R(1.5)) || quadrant > R(2.5)"
    if "sin" in waves:
        text += _WAVE.format(name="sin", odd=odd, first="cos", second="sin", negative="quadrant > R(1.5)")
    if "cos" in waves:
        negative = "quadrant > R(0.5) && quadrant < R(2.5)"
        text += _WAVE.format(name="cos", odd=odd, first="sin", second="cos", negative=negative)
    return text

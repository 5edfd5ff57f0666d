"""Zero-crossing functions: from conditions of when-clauses, and from the bends of limiters."""

from __future__ import annotations

from typing import Any

import casadi as ca

from gustform.language.errors import GustformError, Place
from gustform_codegen.unit_type import Root

_COMPARISONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE)
_DEEP = 100  # levels to which two limiters are compared
_JUMPS = (ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_FMOD)


def indicator(condition: Any, text: str) -> Any:
    """A continuous function that is positive where the condition holds: a > b becomes a - b, `and` the smaller."""
    if condition.is_op(ca.OP_LT) or condition.is_op(ca.OP_LE):
        return condition.dep(1) - condition.dep(0)
    if condition.is_op(ca.OP_AND):
        return ca.fmin(indicator(condition.dep(0), text), indicator(condition.dep(1), text))
    if condition.is_op(ca.OP_OR):
        return ca.fmax(indicator(condition.dep(0), text), indicator(condition.dep(1), text))
    if condition.is_op(ca.OP_NOT):
        return -indicator(condition.dep(0), text)
    raise GustformError(
        "GF1017",
        f"a when-condition must be made of < and >, logic_and, logic_or; got {condition} in {text}",
        hint="self.when(a > b, ...)",
    )


def _nodes(expression: Any) -> list[Any]:
    """Every node of an expression graph once, children first."""
    seen: set[int] = set()
    order: list[Any] = []
    stack = [(expression, False)]
    while stack:
        node, done = stack.pop()
        if done:
            order.append(node)
            continue
        key = node.element_hash()
        if key in seen or node.is_leaf():
            continue
        seen.add(key)
        stack.append((node, True))
        stack += [(node.dep(k), False) for k in range(node.n_dep())]
    return order


def refuse_bare_comparisons(expression: Any, text: str, place: Place | None) -> None:
    """GF1018 if an equation contains a comparison or a function with steps: it would jump without the solver
    knowing."""
    for node in _nodes(expression):
        comparison = any(node.is_op(op) for op in _COMPARISONS)
        if comparison or any(node.is_op(op) for op in _JUMPS):
            raise GustformError(
                "GF1018",
                f"a {'bare comparison' if comparison else 'function with steps'} ({node}) in {text}",
                hint="limit(), maximum() or minimum(), or a Discrete that a when-clause sets",
                place=place,
            )


def bend_roots(expressions: list[tuple[Any, str]]) -> list[Root]:
    """One root for each min, max or abs: the difference of its two branches. What is written twice counts once."""
    seen: set[int] = set()
    roots: list[Root] = []
    for expression, text in expressions:
        for node in _nodes(expression):
            if node.element_hash() in seen:
                continue
            seen.add(node.element_hash())
            if node.is_op(ca.OP_FMIN) or node.is_op(ca.OP_FMAX):
                root = Root(0, node.dep(0) - node.dep(1), f"limiter in {text}")
            elif node.is_op(ca.OP_FABS):
                root = Root(0, node.dep(0), f"absolute value in {text}")
            else:
                continue
            if not any(ca.is_equal(root.expression, other.expression, _DEEP) for other in roots):
                roots.append(root)
    return roots

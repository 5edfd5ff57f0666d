"""Alias elimination: equations of the form a = b or a = -b leave the system and enter the alias table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

# The rank of what is given from outside a unit: two of these are never merged.
GIVEN = 9


@dataclass
class AliasSets:
    """Union-find with signs over symbol hashes. `rank` decides which member stands for the set (highest)."""

    rank: Callable[[int], int]
    _parent: dict[int, tuple[int, int]] = field(default_factory=dict)

    def find(self, key: int) -> tuple[int, int]:
        """(representative, sign) with key = sign * representative."""
        sign = 1
        while key in self._parent:
            key, s = self._parent[key]
            sign *= s
        return key, sign

    def join(self, a: int, b: int, sign: int) -> bool:
        """Record a = sign * b. False if both stand for themselves and may not be merged, or are one already."""
        (a, sa), (b, sb) = self.find(a), self.find(b)
        if a == b or (self.rank(a) == GIVEN and self.rank(b) == GIVEN):
            return False
        if self.rank(a) > self.rank(b):
            a, b = b, a
        self._parent[a] = (b, sa * sb * sign)
        return True


def as_alias(expression: Any) -> tuple[Any, Any, int] | None:
    """(a, b, sign) if `expression` = 0 says a = sign * b for two symbols, else None."""
    while expression.is_op(ca.OP_NEG):
        expression = expression.dep(0)
    for op, sign in ((ca.OP_SUB, 1), (ca.OP_ADD, -1)):
        if expression.is_op(op):
            a, b = expression.dep(0), expression.dep(1)
            while a.is_op(ca.OP_NEG):
                a, sign = a.dep(0), -sign
            while b.is_op(ca.OP_NEG):
                b, sign = b.dep(0), -sign
            if a.is_symbolic() and b.is_symbolic():
                return a, b, sign
    return None

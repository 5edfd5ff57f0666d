"""Structural analysis: matching, strongly connected blocks, and who is to blame when there is no matching.

Works on plain incidence sets (equation number -> set of unknown numbers), so it knows nothing about CasADi and is
used for one unit type as well as for the linked system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Incidence = Sequence[frozenset[int]]


@dataclass(frozen=True)
class Matching:
    """unknown_of[e] is the unknown matched to equation e, equation_of[z] the reverse; -1 where there is none."""

    unknown_of: list[int]
    equation_of: list[int]

    @property
    def free_equations(self) -> list[int]:
        return [e for e, z in enumerate(self.unknown_of) if z < 0]

    @property
    def free_unknowns(self) -> list[int]:
        return [z for z, e in enumerate(self.equation_of) if e < 0]


def match(incidence: Incidence, n_unknowns: int, start: Matching | None = None) -> Matching:
    """A maximum matching by augmenting paths (iterative, so that deep systems do not exhaust the stack)."""
    unknown_of = list(start.unknown_of) if start else [-1] * len(incidence)
    equation_of = list(start.equation_of) if start else [-1] * n_unknowns
    equation_of += [-1] * (n_unknowns - len(equation_of))
    for root in range(len(incidence)):
        if unknown_of[root] >= 0:
            continue
        # A cheap look first: most equations find a free unknown at once.
        parent: dict[int, int] = {}
        stack = [root]
        end = -1
        while stack and end < 0:
            equation = stack.pop()
            for unknown in incidence[equation]:
                if unknown in parent:
                    continue
                parent[unknown] = equation
                if equation_of[unknown] < 0:
                    end = unknown
                    break
                stack.append(equation_of[unknown])
        while end >= 0:
            equation = parent[end]
            previous = unknown_of[equation]
            unknown_of[equation], equation_of[end] = end, equation
            end = previous if equation != root else -1
    return Matching(unknown_of, equation_of)


def blocks(incidence: Incidence, matching: Matching) -> list[list[int]]:
    """Strongly connected equations in the order they can be solved (Tarjan, iterative)."""
    order: dict[int, int] = {}
    low: dict[int, int] = {}
    on_stack: set[int] = set()
    stack: list[int] = []
    result: list[list[int]] = []

    def targets(equation: int) -> list[int]:
        own = matching.unknown_of[equation]
        return [
            matching.equation_of[z] for z in sorted(incidence[equation]) if z != own and matching.equation_of[z] >= 0
        ]

    for root in range(len(incidence)):
        if root in order or matching.unknown_of[root] < 0:
            continue
        work = [(root, iter(targets(root)))]
        order[root] = low[root] = len(order)
        stack.append(root)
        on_stack.add(root)
        while work:
            node, children = work[-1]
            for child in children:
                if child not in order:
                    order[child] = low[child] = len(order)
                    stack.append(child)
                    on_stack.add(child)
                    work.append((child, iter(targets(child))))
                    break
                if child in on_stack:
                    low[node] = min(low[node], order[child])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == order[node]:
                    block = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        block.append(member)
                        if member == node:
                            break
                    result.append(sorted(block))
    return result


def overdetermined_part(incidence: Incidence, matching: Matching) -> tuple[list[int], list[int]]:
    """Equations and unknowns reachable from the unmatched equations: too many equations for these unknowns."""
    equations, unknowns = set(matching.free_equations), set[int]()
    stack = list(equations)
    while stack:
        for unknown in incidence[stack.pop()]:
            if unknown not in unknowns:
                unknowns.add(unknown)
                equation = matching.equation_of[unknown]
                if equation >= 0 and equation not in equations:
                    equations.add(equation)
                    stack.append(equation)
    return sorted(equations), sorted(unknowns)


def underdetermined_part(incidence: Incidence, matching: Matching) -> tuple[list[int], list[int]]:
    """Equations and unknowns reachable from the unmatched unknowns: too few equations for these unknowns."""
    users: dict[int, list[int]] = {}
    for equation, row in enumerate(incidence):
        for unknown in row:
            users.setdefault(unknown, []).append(equation)
    unknowns, equations = set(matching.free_unknowns), set[int]()
    stack = list(unknowns)
    while stack:
        for equation in users.get(stack.pop(), []):
            if equation not in equations:
                equations.add(equation)
                unknown = matching.unknown_of[equation]
                if unknown >= 0 and unknown not in unknowns:
                    unknowns.add(unknown)
                    stack.append(unknown)
    return sorted(equations), sorted(unknowns)


def tear(
    incidence: Incidence, unknowns: frozenset[int], solvable: Sequence[frozenset[int]]
) -> tuple[list[tuple[int, int]], list[int], list[int]]:
    """Tear one block: (explicit assignments as (equation, unknown) in order, tearing unknowns, residual equations).

    `solvable[e]` are the unknowns equation e can be solved for explicitly. Greedy: solve whatever has one unknown
    left; when nothing has, tear the unknown that occurs in most of the remaining equations (Cellier's heuristic).
    """
    known: set[int] = set()
    open_equations = set(range(len(incidence)))
    sequence: list[tuple[int, int]] = []
    tears: list[int] = []
    while True:
        progress = True
        while progress:
            progress = False
            for equation in sorted(open_equations):
                left = (incidence[equation] & unknowns) - known
                if len(left) == 1:
                    (unknown,) = left
                    if unknown in solvable[equation]:
                        sequence.append((equation, unknown))
                        known.add(unknown)
                        open_equations.discard(equation)
                        progress = True
        remaining = unknowns - known
        if not remaining:
            return sequence, tears, sorted(open_equations)
        count = {z: sum(z in incidence[e] for e in open_equations) for z in remaining}
        chosen = max(sorted(remaining), key=lambda z: count[z])
        tears.append(chosen)
        known.add(chosen)

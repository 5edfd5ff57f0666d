"""Matching, blocks, suspects and tearing on small random graphs, against brute force."""

from __future__ import annotations

from itertools import permutations

from hypothesis import given
from hypothesis import strategies as st

from gustform_codegen.structure import (
    Matching,
    blocks,
    match,
    overdetermined_part,
    tear,
    underdetermined_part,
)

Rows = list[frozenset[int]]


def graphs(max_equations: int = 6, max_unknowns: int = 6) -> st.SearchStrategy[tuple[Rows, int]]:
    return st.integers(0, max_unknowns).flatmap(
        lambda n: st.tuples(
            st.lists(st.frozensets(st.integers(0, n - 1)) if n else st.just(frozenset()), max_size=max_equations),
            st.just(n),
        )
    )


def largest(rows: Rows, used: frozenset[int] = frozenset()) -> int:
    """Size of a maximum matching, by trying everything."""
    if not rows:
        return 0
    best = largest(rows[1:], used)
    for z in rows[0] - used:
        best = max(best, 1 + largest(rows[1:], used | {z}))
    return best


def check_matching(rows: Rows, matching: Matching) -> None:
    for e, z in enumerate(matching.unknown_of):
        assert z < 0 or (z in rows[e] and matching.equation_of[z] == e)
    for z, e in enumerate(matching.equation_of):
        assert e < 0 or matching.unknown_of[e] == z


@given(graphs())
def test_the_matching_is_valid_and_as_large_as_possible(graph: tuple[Rows, int]) -> None:
    rows, n = graph
    matching = match(rows, n)
    check_matching(rows, matching)
    assert len(rows) - len(matching.free_equations) == largest(rows)


@given(graphs(), graphs())
def test_a_matching_can_be_carried_on_from(first: tuple[Rows, int], more: tuple[Rows, int]) -> None:
    rows, n = first
    start = match(rows, n)
    wider = [row | {n + z for z in extra} for row, extra in zip(rows, more[0], strict=False)] + rows[len(more[0]) :]
    matching = match(wider, n + more[1], start)
    check_matching(wider, matching)
    assert len(rows) - len(matching.free_equations) == largest(wider)
    # Whoever had an equation keeps one: augmenting never takes a match away.
    assert all(matching.equation_of[z] >= 0 for z in range(n) if start.equation_of[z] >= 0)
    assert start.unknown_of == match(rows, n).unknown_of  # the start itself is not changed


def reaches(rows: Rows, matching: Matching, start: int, goal: int) -> bool:
    """Whether equation `start` needs, directly or through others, the unknown of equation `goal`."""
    seen: set[int] = set()
    stack = [start]
    while stack:
        e = stack.pop()
        if e == goal:
            return True
        if e not in seen:
            seen.add(e)
            stack += [matching.equation_of[z] for z in rows[e] if matching.equation_of[z] >= 0]
    return False


@given(graphs())
def test_blocks_are_strongly_connected_and_in_solving_order(graph: tuple[Rows, int]) -> None:
    rows, n = graph
    matching = match(rows, n)
    found = blocks(rows, matching)
    matched = [e for e in range(len(rows)) if matching.unknown_of[e] >= 0]
    assert sorted(e for block in found for e in block) == matched
    known: set[int] = set()
    for block in found:
        known |= {matching.unknown_of[e] for e in block}
        for e in block:  # block lower triangular: nothing is needed that comes later
            assert {z for z in rows[e] if matching.equation_of[z] >= 0} <= known
        for a in block:
            assert all(reaches(rows, matching, a, b) for b in block)
    for one in found:
        for other in found:
            if one is not other:  # otherwise they would be one block
                assert not (reaches(rows, matching, one[0], other[0]) and reaches(rows, matching, other[0], one[0]))


def test_long_chains_do_not_exhaust_the_stack() -> None:
    n = 20000
    rows = [frozenset({0})] + [frozenset({k - 1, k}) for k in range(1, n)]
    matching = match(rows[::-1], n)
    assert matching.free_equations == []
    assert len(blocks(rows[::-1], matching)) == n
    ring = [frozenset({k, (k + 1) % n}) for k in range(n)]
    assert len(blocks(ring, match(ring, n))) == 1


@given(graphs())
def test_suspects_are_the_dulmage_mendelsohn_parts(graph: tuple[Rows, int]) -> None:
    """An equation is among the over-determined ones if and only if leaving it out leaves the matching as large;
    an unknown among the under-determined ones if and only if it can be left out likewise."""
    rows, n = graph
    matching = match(rows, n)
    size = largest(rows)
    equations, _ = overdetermined_part(rows, matching)
    assert equations == [e for e in range(len(rows)) if largest(rows[:e] + rows[e + 1 :]) == size]
    _, unknowns = underdetermined_part(rows, matching)
    assert unknowns == [z for z in range(n) if largest([row - {z} for row in rows]) == size]


@given(graphs(5, 5), st.randoms(use_true_random=False))
def test_tearing_solves_every_unknown_once_and_in_order(graph: tuple[Rows, int], random: object) -> None:
    rows, n = graph
    matching = match(rows, n)
    for block in blocks(rows, matching):
        wanted = frozenset(matching.unknown_of[e] for e in block)
        local = [rows[e] & wanted for e in block]
        solvable = [frozenset(z for z in row if (z + k) % 3) for k, row in enumerate(local)]  # some, not all
        sequence, tears, residuals = tear(local, wanted, solvable)
        known = set(tears)
        for e, z in sequence:
            assert z in solvable[e]
            assert local[e] - known == {z}
            known.add(z)
        assert known == wanted
        assert len(tears) + len(sequence) == len(wanted)
        assert sorted([e for e, _ in sequence] + residuals) == list(range(len(block)))


def test_a_chain_is_torn_at_its_hub() -> None:
    # Four equations that all contain unknown 0 and one more each: one tear is enough.
    rows = [frozenset({0, 1}), frozenset({0, 2}), frozenset({0, 3}), frozenset({0, 1, 2, 3})]
    sequence, tears, residuals = tear(rows, frozenset(range(4)), rows)
    assert tears == [0]
    assert len(residuals) == 1
    assert len(sequence) == 3


def test_brute_force_is_right_itself() -> None:
    rows: Rows = [frozenset({0, 1}), frozenset({0}), frozenset({1, 2})]
    best = max(sum(z in rows[e] for e, z in enumerate(order)) for order in permutations(range(3)))
    assert largest(rows) == best == 3

"""Who is to blame when a unit type is not balanced or structurally singular."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NoReturn

from gustform.language.errors import GustformError
from gustform_codegen.structure import Matching, match, overdetermined_part, underdetermined_part


def check_balance(name: str, texts: list[str], labels: list[str], incidence: list[frozenset[int]]) -> None:
    """GF3010 or GF3011 when a type has more or fewer equations than unknowns, naming the suspects."""
    n_own = len(labels)
    if len(texts) == n_own:
        return
    matching = match(incidence, n_own)
    if len(texts) > n_own:
        equations, unknowns = overdetermined_part(incidence, matching)
        what, code = "over-determined", "GF3010"
        hint = "leaving out one of the equations named"
    else:
        equations, unknowns = underdetermined_part(incidence, matching)
        what, code = "under-determined", "GF3011"
        hint = "one more equation for one of the variables named"
    raise GustformError(
        code,
        f"{name} is {what}: {len(texts)} equations for {n_own} unknowns. "
        f"Suspects: variables {_list(labels[z] for z in unknowns)}; "
        f"equations {_list(texts[e] for e in equations)}",
        hint=hint,
    )


def refuse_singular(
    name: str,
    texts: list[str],
    labels: list[str],
    incidence: list[frozenset[int]],
    matching: Matching,
    states: list[list[str]],
) -> NoReturn:
    """GF3012 or GF3013: as many equations as unknowns, but no matching between them.

    `states` are the states in each equation: where the surplus equations contain states whose derivatives have no
    equation left, they are a constraint between these states.
    """
    equations, _ = overdetermined_part(incidence, matching)
    _, unknowns = underdetermined_part(incidence, matching)
    lacking = {labels[z] for z in unknowns}
    constrained = sorted({s for e in equations for s in states[e] if f"der({s})" in lacking})
    if constrained:
        refuse_constraint(name, [texts[e] for e in equations], constrained)
    raise GustformError(
        "GF3012",
        f"{name} is structurally singular: no equation is left for {_list(labels[z] for z in unknowns)}; "
        f"too many for the same variables: {_list(texts[e] for e in equations)}",
        hint="an equation that contains one of the variables named",
    )


def refuse_constraint(name: str, texts: list[str], states: list[str]) -> NoReturn:
    """GF3013: equations that only tie states to each other, so that no derivative can be chosen freely."""
    raise GustformError(
        "GF3013",
        f"{name}: {_list(texts)} constrain the states {_list(states)} (index above 1)",
        hint="joining the two states by a resistance or a spring, or one state instead of two",
    )


def _list(names: Iterable[str], most: int = 6) -> str:
    items = list(names)
    text = "; ".join(items[:most]) or "none"
    return text + (f"; and {len(items) - most} more" if len(items) > most else "")

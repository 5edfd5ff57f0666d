"""All component types that a scenario can say something about, for the schema and for `gustform info`."""

from __future__ import annotations

from functools import lru_cache

from gustform.language.component import Component
from gustform.language.declare import Part
from gustform.registry import ALIASES, PARTS, UNITS, fitting_parts


@lru_cache(maxsize=1)
def part_types() -> dict[str, type[Component]]:
    """Types that stand inside units: those a scenario may choose, and the fixed ones whose parameters it may set."""
    found: dict[str, type[Component]] = {name: entry.kind for name, entry in PARTS.items()}
    waiting = [unit.kind for unit in UNITS.values()] + list(found.values())
    while waiting:
        for part in waiting.pop().declared(Part).values():
            for kind in part.among:
                if kind.__name__ not in found:
                    found[kind.__name__] = kind
                    waiting.append(kind)
    return dict(sorted(found.items()))


def all_types() -> dict[str, type[Component]]:
    """Units and parts by name."""
    return dict(sorted({**part_types(), **{name: unit.kind for name, unit in UNITS.items()}}.items()))


def choices(part: Part) -> list[str]:
    """The types that may stand in the place of a part, its own first; short names left out."""
    if part.base is None:
        return [kind.__name__ for kind in part.among]
    own = {kind.__name__ for kind in part.among}
    names = own | {name for name in fitting_parts(part) if name not in ALIASES}
    return sorted(names, key=lambda name: (name != part.kind.__name__, name))


def short_names(part: Part) -> list[str]:
    """Short names for what may stand in the place of a part."""
    return [name for name in fitting_parts(part) if name in ALIASES] if part.base is not None else []

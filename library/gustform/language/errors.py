"""Errors as part of the product: a code, a place, the offending value and one thing to try.

Code ranges: GF1xxx declarations and equations of a component, GF2xxx scenario and input data, GF3xxx structure
(balance, matching, connections), GF4xxx code generation and compiler, GF5xxx initialisation, GF6xxx the run,
GF7xxx results and files, GF8xxx bus, bridge and bench.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """Where an error sits: a file with line and column counted from 1 (0 = unknown)."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        text = self.file
        if self.line:
            text += f":{self.line}"
            if self.column:
                text += f":{self.column}"
        return text


class GustformError(Exception):
    """An error a user can act on.

    `code` is stable (GFnnnn), `message` states what is wrong and the value that was got, `hint` is one thing to try
    and `place` the file position, where there is one.
    """

    def __init__(self, code: str, message: str, *, hint: str = "", place: Place | None = None) -> None:
        self.code = code
        self.message = message
        self.hint = hint
        self.place = place
        super().__init__(str(self))

    def __str__(self) -> str:
        text = f"error {self.code}: {self.message}"
        if self.place is not None:
            text = f"{self.place}: {text}"
        if self.hint:
            text += f" — try {self.hint}"
        return text


class ErrorList(Exception):
    """Several errors found in one go; never empty."""

    def __init__(self, errors: Sequence[GustformError]) -> None:
        self.errors = tuple(errors)
        super().__init__("\n".join(str(error) for error in self.errors))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint for `name`, which is none of `known`: the closest of them, or the list of them."""
    names = sorted(set(known))
    # Case first: "pmsgturbine" for "PmsgTurbine" is the commonest slip and difflib rates it low.
    close = [other for other in names if other.lower() == name.lower()]
    close = close or difflib.get_close_matches(name, names, n=2, cutoff=0.6)
    if close:
        return " or ".join(close)
    if not names:
        return ""
    if len(names) == 1:
        return names[0]
    shown = names[:12]
    return "one of " + ", ".join(shown) + (", ..." if len(names) > len(shown) else "")

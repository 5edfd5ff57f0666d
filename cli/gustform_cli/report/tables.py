"""Tables of a page: sortable by their heads where the script runs, complete where it does not."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from gustform_cli.report.markup import Content, Html, breakable, tag

_TALL = 40  # rows; a longer table scrolls in a box


@dataclass(frozen=True)
class Cell:
    """What stands in a cell, and the number it is sorted by if it is one."""

    content: Content
    number: float | None = None


def table(
    heads: Sequence[Content], rows: Iterable[Sequence[Cell | str]], *, sortable: bool = False, fit: bool = False
) -> Html:
    """A table that scrolls sideways where the screen is narrower than it is. Numbers stand at the right.

    `fit`: no wider than what is in it.
    """
    written = [[cell if isinstance(cell, Cell) else Cell(cell) for cell in row] for row in rows]
    right = [
        any(row[k].number is not None for row in written) and len(written[0]) == len(heads) for k in range(len(heads))
    ]
    head = tag(
        "tr", [tag("th", text, class_="n" if r else None, scope="col") for text, r in zip(heads, right, strict=True)]
    )
    body = [tag("tr", [_cell(cell, r) for cell, r in zip(row, right, strict=True)]) for row in written]
    whole = tag("table", tag("thead", head), tag("tbody", body), class_="sortable" if sortable else None)
    kind = "scroll fit" if fit else "scroll tall" if len(written) > _TALL else "scroll"
    # A box that scrolls must be reached by the keyboard.
    return tag("div", whole, class_=kind, tabindex="0" if kind == "scroll tall" else None)


def facts(pairs: Iterable[tuple[Content, Content]]) -> Html:
    """Names and what they are, one pair a line."""
    return tag("dl", [[tag("dt", name), tag("dd", value)] for name, value in pairs], class_="facts")


@dataclass(frozen=True)
class Figure:
    """A number a reader looks for."""

    name: str
    value: str
    unit: str = ""
    note: str = ""


def key_figures(figures: Sequence[Figure]) -> Html:
    """The numbers, large."""
    return tag(
        "div",
        [
            tag(
                "div",
                tag("span", breakable(figure.name), class_="name"),
                tag("span", figure.value, tag("small", figure.unit) if figure.unit else None, class_="value"),
                tag("span", figure.note, class_="hint") if figure.note else None,
                class_="figure",
            )
            for figure in figures
        ],
        class_="figures",
    )


def _cell(cell: Cell, right: bool) -> Html:
    number = cell.number
    value = f"{number:.9g}" if number is not None and math.isfinite(number) else None
    return tag("td", cell.content, class_="n" if right else None, data_value=value)

"""Component types and their parameters as tables, from the declarations."""

from __future__ import annotations

import inspect
import io
from collections.abc import Iterable

from rich.console import Console
from rich.markup import escape
from rich.table import Table as Grid

from gustform.language.component import Component
from gustform.language.connector import Connector
from gustform.language.declare import Declaration, Input, Output, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError
from gustform.registry import PARTS, UNITS, Unit
from gustform_cli.catalogue import all_types, choices, part_types, short_names
from gustform_cli.errors import did_you_mean

_WIDTH = 120


def overview() -> str:
    """All component types: those of a system, and those that are parts of others."""
    units = [(name, _placed(unit), sentence(unit.kind)) for name, unit in UNITS.items()]
    parts = [(name, sentence(kind)) for name, kind in part_types().items() if name not in UNITS]
    return _render(
        _grid("components", ("type", "connected by", "what it is"), units),
        _grid("parts of components", ("type", "what it is"), parts),
        tail="gustform info NAME shows the parameters of one.",
    )


def describe(name: str) -> str:
    """One type: what it is, its terminals, parameters, parts and variables. GF2012 for an unknown name."""
    types = all_types()
    if name not in types:
        raise GustformError(
            "GF2012", f"{name!r} must be a component type; there is none of this name", hint=did_you_mean(name, types)
        )
    kind = types[name]
    grids = [
        _grid("terminals", ("name", "kind", "what it is"), _ports(kind)),
        _grid("inputs", ("name", "unit", "what it is"), _plain(kind.declared(Input).items())),
        _grid("parameters", ("name", "unit", "default", "range", "what it is"), _parameters(kind)),
        _grid("parts", ("name", "type", "or", "what it is"), _parts(kind)),
        _grid(
            "variables",
            ("name", "unit", "what it is"),
            _plain((key, value) for key, value in kind.declared(Variable).items() if not isinstance(value, Input)),
        ),
    ]
    head = f"{name}\n{'=' * len(name)}\n{inspect.getdoc(kind) or ''}"
    return _render(*(grid for grid in grids if grid.row_count), head=head)


def sentence(kind: type[Component]) -> str:
    """The first sentence of a type's documentation."""
    return (inspect.getdoc(kind) or "").strip().split("\n")[0].split(". ")[0].rstrip(".:")


def _placed(unit: Unit) -> str:
    return "at" if unit.at else "from, to" if unit.ends else ""


def _ports(kind: type[Component]) -> list[tuple[str, ...]]:
    return [(name, type(port).__name__, port.description) for name, port in kind.declared(Connector).items()]


def _plain(declarations: Iterable[tuple[str, Declaration]]) -> list[tuple[str, ...]]:
    return [
        (name, value.unit, value.description + (" (signal for others)" if isinstance(value, Output) else ""))
        for name, value in declarations
    ]


def _parameters(kind: type[Component]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (name, value.unit, default_text(value), range_text(value), value.description)
        for name, value in kind.declared(Parameter).items()
    ]
    readers = PARTS[kind.__name__].tables if kind.__name__ in PARTS else {}
    return rows + [
        (
            name,
            value.unit,
            "" if name in readers else "computed",
            "",
            f"{value.description} (table{' file' if name in readers else ''})",
        )
        for name, value in kind.declared(Table).items()
    ]


def _parts(kind: type[Component]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, part in kind.declared(Part).items():
        others = [*choices(part)[1:], *short_names(part)]
        rows.append((name, part.kind.__name__, ", ".join(others), part.description))
    return rows


def default_text(parameter: Parameter) -> str:
    """The default as shown to users."""
    if parameter.free:
        return "found at the start"
    if parameter.default is None:
        return "to be given"
    if callable(parameter.default):
        return "computed"
    if isinstance(parameter.default, float):
        return f"{parameter.default:g}"
    return str(parameter.default)


def range_text(parameter: Parameter) -> str:
    """The range as shown to users: > 0, 0 ... 1, >= 1."""
    low, high = parameter.min, parameter.max
    if parameter.above is not None:
        return f"> {parameter.above:g}" + (f", <= {high:g}" if high is not None else "")
    if low is not None and high is not None:
        return f"{low:g} ... {high:g}"
    if low is not None:
        return f">= {low:g}"
    return f"<= {high:g}" if high is not None else ""


def _grid(title: str, columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Grid:
    grid = Grid(title=title, title_justify="left", title_style="bold", box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in columns:
        grid.add_column(column, header_style="dim", overflow="fold", no_wrap=column in ("name", "type", "unit"))
    for row in rows:
        grid.add_row(*(escape(cell) for cell in row))
    return grid


def _render(*grids: Grid, head: str = "", tail: str = "") -> str:
    stream = io.StringIO()
    console = Console(file=stream, width=_WIDTH, highlight=False)
    if head:
        console.print(escape(head), "")
    for grid in grids:
        console.print(grid, "")
    if tail:
        console.print(escape(tail))
    return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().splitlines())

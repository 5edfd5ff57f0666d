"""Components of a scenario: an entry of the YAML file, checked against the type's declaration, becomes a Component.

Types come from the library's registry by name, never from an import path in a file. Every value is converted to the
declared unit and checked against the declared range here, where its line in the file is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gustform.language.component import Component
from gustform.language.declare import Parameter, Part, Table
from gustform.language.errors import GustformError
from gustform.language.table import TableData
from gustform.registry import UNITS, Replacement, find_part, fitting_parts
from gustform_cli.document import Document, NodePath, dotted
from gustform_cli.errors import did_you_mean
from gustform_cli.quantity import parse_quantity

# Keys of an entry that say how a component stands in the system, not what it is.
PLACING_KEYS = ("type", "at", "from", "to", "count")

TableReader = Callable[[Path], TableData]


@dataclass
class Reader:
    """Turns entries of one document into components and collects what is wrong with them."""

    document: Document
    turbines: int | None
    errors: list[GustformError]

    def component(self, name: str, entry: Mapping[str, Any], implied: Mapping[str, float | str]) -> Component | None:
        """The component `name`, None if there are errors in it (they are in `errors`).

        `implied` are parameters that follow from the rest of the scenario where the entry does not give them.
        """
        path: NodePath = ("components", name)
        unit = UNITS.get(entry["type"])
        if unit is None:
            self._fail(
                "GF2012",
                (*path, "type"),
                f"{dotted((*path, 'type'))} must be a component type; there is none called {entry['type']!r}",
                did_you_mean(entry["type"], UNITS),
            )
            return None
        kind = unit.kind
        before = len(self.errors)
        given = {key: value for key, value in entry.items() if key not in PLACING_KEYS}
        aggregate = given.pop("aggregate", None)
        if aggregate == "turbines" or (type(aggregate) is int and aggregate >= 1):
            given["aggregate"] = self.many(aggregate, (*path, "aggregate"))
        # Anything else has been refused by the check of the format.
        modifiers = self._modifiers((kind,), given, path, bound=frozenset(implied), tables={})
        modifiers.update({key: value for key, value in implied.items() if key not in modifiers})
        if len(self.errors) > before:
            return None
        component = self._guarded(lambda: kind(**modifiers), path)
        if component is not None:
            # Defaults that are computed from other parameters are checked as well.
            self._guarded(component.parameter_values, path)
        return component if len(self.errors) == before else None

    def many(self, value: int | str, path: NodePath) -> int:
        """A number of things; the word "turbines" stands for the scenario's own."""
        if isinstance(value, int):
            return value
        if self.turbines is None:
            self._fail(
                "GF2202",
                path,
                f"turbines must be given, because {dotted(path)} refers to it; it is missing",
                "turbines: 10",
            )
            return 1
        return self.turbines

    def parameter(self, component: Component, name: str, value: object, label: str, path: NodePath) -> float | None:
        """A new value for the parameter "part.part.name" of a component, None if it cannot be."""
        *parts, last = name.split(".")
        owner: Component = component
        for part in parts:
            known = owner.declared(Part)
            if part not in known:
                self._fail(
                    "GF2405",
                    path,
                    f"{label} must lead to a parameter; {type(owner).__name__} has no part {part!r}",
                    did_you_mean(part, known),
                    key=True,
                )
                return None
            owner = owner.part(part)
        known_parameters = owner.declared(Parameter)
        declaration = known_parameters.get(last)
        if declaration is None:
            self._fail(
                "GF2405",
                path,
                f"{label} must lead to a parameter; {type(owner).__name__} has no parameter {last!r}",
                did_you_mean(last, known_parameters),
                key=True,
            )
            return None
        if declaration.structural:
            self._fail(
                "GF2405",
                path,
                f"{label} must be a parameter that may change; {last} shapes the equations ({declaration.description})",
                "setting it in components",
                key=True,
            )
            return None
        number = self._guarded(partial(_number, declaration, value, label), path)
        return None if number is None else float(number)

    # ---- inside -----------------------------------------------------------------------------------------------------
    def _fail(self, code: str, path: NodePath, message: str, hint: str = "", *, key: bool = False) -> None:
        self.errors.append(GustformError(code, message, hint=hint, place=self.document.place(path, key=key)))

    def _guarded(self, make: Callable[[], Any], path: NodePath) -> Any:
        """`make()`, or None with the error recorded at `path`."""
        try:
            return make()
        except GustformError as error:
            place = error.place or self.document.place(path)
            self.errors.append(GustformError(error.code, error.message, hint=error.hint, place=place))
            return None

    def _modifiers(
        self,
        kinds: Sequence[type[Component]],
        given: Mapping[str, Any],
        path: NodePath,
        *,
        bound: frozenset[str],
        tables: Mapping[str, TableReader],
    ) -> dict[str, Any]:
        """Constructor arguments of a type, or of one of several, from the keys of its entry. `bound` are set elsewhere
        already."""
        modifiers: dict[str, Any] = {}
        declarations = {name: value for kind in reversed(kinds) for name, value in kind.declarations().items()}
        for key, value in given.items():
            declaration = declarations.get(key)
            where = (*path, key)
            label = dotted(where[1:])
            if isinstance(declaration, Parameter):
                modifiers[key] = self._guarded(partial(_number, declaration, value, label), where)
            elif isinstance(declaration, Part):
                modifiers[key] = self._part(declaration, value, where)
            elif isinstance(declaration, Table) and key in tables:
                modifiers[key] = self._guarded(partial(self._table, declaration, value, label, tables[key]), where)
            else:
                keys = PLACING_KEYS if len(path) == 2 else ("type",)
                self._fail(
                    "GF2402",
                    where,
                    f"{label} must not be here: {kinds[0].__name__} has no parameter {key!r}",
                    did_you_mean(key, [*(name for kind in kinds for name in kind.parameter_names()), *keys]),
                    key=True,
                )
        for name, needed in declarations.items():
            if (
                name in given
                or name in bound
                or not isinstance(needed, Parameter | Table)
                or not _must_be_given(needed)
            ):
                continue
            what = needed.unit if isinstance(needed, Parameter) else "a table file"
            self._fail(
                "GF2004",
                path,
                f"{dotted((*path[1:], name))} must be given ({needed.description}, {what}); it is missing",
                f"{name}: ..." if isinstance(needed, Table) else f"{name}: a number in {needed.unit}",
            )
        return modifiers

    def _part(self, part: Part, value: Any, path: NodePath) -> Any:
        """A sub-component: {type: ..., parameters}, or its type alone."""
        label = dotted(path[1:])
        entry = {"type": value} if isinstance(value, str) else value
        if not isinstance(entry, Mapping) or not isinstance(entry.get("type", ""), str):
            self._fail(
                "GF2203",
                path,
                f"{label} must be a mapping with the parameters of this part; got {value!r}",
                "{type: " + part.kind.__name__ + "}",
            )
            return None
        found = self._replacement(part, entry.get("type"), (*path, "type") if isinstance(value, Mapping) else path)
        if found is None:
            return None
        keys = {key: item for key, item in entry.items() if key != "type"}
        before = len(self.errors)
        open_kind = part.select is not None and not entry.get("type")  # the owner chooses; it knows which keys fit
        kinds = part.among if open_kind else (found.kind,)
        modifiers = self._modifiers(kinds, keys, path, bound=frozenset(part.modifiers), tables=found.tables)
        if len(self.errors) > before:
            return None
        if open_kind or (found.kind is part.kind and part.select is None):
            return modifiers
        return self._guarded(lambda: found.kind(**modifiers), path)

    def _replacement(self, part: Part, name: str | None, path: NodePath) -> Replacement | None:
        """What stands in the place of a part: what the entry names, or what the part is by itself."""
        if name is None or (part.base is None and name == part.kind.__name__):
            return Replacement(part.kind)
        try:
            return find_part(name, part)
        except GustformError as error:
            base = part.base or part.kind
            fitting = fitting_parts(part) if part.base else [part.kind.__name__]
            self._fail(
                error.code,
                path,
                f"{dotted(path[1:])} must be a {base.__name__} ({part.description}); got {name!r}",
                did_you_mean(name, fitting),
            )
            return None

    def _table(self, table: Table, value: object, label: str, read: TableReader) -> TableData:
        """The data of a table file; the path is relative to the scenario."""
        if not isinstance(value, str):
            raise GustformError(
                "GF2203", f"{label} must be the path of a file ({table.description}); got {value!r}", hint="a path"
            )
        return read(Path(self.document.file).parent / value)


def _number(declaration: Parameter, value: object, label: str) -> Any:
    """A parameter's value from the file, in its unit and range; structural ones may be words and switches."""
    default = declaration.default
    if declaration.structural and isinstance(default, bool | str | int) and isinstance(value, type(default)):
        return declaration.check(value, label)
    return declaration.check(parse_quantity(value, declaration.unit, label, declaration.description), label)


def _must_be_given(declaration: Parameter | Table) -> bool:
    return isinstance(declaration, Table) or (declaration.default is None and not declaration.free)


def entries(components: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The entries that can be looked at: mappings with a type that is text."""
    for name, entry in components.items():
        if isinstance(entry, Mapping) and isinstance(entry.get("type"), str):
            yield name, entry

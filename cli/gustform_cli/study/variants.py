"""A scenario linked once, and its linear systems with other numbers for parameters of one component."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from gustform.language.component import Component
from gustform_cli.model import link, load
from gustform_codegen.initial import steady_state
from gustform_codegen.linear import Lineariser, LinearSystem
from gustform_codegen.link import Linked
from gustform_codegen.sampled import continuous
from gustform_codegen.table import SystemTable, TypeTable

Values = Mapping[str, float]  # by path in the component: "control.T_dc"


class Variants:
    """Linear systems of one scenario; what is computed from a changed parameter follows it, nothing is compiled."""

    def __init__(self, scenario: Path, overrides: Sequence[str] = ()) -> None:
        assembled = load(scenario, overrides)
        assembled.system = continuous(assembled.system)
        self.linked = link(assembled).built.linked
        self.table = steady_state(self.linked).table
        self._lineariser = Lineariser(self.linked, [], find_flats=False)

    def component(self, name: str, values: Values | None = None) -> Component:
        """The component of that name, with other parameters."""
        component = self.linked.system.components[name]
        for path, value in (values or {}).items():
            component = component.with_value(path, value)
        return component

    def linear(self, name: str, values: Values, *, moves: bool = False) -> LinearSystem:
        """The linear system with other parameters of component `name`. `moves`: the steady state is found anew."""
        if not moves:
            return self._lineariser.at(self._changed(self.table, name, values))
        linked = self._relinked(self._changed(self.linked.table, name, values))
        return self._lineariser.at(steady_state(linked).table)

    def _changed(self, table: SystemTable, name: str, values: Values) -> SystemTable:
        number, k = self.linked.index_of[name]
        before = self.component(name).parameter_values()
        after = self.component(name, values).parameter_values()
        parameters = table.types[number].parameters.copy()
        for j, p in enumerate(self.linked.types[number].unit.parameters):
            if after[p.path] != before[p.path] and not getattr(p.declaration, "free", False):
                parameters[k, j] = after[p.path]
        types: list[TypeTable] = list(table.types)
        types[number] = replace(types[number], parameters=parameters)
        return replace(table, types=types)

    def _relinked(self, table: SystemTable) -> Linked:
        types = [replace(t, table=arrays) for t, arrays in zip(self.linked.types, table.types, strict=True)]
        return replace(self.linked, types=types, table=table)

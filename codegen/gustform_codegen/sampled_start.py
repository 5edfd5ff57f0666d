"""The start of a system with sampled controllers: the steady state of the same system with continuous ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform_codegen.evaluate import Array, TypeEvaluator
from gustform_codegen.link import Linked, LinkedType
from gustform_codegen.table import SampledTable, SystemTable, TypeTable

_DIGITS = 9  # that a steady state is solved to


def rounded(value: float) -> float:
    """To the digits that a steady state is solved to, so that a controller is the same wherever it is solved."""
    return float(f"{value:.{_DIGITS}g}") if abs(value) > 1e-9 else 0.0


def held_start(linked: Linked, steady: SystemTable, free: Mapping[str, float]) -> SystemTable:
    """The table of `linked` in the steady state of its twin: unknowns, free parameters, commands and, in the
    controllers, set points and states."""
    assert linked.twin is not None
    found = _Found(linked.twin, steady)
    table = linked.table
    start, derivative = table.start.copy(), table.start_derivative.copy()
    n_shared = len(linked.shared_names)
    if n_shared:
        start[-n_shared:] = steady.start[-n_shared:]
    types = [_placed(linked.types[k], t, found, start, derivative) for k, t in enumerate(table.types)]
    blocks = [_started(b, found, free) for b in table.sampled.blocks]
    return replace(
        table,
        types=types,
        start=start,
        start_derivative=derivative,
        sampled=replace(table.sampled, blocks=blocks),
    )


class _Found:
    """Every variable of a linked system at its steady state."""

    def __init__(self, linked: Linked, table: SystemTable) -> None:
        self.linked, self.table = linked, table
        self._recorded: dict[int, Array] = {}

    def value(self, name: str, path: str) -> float | None:
        """The value of "path" of an instance; None if it has no such variable."""
        number, k = self.linked.index_of[name]
        t = self.linked.types[number]
        path, sign = t.unit.aliases.get(path, (path, 1))
        while path in t.unit.aliases:
            path, other = t.unit.aliases[path]
            sign *= other
        for j, u in enumerate(t.unit.unknowns):
            if u.path == path:
                return sign * float(self.table.start[int(t.table.first_unknown[k]) + j])
        for j, x in enumerate(t.unit.externals):
            if x.path == path:
                return sign * float(self.table.start[int(t.table.external[k, j])])
        for j, r in enumerate(t.unit.recorded):
            if r.path == path:
                return sign * float(self._outputs(number)[j, k])
        return None

    def derivative(self, name: str, path: str) -> float:
        number, k = self.linked.index_of[name]
        t = self.linked.types[number]
        for j, u in enumerate(t.unit.unknowns):
            if u.path == path:
                return float(self.table.start_derivative[int(t.table.first_unknown[k]) + j])
        return 0.0

    def parameter(self, name: str, path: str) -> float:
        number, k = self.linked.index_of[name]
        t = self.linked.types[number]
        j = [p.path for p in t.unit.parameters].index(path)
        return float(self.table.types[number].parameters[k, j])

    def _outputs(self, number: int) -> Array:
        if number not in self._recorded:
            t, table = self.linked.types[number], self.table.types[number]
            splines = [lookup.spline for lookup in self.table.tables]
            self._recorded[number] = _Outputs(t, splines).at(t, table, self.table, self.linked.operating_input)
        return self._recorded[number]


class _Outputs(TypeEvaluator):
    """The recorded variables of one type."""

    def __init__(self, t: LinkedType, splines: list[dict[str, Any]]) -> None:
        super().__init__(t.unit, t.table.table, splines)
        self._all = self._function("recorded", [ca.vertcat(*[r.expression for r in t.unit.recorded])])

    def at(self, t: LinkedType, table: TypeTable, system: SystemTable, inputs: NDArray[np.float64]) -> Array:
        """(recorded, instances) in the state of `system`."""
        own = table.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
        slots = table.first_input[:, None] + np.arange(len(t.unit.inputs))
        u = inputs[slots].T if t.unit.inputs else np.zeros((0, len(t.names)))
        arguments = [
            system.start[own].T,
            system.start_derivative[own].T,
            system.start[table.external].T,
            u,
            table.discrete.T,
            table.parameters.T,
        ]
        return self._all([*arguments, self._call_values(arguments)])[0]


def _placed(t: LinkedType, table: TypeTable, found: _Found, start: Array, derivative: Array) -> TypeTable:
    parameters, discrete = table.parameters.copy(), table.discrete.copy()
    for k, name in enumerate(t.names):
        for j, u in enumerate(t.unit.unknowns):
            value = found.value(name, u.path)
            where = int(table.first_unknown[k]) + j
            if value is not None:
                start[where] = value
            derivative[where] = found.derivative(name, u.path)
        for index in t.unit.free_parameters:
            parameters[k, index] = found.parameter(name, t.unit.parameters[index].path)
        for j, d in enumerate(t.unit.discretes):
            value = found.value(name, d.path)
            discrete[k, j] = discrete[k, j] if value is None else value
    return replace(table, parameters=parameters, discrete=discrete)


def _started(block: SampledTable, found: _Found, free: Mapping[str, float]) -> SampledTable:
    parameters = list(block.parameters)
    for k, path in enumerate(block.parameter_paths):
        name = f"{block.name}.{path}"
        parameters[k] = rounded(free[name]) if name in free else parameters[k]
    states = []
    for path in block.state_paths:
        value = found.value(block.name, path)
        assert value is not None, path
        states.append(rounded(value))
    return replace(block, parameters=np.array(parameters), states=np.array(states))

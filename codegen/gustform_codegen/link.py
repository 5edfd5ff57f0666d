"""Link instances of compiled types into one system: index tables, shared unknowns, the merged sparsity pattern.

No symbols here and no work per equation of an instance: every step is an array operation per type. A connection set
gives one unknown per potential and one sum row per flow, at the same index.
"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gustform.language.component import Component, suggest
from gustform.language.connector import Connector
from gustform.language.declare import Parameter
from gustform.language.errors import GustformError
from gustform.language.system import Constant, Series, System
from gustform_codegen.emit.kernel import Kernel
from gustform_codegen.structure import match, overdetermined_part, underdetermined_part
from gustform_codegen.table import Channel, LookupTable, SeriesTable, SystemTable, TypeTable
from gustform_codegen.unit_type import UnitType


@dataclass(frozen=True, eq=False)
class LinkedType:
    """A unit type with its kernel and its instances in this system."""

    unit: UnitType
    kernel: Kernel
    kernel_path: str
    names: list[str]
    components: list[Component]
    table: TypeTable
    first_instance: int  # counted through all types


@dataclass(frozen=True, eq=False)
class Linked:
    """A linked system: the arrays, and what is needed to speak about them by name."""

    system: System
    types: list[LinkedType]
    table: SystemTable
    shared: dict[str, int]  # "bus.terminal.vr" -> unknown, for every port of the set
    shared_names: list[str]  # one name for each shared unknown
    operating_input: np.ndarray[Any, np.dtype[np.float64]]
    index_of: dict[str, tuple[int, int]] = field(repr=False, default_factory=dict)  # instance -> (type, number)
    twin: Linked | None = None  # with every control in the equations, if there are sampled ones

    def unknown_name(self, index: int) -> str:
        """The name of a global unknown."""
        for t in self.types:
            n = len(t.unit.unknowns)
            hit = np.flatnonzero((t.table.first_unknown <= index) & (index < t.table.first_unknown + n))
            if hit.size:
                k = int(hit[0])
                return f"{t.names[k]}.{t.unit.unknowns[index - int(t.table.first_unknown[k])].path}"
        return self.shared_names[index - (self.table.n_unknowns - len(self.shared_names))]

    def row_text(self, index: int) -> str:
        """How the residual row of that index was written."""
        for t in self.types:
            n = len(t.unit.unknowns)
            hit = np.flatnonzero((t.table.first_unknown <= index) & (index < t.table.first_unknown + n))
            if hit.size:
                k = int(hit[0])
                return f"{t.names[k]}: {t.unit.rows[index - int(t.table.first_unknown[k])].text}"
        return f"sum of flows at {self.unknown_name(index)}"

    def channel(self, name: str) -> tuple[Channel, int] | None:
        """The channel that holds a variable, with the sign it enters with; None if there is no such variable."""
        instance, _, rest = name.partition(".")
        if instance not in self.index_of:
            return None
        number, k = self.index_of[instance]
        return _channel(self.types[number], k, rest, name, 1)

    def select(self, patterns: Iterable[str]) -> tuple[list[Channel], dict[str, tuple[str, int]]]:
        """Channels for name patterns ("sg.frequency", "wt.*"), and the alias table of what they stand for.

        An alias maps a name to (channel name, sign). A pattern that matches nothing is GF2011.
        """
        channels: dict[tuple[int, int, int], Channel] = {}
        aliases: dict[str, tuple[str, int]] = {}
        for pattern in patterns:
            found = False
            for t, k, path in self._matching(pattern):
                found = True
                full = f"{t.names[k]}.{path}"
                resolved = _channel(t, k, path, full, 1)
                if resolved is None:
                    continue
                channel, sign = resolved
                key = (channel.kind, channel.a, channel.b)
                kept = channels.setdefault(key, channel)
                if kept.name != full:
                    aliases[full] = (kept.name, sign)
            if not found:
                raise GustformError(
                    "GF2011", f"no variable matches {pattern!r}", hint=suggest(pattern, self._some_names())
                )
        return list(channels.values()), aliases

    def _matching(self, pattern: str) -> Iterator[tuple[LinkedType, int, str]]:
        """(type, instance number, path) of the variables whose name matches. A pattern that begins with the full name
        of an instance looks at that one only: a farm's channels by name must not cost their number squared."""
        head = pattern.partition(".")[0]
        if head in self.index_of:
            number, k = self.index_of[head]
            candidates: list[tuple[LinkedType, Sequence[int]]] = [(self.types[number], [k])]
        else:
            candidates = [(t, range(len(t.names))) for t in self.types]
        # Square brackets are instance numbers here, not character classes.
        escaped = pattern.replace("[", "\0").replace("]", "[]]").replace("\0", "[[]")
        matches = re.compile(fnmatch.translate(escaped)).match
        for t, instances in candidates:
            unit = t.unit
            local = [u.path for u in unit.unknowns] + [r.path for r in unit.recorded]
            local += [x.path for x in unit.externals] + list(unit.aliases)
            for k in instances:
                name = t.names[k]
                for path in local:
                    if matches(f"{name}.{path}"):
                        yield t, k, path

    def _some_names(self) -> list[str]:
        return [
            f"{t.names[0]}.{path}"
            for t in self.types
            for path in [*(u.path for u in t.unit.unknowns), *(r.path for r in t.unit.recorded), *t.unit.aliases]
        ]


def _channel(t: LinkedType, k: int, path: str, name: str, sign: int) -> tuple[Channel, int] | None:
    unit = t.unit
    if path in unit.aliases:
        target, s = unit.aliases[path]
        # An alias keeps its own name only when its sign is +; otherwise the target's name and values are recorded.
        shown = name if s > 0 else f"{t.names[k]}.{target}"
        return _channel(t, k, target, shown, sign * s)
    for j, u in enumerate(unit.unknowns):
        if u.path == path:
            return Channel(name, u.declared.unit, u.declared.description, 0, int(t.table.first_unknown[k]) + j, 0), sign
    for j, x in enumerate(unit.externals):
        if x.path == path:
            return Channel(name, x.declared.unit, x.declared.description, 0, int(t.table.external[k, j]), 0), sign
    for j, r in enumerate(unit.recorded):
        if r.path == path:
            return Channel(name, r.declared.unit, r.declared.description, 1, t.first_instance + k, j), sign
    return None


# ---- connection sets ----


@dataclass(frozen=True, eq=False)
class _ConnectionSet:
    ports: list[str]  # the one with the most connections first
    connector: Connector

    @property
    def hub(self) -> str:
        return self.ports[0]


def connection_sets(system: System) -> list[_ConnectionSet]:
    """Ports that are connected, as sets; GF3003 for a port that is not connected at all."""
    parent: dict[str, str] = {}

    def find(port: str) -> str:
        while parent.setdefault(port, port) != port:
            parent[port] = parent.setdefault(parent[port], parent[port])
            port = parent[port]
        return port

    degree: dict[str, int] = {}
    for a, b in system.connections:
        degree[a] = degree.get(a, 0) + 1
        degree[b] = degree.get(b, 0) + 1
        parent[find(a)] = find(b)
    groups: dict[str, list[str]] = {}
    for name, component in system.components.items():
        for port, connector in component.declared(Connector).items():
            path = f"{name}.{port}"
            if path not in degree and not connector.optional:
                raise GustformError(
                    "GF3003",
                    f"{path} is not connected ({connector.description})",
                    hint=f"at: a bus, or a connection of {path}",
                )
            # An optional port that nobody uses is a set of its own: its flows sum to zero.
            groups.setdefault(find(path), []).append(path)
    return [
        _ConnectionSet(sorted(ports, key=lambda p: -degree.get(p, 0)), system.port(ports[0]))
        for ports in groups.values()
    ]


# ---- linking ----


def link(system: System, types: list[tuple[UnitType, Kernel, str, list[str]]]) -> Linked:
    """Wire the instances of compiled types: `types` holds (unit, kernel, kernel path, instance names)."""
    numbers: dict[str, tuple[int, int]] = {}
    first: list[np.ndarray[Any, Any]] = []
    n = 0
    for number, (unit, _, _, names) in enumerate(types):
        size = len(unit.unknowns)
        first.append(n + size * np.arange(len(names), dtype=np.int32))
        n += size * len(names)
        numbers.update({name: (number, k) for k, name in enumerate(names)})

    shared: dict[str, int] = {}
    shared_names: list[str] = []
    start, nominal = [], []
    for group in connection_sets(system):
        for name in group.connector._potentials:
            for port in group.ports:
                shared[f"{port}.{name}"] = n + len(shared_names)
            component, path, value = _declared_by(system, group, name, "start")
            start.append(component.number(value, f"{path} (start)"))
            component, path, value = _declared_by(system, group, name, "nominal")
            nominal.append(_nominal(component, value, path))
            shared_names.append(f"{group.hub}.{name}")
    total = n + len(shared_names)

    input_value, operating, series, first_input = _inputs(system, types)
    lookup: list[LookupTable] = []
    lookup_of: dict[int, int] = {}
    linked: list[LinkedType] = []
    entries: list[tuple[Any, Any]] = []
    first_instance = 0
    for number, (unit, kernel, kernel_path, names) in enumerate(types):
        components = [system.components[name] for name in names]
        external = _externals(system, unit, names, shared, numbers, types, first)
        flow_row = np.array(
            [[shared[f"{name}.{f.potential}"] for f in unit.flows] for name in names], dtype=np.int32
        ).reshape(len(names), len(unit.flows))
        size = len(unit.unknowns)
        local_rows, local_columns = np.array(kernel.jacobian_row, int), np.array(kernel.jacobian_column, int)
        row_map = np.concatenate([first[number][:, None] + np.arange(size), flow_row], axis=1)
        column_map = np.concatenate([first[number][:, None] + np.arange(size), external], axis=1)
        entries.append((row_map[:, local_rows], column_map[:, local_columns]))
        tables = np.zeros((len(names), len(unit.tables)), dtype=np.int32)
        for k, component in enumerate(components):
            for j, reference in enumerate(unit.tables):
                data = component.at(reference.owner.path).table(reference.declaration.name)
                if id(data) not in lookup_of:
                    lookup_of[id(data)] = len(lookup)
                    lookup.append(LookupTable(data.spline()))
                tables[k, j] = lookup_of[id(data)]
        parameters = np.zeros((len(names), len(unit.parameters)))
        discrete = np.zeros((len(names), len(unit.discretes)))
        values: dict[int, tuple[list[float], list[float]]] = {}
        for k, component in enumerate(components):
            if id(component) not in values:
                by_path = component.parameter_values()
                values[id(component)] = (
                    [by_path[p.path] for p in unit.parameters],
                    [component.at(d.owner.path).start_value(d.declaration) for d in unit.discretes],  # type: ignore[arg-type]
                )
            parameters[k], discrete[k] = values[id(component)]
        table = TypeTable(
            name=unit.name,
            kernel_path=kernel_path,
            instance_names=names,
            unknown_names=[u.path for u in unit.unknowns],
            equation_names=[r.text for r in unit.rows],
            external_names=[x.path for x in unit.externals],
            flow_names=[f.path for f in unit.flows],
            root_names=[r.text for r in unit.roots],
            when_names=[w.text for w in unit.whens],
            parameter_names=[p.path for p in unit.parameters],
            first_unknown=first[number],
            external=external,
            flow_row=flow_row,
            jacobian_position=np.zeros((len(names), local_rows.size), dtype=np.int32),
            first_input=first_input[number],
            table=tables,
            parameters=parameters,
            discrete=discrete,
            root_kind=np.array([r.kind for r in unit.roots], dtype=np.uint8),
            when_root=np.array([w.root for w in unit.whens], dtype=np.int32),
            when_period=np.array([w.period for w in unit.whens], dtype=np.int32),
        )
        linked.append(LinkedType(unit, kernel, kernel_path, names, components, table, first_instance))
        first_instance += len(names)

    column_start, row_index, positions = _merge(entries, total)
    for t, position in zip(linked, positions, strict=True):
        t.table.jacobian_position[...] = position
    differential = np.zeros(total, dtype=np.uint8)
    y0, scale = np.zeros(total), np.ones(total)
    y0[n:], scale[n:] = start, nominal
    for t in linked:
        where = t.table.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
        if not t.unit.unknowns:
            continue
        differential[where] = [u.der is not None for u in t.unit.unknowns]
        y0[where], scale[where] = _start_values(t)
    schedule = _schedule(system, linked, numbers)
    result = SystemTable(
        types=[t.table for t in linked],
        column_start=column_start,
        row_index=row_index,
        start=y0,
        start_derivative=np.zeros(total),
        nominal=scale,
        differential=differential,
        input_value=input_value,
        series=series,
        tables=lookup,
        schedule_time=np.array([s[0] for s in schedule], dtype=np.float64),
        schedule_target=np.array([s[1] for s in schedule], dtype=np.int32).reshape(-1),
        schedule_value=np.array([s[2] for s in schedule], dtype=np.float64),
    )
    answer = Linked(system, linked, result, shared, shared_names, operating, numbers)
    check_structure(answer)
    return answer


def _declared_by(system: System, group: _ConnectionSet, name: str, what: str) -> tuple[Component, str, Any]:
    """The start or nominal of a shared potential, from the first port of the set that declares one of its own."""
    for port in group.ports:
        declared = getattr(system.port(port), what)
        if name in declared:
            break
    else:
        port, declared = group.hub, {name: getattr(group.connector._potentials[name], what)}
    instance, _, port_name = port.partition(".")
    return system.components[instance], f"{port_name}.{name}", declared[name]


def _nominal(owner: Component, declared: Any, label: str) -> float:
    value = owner.number(declared, f"{label} (nominal)")
    if value <= 0:
        path = f"{owner.path}.{label}" if owner.path else label
        raise GustformError(
            "GF2003", f"{type(owner).__name__}: nominal of {path} must be greater than 0; got {value:g}"
        )
    return value


def _start_values(t: LinkedType) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    start = np.zeros((len(t.names), len(t.unit.unknowns)))
    nominal = np.ones_like(start)
    cache: dict[int, tuple[list[float], list[float]]] = {}
    for k, component in enumerate(t.components):
        if id(component) not in cache:
            starts, nominals = [], []
            for u in t.unit.unknowns:
                s, owner = u.declared, component.at(u.declared.owner.path)
                name = u.path.rpartition(".")[2]
                port = s.port
                declared: Any = s.declaration
                if port is None:
                    starts.append(owner.start_value(declared))
                    nominals.append(_nominal(owner, declared.nominal, name))
                    continue
                starts.append(owner.number(port.start.get(name, getattr(declared, "start", 0.0)), f"{name} (start)"))
                nominals.append(_nominal(owner, port.nominal.get(name, declared.nominal), name))
            cache[id(component)] = (starts, nominals)
        start[k], nominal[k] = cache[id(component)]
    return start, nominal


def _inputs(system: System, types: list[tuple[UnitType, Kernel, str, list[str]]]) -> tuple[Any, Any, Any, Any]:
    values: list[float] = []
    operating: list[float] = []
    series: dict[int, SeriesTable] = {}
    first_input = []
    for unit, _, _, names in types:
        first = []
        for name in names:
            first.append(len(values))
            for s in unit.inputs:
                source = system.inputs.get(f"{name}.{s.path}")
                if source is None:
                    raise GustformError(
                        "GF3006",
                        f"input {name}.{s.path} is not driven ({s.description}, {s.unit})",
                        hint=f"wind: {{{name}: ...}}" if s.path == "wind" else f"a source for {name}.{s.path}",
                    )
                if isinstance(source, Constant):
                    values.append(source.value)
                    operating.append(source.value)
                    continue
                if id(source) not in series:
                    series[id(source)] = _series_table(source, s.unit)
                series[id(source)].slots.append(len(values))
                values.append(source.operating_value)
                operating.append(source.operating_value)
        first_input.append(np.array(first, dtype=np.int32))
    return np.array(values, dtype=np.float64), np.array(operating, dtype=np.float64), list(series.values()), first_input


def _series_table(source: Series, unit: str) -> SeriesTable:
    return SeriesTable(
        name=source.name,
        unit=unit,
        slots=[],
        interpolation={"linear": 0, "hold": 1, "pchip": 2}[source.interpolation],
        source=0 if source.value is not None else 1,
        on_end={"error": 0, "hold": 1, "repeat": 2}[source.on_end],
        t0=source.t0,
        dt=source.dt,
        t_end=source.t_end,
        time=source.time,
        value=source.value,
    )


def _externals(
    system: System,
    unit: UnitType,
    names: list[str],
    shared: dict[str, int],
    numbers: dict[str, tuple[int, int]],
    types: list[tuple[UnitType, Kernel, str, list[str]]],
    first: list[np.ndarray[Any, Any]],
) -> np.ndarray[Any, Any]:
    external = np.zeros((len(names), len(unit.externals)), dtype=np.int32)
    for j, x in enumerate(unit.externals):
        if x.declared.kind == "potential":
            external[:, j] = [shared[f"{name}.{x.path}"] for name in names]
            continue
        for k, name in enumerate(names):
            source, rest = system.split(system.signals[f"{name}.{x.path}"])
            number, instance = numbers[source]
            other = types[number][0]
            path, sign = other.aliases.get(rest, (rest, 1))
            position = next((p for p, u in enumerate(other.unknowns) if u.path == path), -1)
            if position < 0 or sign < 0:
                raise GustformError("GF3007", f"signal {source}.{rest} of {name}.{x.path} is not available")
            external[k, j] = first[number][instance] + position
    return external


def _merge(entries: list[tuple[Any, Any]], n: int) -> tuple[Any, Any, list[Any]]:
    """CSC pattern of all entries, and where each entry goes in it."""
    rows = np.concatenate([r.ravel() for r, _ in entries]) if entries else np.zeros(0, int)
    columns = np.concatenate([c.ravel() for _, c in entries]) if entries else np.zeros(0, int)
    keys, inverse = np.unique(columns.astype(np.int64) * n + rows, return_inverse=True)
    column_start = np.searchsorted(keys // n, np.arange(n + 1)).astype(np.int32)
    row_index = (keys % n).astype(np.int32)
    positions, offset = [], 0
    for r, _ in entries:
        positions.append(inverse[offset : offset + r.size].reshape(r.shape).astype(np.int32))
        offset += r.size
    return column_start, row_index, positions


def _schedule(
    system: System, linked: list[LinkedType], numbers: dict[str, tuple[int, int]]
) -> list[tuple[float, tuple[int, int, int], float]]:
    """Scheduled changes as (time, (type, instance, parameter), value), with everything computed from them."""
    result = []
    current = dict(system.components)
    for change in sorted(system.schedule, key=lambda c: c.at):
        name, rest = system.split(change.path)
        number, k = numbers[name]
        parameters = linked[number].unit.parameters
        before = current[name].parameter_values()
        current[name] = current[name].with_value(rest, change.value)
        after = current[name].parameter_values()
        for j, p in enumerate(parameters):
            declared = p.declaration
            assert isinstance(declared, Parameter)
            # What a change sets is set, also a free parameter, whose value before is known only at the start.
            if p.path == rest or (after[p.path] != before[p.path] and not declared.free):
                result.append((change.at, (number, k, j), after[p.path]))
    return result


# ---- structure of the whole ----


def check_structure(linked: Linked) -> None:
    """GF3020/GF3021 if the linked system has no matching between rows and unknowns (derivatives of states,
    algebraic unknowns), naming both sides."""
    n = linked.table.n_unknowns
    rows: list[set[int]] = [set() for _ in range(n)]
    for t in linked.types:
        size = len(t.unit.unknowns)
        row_map = np.concatenate([t.table.first_unknown[:, None] + np.arange(size), t.table.flow_row], axis=1)
        column_map = np.concatenate([t.table.first_unknown[:, None] + np.arange(size), t.table.external], axis=1)
        for r, c, via_derivative in zip(
            t.kernel.jacobian_row, t.kernel.jacobian_column, t.kernel.jacobian_has_derivative, strict=True
        ):
            keep = (linked.table.differential[column_map[:, c]] == 0) | via_derivative
            for row, column in zip(row_map[keep, r].tolist(), column_map[keep, c].tolist(), strict=True):
                rows[row].add(column)
    incidence = [frozenset(row) for row in rows]
    matching = match(incidence, n)
    if not matching.free_equations:
        return
    equations, _ = overdetermined_part(incidence, matching)
    _, unknowns = underdetermined_part(incidence, matching)
    raise GustformError(
        "GF3020",
        "the connected system has no unique solution: nothing determines "
        + ", ".join(linked.unknown_name(z) for z in unknowns[:6])
        + "; too many conditions for the same unknowns: "
        + "; ".join(linked.row_text(e) for e in equations[:6]),
        hint="a source, a load or a generator at that bus, or one voltage source fewer",
    )

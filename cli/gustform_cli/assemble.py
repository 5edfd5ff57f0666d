"""From a validated scenario to a System: components placed and connected, wind bound, events scheduled."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gustform.language.component import Component
from gustform.language.connector import Connector
from gustform.language.declare import Input, Parameter, Part
from gustform.language.errors import GustformError
from gustform.language.system import Series, System
from gustform.registry import UNITS, Unit
from gustform_cli.components import Reader, entries
from gustform_cli.document import Document, NodePath, dotted
from gustform_cli.errors import ErrorList, did_you_mean
from gustform_cli.scenario import ComponentEntry, Scenario, validate
from gustform_cli.wind.rotor import Reader as SeriesReader
from gustform_cli.wind.source import Site, operating_wind, sources

# The signal, the part and the parameter this layer knows by name.
FRAME = "frame"
ROTOR, RADIUS = "rotor", "radius"
FIDELITY = "fidelity"


@dataclass
class Assembled:
    """A system with what the run needs beside it."""

    scenario: Scenario
    document: Document
    system: System
    counts: dict[str, int] = field(default_factory=dict)  # components that stand there several times
    readers: dict[str, SeriesReader] = field(default_factory=dict)  # by the name of the series
    warnings: list[str] = field(default_factory=list)
    longest_step: float = math.inf  # of the solver, s, lest it pass over a gust; run.max_step may be shorter
    frequency: str | None = None  # channel of the grid frequency

    def instances(self, name: str) -> list[str]:
        """The units a component's name stands for: wt, or wt[1], wt[2], ..."""
        if name in self.counts:
            return [f"{name}[{number}]" for number in range(1, self.counts[name] + 1)]
        return [name]


def assemble(document: Document) -> Assembled:
    """The system a document describes. Raises ErrorList with everything that is wrong, in the order of the file."""
    scenario, errors = validate(document)
    try:
        plain = document.plain()
    except GustformError as error:
        raise ErrorList([error]) from None
    turbines = plain.get("turbines")
    reader = Reader(document, turbines if isinstance(turbines, int) else None, errors)
    listed = plain.get("components")
    components = _components(reader, listed if isinstance(listed, dict) else {}, scenario)
    if scenario is not None and not errors:
        result = _Assembly(document, scenario, reader, components).run()
        if not errors:
            return result
    raise ErrorList(sorted(errors, key=_position))


def _components(reader: Reader, listed: Mapping[str, Any], scenario: Scenario | None) -> dict[str, Component]:
    """The components without errors. What hangs at another comes after it, because its voltage follows."""
    made: dict[str, Component] = {}
    units = dict(entries(listed))
    for hanging in (False, True):
        for name, entry in units.items():
            node = entry.get("at", entry.get("from"))
            if isinstance(node, str) is hanging:
                implied: dict[str, float | str] = {
                    **_fidelity(entry["type"], scenario),
                    **_operating_wind(entry, name, reader, scenario),
                    **_voltage(entry["type"], node, made, units),
                }
                component = reader.component(name, entry, implied)
                if component is not None:
                    made[name] = component
    return {name: made[name] for name in units if name in made}


def _fidelity(kind: str, scenario: Scenario | None) -> dict[str, str]:
    """How finely a unit is modelled, unless its entry says otherwise, is said once for the whole scenario."""
    known = scenario is not None and kind in UNITS and FIDELITY in UNITS[kind].kind.declared(Parameter)
    return {FIDELITY: scenario.fidelity} if known and scenario is not None else {}


def _operating_wind(entry: Mapping[str, Any], name: str, reader: Reader, scenario: Scenario | None) -> dict[str, float]:
    """The wind speed a turbine's operating point is made for, unless its entry says another: that of its wind."""
    block = scenario.wind.get(name) if scenario is not None else None
    unit = UNITS.get(entry["type"])
    if unit is None or unit.wind_speed is None or block is None or scenario is None or unit.wind_speed in entry:
        return {}
    try:
        speed = operating_wind(block, Path(reader.document.file).parent, scenario.run.until)
    except GustformError as error:
        place = error.place or reader.document.place(("wind", name))
        reader.errors.append(GustformError(error.code, error.message, hint=error.hint, place=place))
        speed = 8.0  # so that nothing else is reported for want of it
    return {unit.wind_speed: speed}


def _voltage(
    kind: str, node: str, made: Mapping[str, Component], units: Mapping[str, Mapping[str, Any]]
) -> dict[str, float]:
    """The nominal voltage of what hangs at a bus is that of the bus, unless its entry says another."""
    if kind not in UNITS or UNITS[kind].voltage is None or node not in made:
        return {}
    source = UNITS[units[node]["type"]].voltage
    return {} if source is None else {str(UNITS[kind].voltage): float(made[node].value(source))}


def _position(error: GustformError) -> tuple[int, int]:
    return (error.place.line, error.place.column) if error.place is not None else (0, 0)


class _Assembly:
    """The steps of `assemble` once everything in the file has a shape."""

    def __init__(
        self, document: Document, scenario: Scenario, reader: Reader, components: Mapping[str, Component]
    ) -> None:
        self.document, self.scenario, self.reader, self.components = document, scenario, reader, components
        self.errors = reader.errors
        self.result = Assembled(scenario, document, System())

    def run(self) -> Assembled:
        self._place_components()
        self._connect_terminals()
        self._connect_listed()
        if not self.errors:
            self._find_loose_ends()
        self._wire_frame()
        self._bind_wind()
        self._schedule_events()
        return self.result

    def _fail(self, code: str, path: NodePath, message: str, hint: str = "", *, key: bool = False) -> None:
        self.errors.append(GustformError(code, message, hint=hint, place=self.document.place(path, key=key)))

    def _keep(self, error: GustformError, path: NodePath) -> None:
        place = error.place or self.document.place(path)
        self.errors.append(GustformError(error.code, error.message, hint=error.hint, place=place))

    def _known(self, name: str, path: NodePath, *, key: bool = False) -> bool:
        if name in self.components:
            return True
        self._fail(
            "GF2007",
            path,
            f"{dotted(path)} must be the name of a component; there is no {name!r}",
            did_you_mean(name, self.components),
            key=key,
        )
        return False

    def _unit(self, name: str) -> Unit:
        return UNITS[self.scenario.components[name].type]

    # ---- components and connections ---------------------------------------------------------------------------------
    def _place_components(self) -> None:
        for name, entry in self.scenario.components.items():
            if entry.count is not None:
                self.result.counts[name] = self.reader.many(entry.count, ("components", name, "count"))
            for instance in self.result.instances(name):
                # One object for all: what is the same is computed once.
                self.result.system.add(instance, self.components[name])

    def _connect_terminals(self) -> None:
        for name, entry in self.scenario.components.items():
            path: NodePath = ("components", name)
            if entry.at is not None and (entry.from_ is not None or entry.to is not None):
                self._fail(
                    "GF2403",
                    (*path, "at"),
                    f"{dotted(path)} must have either at, or from and to; it has both",
                    "at for what stands at one place, from and to for what lies between two",
                )
                continue
            own = _terminals(UNITS[entry.type])
            targets = [(key, target) for key, target in _targets(entry) if target is not None]
            if targets and len(targets) != len(own):
                wanted = {1: "at", 2: "from and to"}.get(len(own), "entries under connections")
                self._fail(
                    "GF2403",
                    (*path, targets[0][0]),
                    f"{dotted(path)} must be connected by {wanted}: {entry.type} has {_listed(own)}",
                    f"{'; '.join(f'[{name}.{port}, bus.terminal]' for port in own)} under connections"
                    if len(own) != 1
                    else "at: bus",
                )
                continue
            for port, (key, target) in zip(own, targets, strict=False):
                where = (*path, key)
                if not self._known(target.partition(".")[0], where):
                    continue
                other, _, other_port = target.partition(".")
                if not other_port:
                    ports = _terminals(self._unit(other))
                    if len(ports) != 1:
                        self._fail(
                            "GF2403",
                            where,
                            f"{dotted(where)} must name a terminal: {other} has {_listed(ports)}",
                            " or ".join(f"{other}.{one}" for one in ports) or "a bus",
                        )
                        continue
                    other_port = ports[0]
                self._connect(f"{name}.{port}", f"{other}.{other_port}", where)

    def _connect_listed(self) -> None:
        for index, (a, b) in enumerate(self.scenario.connections):
            known = [self._known(_base(end), ("connections", index, side)) for side, end in enumerate((a, b))]
            if all(known):
                self._connect(a, b, ("connections", index))

    def _find_loose_ends(self) -> None:
        """Terminals that nothing is connected to, with the line of their component; the linker would know the name
        only."""
        connected = {port for pair in self.result.system.connections for port in pair}
        for name, entry in self.scenario.components.items():
            instance = self.result.instances(name)[0]
            for port, connector in self.components[name].declared(Connector).items():
                if not connector.optional and f"{instance}.{port}" not in connected:
                    unit = UNITS[entry.type]
                    hint = "at: bus" if unit.at == port else "from: and to:" if port in (unit.ends or ()) else ""
                    if entry.type == "Bus":
                        hint = f"at: {name} in another component"
                    self._fail(
                        "GF3003",
                        ("components", name),
                        f"{name}.{port} must be connected ({connector.description}); nothing is",
                        hint or "an entry under connections",
                    )

    def _connect(self, a: str, b: str, path: NodePath) -> None:
        """Connect two ports; those of several components go one to one, or all to the one at the other end."""
        ones, others = self._ends(a), self._ends(b)
        if len(ones) > 1 and len(others) > 1 and len(ones) != len(others):
            self._fail(
                "GF2403",
                path,
                f"{dotted(path)} must join equal numbers; {a} stands for {len(ones)} and {b} for {len(others)}",
                "the same count for both",
            )
            return
        pairs = max(len(ones), len(others))
        ones, others = ones * (pairs // len(ones)), others * (pairs // len(others))
        try:
            for one, other in zip(ones, others, strict=True):
                self.result.system.connect(one, other)
        except GustformError as error:
            self._keep(error, path)

    def _ends(self, port: str) -> list[str]:
        name, _, rest = port.partition(".")
        return [f"{instance}.{rest}" for instance in self.result.instances(name)]

    # ---- signals, wind, events --------------------------------------------------------------------------------------
    def _wire_frame(self) -> None:
        frame = self.scenario.frame
        needs = [name for name, component in self.components.items() if FRAME in component.declared(Input)]
        if frame is None:
            if needs:
                self._fail(
                    "GF2202",
                    ("components", needs[0]),
                    f"frame must be given, because {needs[0]} has an angle; it is missing",
                    "frame: with the name of a synchronous generator",
                )
            return
        if not self._known(frame, ("frame",)):
            return
        source = self.result.instances(frame)[0]
        unit = self._unit(frame)
        if unit.speed is None:
            self._fail(
                "GF2204",
                ("frame",),
                f"frame must be a machine, which has a speed; {frame} is a {type(self.components[frame]).__name__}",
                " or ".join(name for name in self.components if self._unit(name).speed is not None),
            )
            return
        self.result.system.frame(f"{source}.{unit.speed}")
        if unit.frequency is not None:
            self.result.frequency = f"{source}.{unit.frequency}"

    def _bind_wind(self) -> None:
        for name in self.components:
            if self._unit(name).wind is not None and name not in self.scenario.wind:
                self._fail(
                    "GF2404",
                    ("components", name),
                    f"wind.{name} must be given; it is missing",
                    f"wind: {{{name}: {{type: constant, speed: 8 m/s}}}}",
                )
        for name, block in self.scenario.wind.items():
            path: NodePath = ("wind", name)
            if not self._known(name, path, key=True):
                continue
            wind = self._unit(name).wind
            if wind is None:
                self._fail(
                    "GF2404",
                    path,
                    f"{dotted(path)} must belong to a turbine; {self.scenario.components[name].type} takes no wind",
                    " or ".join(other for other in self.components if self._unit(other).wind is not None),
                )
                continue
            instances = self.result.instances(name)
            try:
                for instance, source in zip(instances, sources(block, self._site(name, instances)), strict=True):
                    self.result.system.bind(f"{instance}.{wind}", source.drive)
                    if source.reader is not None and isinstance(source.drive, Series):
                        self.result.readers[source.drive.name] = source.reader
                    self.result.warnings += [text for text in source.warnings if text not in self.result.warnings]
                    self.result.longest_step = min(self.result.longest_step, source.longest_step)
            except GustformError as error:
                self._keep(error, path)

    def _site(self, name: str, instances: list[str]) -> Site:
        component = self.components[name]
        operating = self._unit(name).wind_speed
        return Site(
            name,
            instances,
            folder=Path(self.document.file).parent,
            until=self.scenario.run.until,
            operating=float(component.value(operating)) if operating is not None else None,
            radius=lambda: self._radius(name),
            place=lambda *keys: self.document.place(("wind", name, *keys)),
        )

    def _radius(self, name: str) -> float:
        """Rotor radius, m."""
        component = self.components[name]
        rotor = component.part(ROTOR) if ROTOR in component.declared(Part) else component
        if RADIUS not in rotor.declared(Parameter):
            raise GustformError(
                "GF2202", f"wind.{name}.radius must be given; {name} does not tell it", hint="radius: 63 m"
            )
        return float(rotor.value(RADIUS))

    def _schedule_events(self) -> None:
        for index, event in enumerate(self.scenario.events):
            if event.at > self.scenario.run.until:
                self.result.warnings.append(
                    f"events[{index}] at {event.at:g} s comes after the end of the run, {self.scenario.run.until:g} s: "
                    "it does not happen"
                )
            for target, value in event.set.items():
                path: NodePath = ("events", index, "set", target)
                name, _, rest = target.partition(".")
                if not self._known(_base(name), path, key=True):
                    continue
                if not rest:
                    self._fail(
                        "GF2405",
                        path,
                        f"{dotted(path[:3])} keys must be component.parameter; got {target!r}",
                        f"{target}.active",
                        key=True,
                    )
                    continue
                number = self.reader.parameter(self.components[_base(name)], rest, value, target, path)
                if number is None:
                    continue
                instances = [name] if "[" in name else self.result.instances(name)
                try:
                    for instance in instances:
                        self.result.system.change(event.at, f"{instance}.{rest}", number)
                except GustformError as error:
                    self._keep(error, path)


def _targets(entry: ComponentEntry) -> list[tuple[str, str | None]]:
    return [("at", entry.at), ("from", entry.from_), ("to", entry.to)]


def _base(path: str) -> str:
    """The component's name in wt.grid, wt[3].grid or wt[3]."""
    return re.split(r"[.\[]", path, maxsplit=1)[0]


def _terminals(unit: Unit) -> list[str]:
    """The ports that `at`, or `from` and `to`, connect."""
    return [unit.at] if unit.at is not None else list(unit.ends or ())


def _listed(names: list[str]) -> str:
    return f"the terminals {', '.join(names)}" if len(names) > 1 else f"the terminal {names[0]}" if names else "none"

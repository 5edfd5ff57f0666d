"""Sampled controllers of a linked system: which library steps them, what they measure and what they hold.

A turbine whose control is `sampled` has no equations for it, nor for a curtailment schedule that is part of it. The C
that `gustform export controller` writes for them is compiled, and the runtime steps it beside the equations. Instances
whose controllers differ by numbers alone share one library: their numbers are data of the blocks. The steady state is
that of the continuous control, see `held_start`.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.control.pitch import HeldPitchDemand
from gustform.language.component import Component
from gustform.language.declare import Part, Table
from gustform.language.errors import GustformError
from gustform.language.system import System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.cache import KernelCache
from gustform_codegen.emit.controller.a2l import offsets
from gustform_codegen.emit.controller.block import Block, controller_block
from gustform_codegen.emit.controller.c_header import Names, header
from gustform_codegen.emit.controller.c_source import source
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.folder import default_prefix
from gustform_codegen.emit.controller.interface import common_header, interface_header, interface_source
from gustform_codegen.emit.controller.program import Program, program
from gustform_codegen.emit.controller.signals import Signal
from gustform_codegen.link import Linked, LinkedType
from gustform_codegen.table import Sampled, SampledTable

_CONTROL, _PITCH, _SCHEDULE = "control", "pitch", "schedule"

# What a control says of samples, in the order in which it can be taken back.
_CONTINUOUS: dict[str, Any] = {"delay": 0, "real": "float", "sampled": 0.0}

# Programs made by this process: structure, period and numbers -> program.
_programs: dict[Hashable, Program] = {}


def is_sampled(component: Component) -> bool:
    """Whether the control of this unit is outside of the equations. GF4105 if half of it is."""
    if not isinstance(component, PmsgTurbine):
        return False
    sampled = bool(component.control.sampled > 0.0)
    if isinstance(component.pitch, HeldPitchDemand) != sampled:
        raise GustformError(
            "GF4105",
            f"{type(component).__name__}.pitch is {type(component.pitch).__name__}, which does not go with "
            f"control.sampled = {component.control.sampled:g} s: both controls are one controller",
            hint="no type for pitch",
        )
    schedule = component.schedule
    if isinstance(schedule, CurtailmentSchedule) and schedule.sampled != component.control.sampled:
        raise GustformError(
            "GF4105",
            f"{type(component).__name__}.schedule.sampled = {schedule.sampled:g} s, which does not go with "
            f"control.sampled = {component.control.sampled:g} s: both are one controller",
            hint="no period for schedule",
        )
    return sampled


def schedule_of(turbine: Any, inside: bool | None = None) -> CurtailmentSchedule | None:
    """The schedule that is part of a turbine's exported controller, if one is; by its `location` unless told."""
    schedule = turbine.schedule
    if not isinstance(schedule, CurtailmentSchedule):
        return None
    if inside is None:
        inside = schedule.location == "controller"
    return schedule if inside else None


def continuous(system: System) -> System:
    """The system with every control in the equations; the same object if it is so already."""
    made: dict[int, Component] = {}
    for component in system.components.values():
        if id(component) not in made:
            made[id(component)] = _in_the_equations(component) if is_sampled(component) else component
    if all(made[id(component)] is component for component in system.components.values()):
        return system
    return replace(system, components={name: made[id(component)] for name, component in system.components.items()})


def _in_the_equations(component: Component) -> Component:
    for name, value in _CONTINUOUS.items():
        component = component.with_value(f"{_CONTROL}.{name}", value)
    return component


@dataclass(frozen=True, eq=False)
class _Controller:
    """The exported controller of one component."""

    made: Program
    double: bool
    library: int
    parameter_paths: list[str]
    state_paths: list[str]

    @property
    def block(self) -> Block:
        return self.made.step.block


def sampled_blocks(linked: Linked, cache: KernelCache) -> Sampled:
    """The blocks of a system whose `twin` has its controls in the equations. GF41xx for a control without a C form."""
    libraries: dict[Hashable, int] = {}
    paths: list[str] = []
    known: dict[int, _Controller] = {}
    blocks: list[SampledTable] = []
    for number, t in enumerate(linked.types):
        for k, component in enumerate(t.components):
            if not is_sampled(component):
                continue
            if id(component) not in known:
                known[id(component)] = _controller(linked, t.names[k], component, cache, libraries, paths)
            blocks.append(_block(linked, t, number, k, known[id(component)]))
    return Sampled(paths, blocks, _changes(linked.system, blocks))


def _controller(
    linked: Linked,
    name: str,
    component: Component,
    cache: KernelCache,
    libraries: dict[Hashable, int],
    paths: list[str],
) -> _Controller:
    assert linked.twin is not None
    turbine: Any = linked.twin.system.components[name]
    control, pitch, schedule = turbine.control, turbine.pitch, schedule_of(turbine)
    double = component.part(_CONTROL).value("real") == "double"
    period = float(component.part(_CONTROL).value("sampled"))
    parts = [control, pitch] if schedule is None else [control, pitch, schedule]
    numbers: dict[str, float] = {}
    for part in parts:
        numbers |= part.parameter_values()
    key = (
        *(part.structure_key() for part in parts),
        period,
        tuple(numbers.items()),
        *(_tables(part) for part in parts),
    )
    if key not in _programs:
        _programs[key] = program(discretise(controller_block(control, pitch, schedule=schedule), period))
    made = _programs[key]
    names = Names(default_prefix(made.step.block.name), double)
    same = source(_without_values(made), names)
    if same not in libraries:
        libraries[same] = len(paths)
        paths.append(str(cache.controller(library_sources(made, names), made.step.block.name)))
    number, _ = linked.twin.index_of[name]
    unit = linked.twin.types[number].unit
    variables = [u.path for u in unit.unknowns] + list(unit.aliases) + [r.path for r in unit.recorded]
    return _Controller(
        made,
        double,
        libraries[same],
        _paths(made.step.parameters, list(numbers)),
        _paths(made.step.block.states, variables),
    )


def _tables(component: Component) -> tuple[bytes, ...]:
    """The numbers in the tables of a component and its parts: they are text of the C."""
    found: list[bytes] = []
    for name, declaration in component.declarations().items():
        if isinstance(declaration, Table):
            table = component.table(name)
            found += [table.x.tobytes(), table.y.tobytes(), table.value.tobytes()]
        elif isinstance(declaration, Part):
            found += _tables(component.part(name))
    return tuple(found)


def library_sources(made: Program, names: Names) -> dict[str, str]:
    """The files of the exported folder that its shared library is made of, the controller's own first."""
    return {
        f"{names.prefix}.c": source(made, names),
        f"{names.prefix}.h": header(made, names),
        f"{names.prefix}_interface.c": interface_source(made, names),
        f"{names.prefix}_interface.h": interface_header(names),
        "gust_controller.h": common_header(),
    }


def _without_values(made: Program) -> Program:
    """The same program with all start and default values 0, to tell what else differs."""

    def zero(signals: list[Signal]) -> list[Signal]:
        return [replace(s, value=0.0) for s in signals]

    block = made.step.block
    block = replace(
        block,
        inputs=zero(block.inputs),
        outputs=zero(block.outputs),
        states=zero(block.states),
        monitors=zero(block.monitors),
    )
    return replace(made, step=replace(made.step, block=block, parameters=zero(made.step.parameters)))


def _paths(signals: list[Signal], paths: list[str]) -> list[str]:
    """The paths in the unit that the names in C stand for."""
    places = (f"{_CONTROL}.", f"{_PITCH}.", f"{_SCHEDULE}.")
    named = {p.removeprefix(places[0]).replace(".", "_"): p for p in paths if p.startswith(places)}
    return [named[s.name] for s in signals]


def _block(linked: Linked, t: LinkedType, number: int, k: int, controller: _Controller) -> SampledTable:
    name, block, step = t.names[k], controller.block, controller.made.step
    control: Any = t.components[k].part(_CONTROL)
    size = 8 if controller.double else 4
    discretes = [d.path for d in t.unit.discretes]
    held = [f"{_CONTROL}.{s.name}" for s in block.outputs]
    held = [path if path in discretes else f"{_PITCH}.{s.name}" for path, s in zip(held, block.outputs, strict=True)]
    measurement = []
    for s in block.inputs:
        found = linked.channel(f"{name}.{s.name}") or linked.channel(f"{name}.{_SCHEDULE}.{s.name}")
        assert found is not None, s.name
        channel, sign = found
        measurement.append((channel.kind, channel.a if channel.kind == 0 else channel.b, sign))
    numbers = t.components[k].parameter_values()
    return SampledTable(
        name=name,
        type=number,
        instance=k,
        library=controller.library,
        delay=int(control.delay),
        real_size=size,
        state_offset=offsets(controller.made, size)["errors"] - size * max(len(step.memory), 1),
        period=step.period,
        measurement=np.array(measurement, dtype=np.int32),
        command=np.array([discretes.index(path) for path in held], dtype=np.int32),
        monitor=np.array([discretes.index(f"{_SCHEDULE}.{s.name}") for s in block.monitors], dtype=np.int32),
        parameters=np.array([numbers[path] for path in controller.parameter_paths]),
        states=np.array([s.value for s in block.states]),
        measurement_names=[s.name for s in block.inputs],
        measurement_units=[s.unit for s in block.inputs],
        command_names=[s.name for s in block.outputs],
        command_units=[s.unit for s in block.outputs],
        monitor_names=[s.name for s in block.monitors],
        parameter_paths=controller.parameter_paths,
        state_paths=controller.state_paths,
    )


def _changes(system: System, blocks: list[SampledTable]) -> list[tuple[float, int, int, float]]:
    """Scheduled changes that reach a controller's parameters, with everything computed from them."""
    index = {b.name: k for k, b in enumerate(blocks)}
    current = dict(system.components)
    result = []
    for change in sorted(system.schedule, key=lambda c: c.at):
        name, rest = system.split(change.path)
        if name not in index:
            continue
        before = current[name].parameter_values()
        current[name] = current[name].with_value(rest, change.value)
        after = current[name].parameter_values()
        for j, path in enumerate(blocks[index[name]].parameter_paths):
            if path == rest or after[path] != before[path]:
                result.append((change.at, index[name], j, after[path]))
    return result

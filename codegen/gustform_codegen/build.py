"""From a System to a linked one: flatten and compile each unit type once, then link the instances."""

from __future__ import annotations

import time
from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

from gustform.language.component import Component, suggest
from gustform.language.declare import Input
from gustform.language.errors import GustformError
from gustform.language.system import System
from gustform_codegen.cache import KernelCache
from gustform_codegen.emit.kernel import Kernel, emit_kernel
from gustform_codegen.flatten import flatten
from gustform_codegen.link import Linked, link
from gustform_codegen.sampled import continuous, sampled_blocks
from gustform_codegen.unit_type import UnitType

# Unit types flattened by this process: (structure, signals, kept variables) -> type and kernel text.
_flattened: dict[Hashable, tuple[UnitType, Kernel]] = {}


@dataclass(frozen=True)
class Built:
    """A linked system with what building it took."""

    linked: Linked
    compilations: int
    seconds: float


def unit_type(
    component: Component, signals: frozenset[str] = frozenset(), keep: frozenset[str] = frozenset()
) -> tuple[UnitType, Kernel]:
    """The flattened type and kernel text of a component; done once per structure in a process."""
    key = (component.structure_key(), signals, keep)
    if key not in _flattened:
        unit = flatten(component, signals, keep)
        _flattened[key] = (unit, emit_kernel(unit))
    return _flattened[key]


def _wired_inputs(system: System) -> dict[str, frozenset[str]]:
    """The inputs of each instance that are signals from other units."""
    wired: dict[str, set[str]] = {}
    for target in system.signals:
        name, _, rest = target.partition(".")
        wired.setdefault(name, set()).add(rest)
    return {name: frozenset(inputs) for name, inputs in wired.items()}


def _kept(system: System, wired: dict[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    """The variables of each instance that others read and that would not be unknowns otherwise."""
    kept: dict[str, set[str]] = {}
    for target, source in system.signals.items():
        name, rest = system.split(source)
        component = system.components[name]
        unit, _ = unit_type(component, wired.get(name, frozenset()))
        path, sign = unit.aliases.get(rest, (rest, 1))
        if any(u.path == path for u in unit.unknowns) and sign > 0:
            continue
        if rest in unit.aliases:
            path = rest
        elif not any(r.path == path for r in unit.recorded):
            known = [u.path for u in unit.unknowns] + [r.path for r in unit.recorded] + list(unit.aliases)
            raise GustformError(
                "GF3007", f"{target} reads {source}, which {name} does not have", hint=suggest(rest, known)
            )
        kept.setdefault(name, set()).add(path)
    return {name: frozenset(paths) for name, paths in kept.items()}


def build(system: System, cache: KernelCache) -> Built:
    """Compile what is not cached and link. Raises GF1xxx (declarations), GF3xxx (structure), GF4xxx (compiler)."""
    if not system.components:
        raise GustformError("GF3022", "the system has no components", hint="components: {...}")
    begin = time.perf_counter()
    compiled_before = cache.compilations
    for name, component in system.components.items():
        for label in component.declared(Input):
            path = f"{name}.{label}"
            if path not in system.signals and path not in system.inputs:
                declaration: Any = component.declared(Input)[label]
                raise GustformError(
                    "GF3006",
                    f"input {path} is not driven ({declaration.description}, {declaration.unit})",
                    hint=f"wind: {{{name}: ...}}" if label == "wind" else f"a signal or a source for {path}",
                )
    linked = link(system, _types(system, cache))
    twin = continuous(system)
    if twin is not system:
        # Never run, so that its kernels need not be compiled.
        linked = replace(linked, twin=link(twin, _types(twin, None)))
        linked = replace(linked, table=replace(linked.table, sampled=sampled_blocks(linked, cache)))
    return Built(linked, cache.compilations - compiled_before, time.perf_counter() - begin)


def _types(system: System, cache: KernelCache | None) -> list[tuple[UnitType, Kernel, str, list[str]]]:
    """The types of a system with the paths of their kernels, "" without a cache, and the names of their instances."""
    wired = _wired_inputs(system)
    kept = _kept(system, wired)
    groups: dict[Hashable, list[str]] = {}
    keys: dict[int, Hashable] = {}
    for name, component in system.components.items():
        if id(component) not in keys:
            keys[id(component)] = component.structure_key()
        key = (keys[id(component)], wired.get(name, frozenset()), kept.get(name, frozenset()))
        groups.setdefault(key, []).append(name)
    types: list[tuple[UnitType, Kernel, str, list[str]]] = []
    for names in groups.values():
        first = names[0]
        unit, kernel = unit_type(system.components[first], wired.get(first, frozenset()), kept.get(first, frozenset()))
        types.append((unit, kernel, "" if cache is None else str(cache.get(kernel.text, unit.name)), names))
    return types

"""Types are compiled once: numbers of instances, parameters and topology never call the compiler again."""

from __future__ import annotations

from pathlib import Path

import pytest

from gustform.language import Component, GustformError, Parameter, Variable
from gustform.language.system import Constant, System
from gustform_codegen.build import build, unit_type
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from tests.unit.codegen.circuits import Follower, IdealSource, Load, Resistor, Storage
from tests.unit.codegen.compiled import INCLUDE


def farm(n: int, *, lines: bool = False, chain: bool = False, **load: float) -> System:
    s = System()
    s.add("source", IdealSource(V=5.0 + n))
    for k in range(n):
        s.add(f"store[{k}]", Storage(R=1.0 + k))
        s.add(f"load[{k}]", Load(**load))
        s.connect(f"store[{k}].pin", f"load[{k}].pin")
        if lines:
            s.add(f"line[{k}]", Resistor(R=0.1))
            s.connect(f"line[{k}].n", f"load[{k}].pin")
            s.connect(f"line[{k}].p", f"load[{k - 1}].pin" if chain and k else "source.pin")
        else:
            s.connect(f"load[{k}].pin", "source.pin")
    return s


@pytest.fixture
def fresh(tmp_path: Path) -> KernelCache:
    return KernelCache(INCLUDE, tmp_path)


def test_no_compilation_after_the_first_build(fresh: KernelCache) -> None:
    assert build(farm(1), fresh).compilations == 3  # source, storage, load
    for n in (1, 10, 100):
        built = build(farm(n), fresh)
        assert built.compilations == 0
        assert built.linked.table.n_instances == 1 + 2 * n
    assert build(farm(10, R=7.5), fresh).compilations == 0  # other parameters
    assert build(farm(5, lines=True), fresh).compilations == 1  # a new type: the line
    assert build(farm(20, lines=True, chain=True), fresh).compilations == 0  # another topology
    assert fresh.compilations == 4
    # Another process would find the same kernels: a new cache object over the folder compiles nothing.
    again = KernelCache(INCLUDE, fresh.folder)
    assert build(farm(3, lines=True, R=1.0), again).compilations == 0


class Order(Component):
    n = Parameter("1", "order", default=1, structural=True)
    T = Parameter("s", "time constant", default=1.0)
    x = Variable("1", "first")
    y = Variable("1", "second")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), -self.x)
        self.eq(self.y if self.n == 1 else self.T * self.der(self.y), self.x)


def test_a_structural_change_compiles_one_type(fresh: KernelCache) -> None:
    def system(order: int, time: float) -> System:
        s = System()
        s.add("a", Order(n=order, T=time))
        s.add("b", Order(n=1, T=time))
        return s

    assert build(system(1, 1.0), fresh).compilations == 1
    built = build(system(2, 1.0), fresh)
    assert built.compilations == 1
    assert [t.names for t in built.linked.types] == [["a"], ["b"]]
    assert build(system(2, 5.0), fresh).compilations == 0
    assert build(system(1, 5.0), fresh).compilations == 0


def test_wiring_an_input_makes_a_type_of_its_own_once(fresh: KernelCache) -> None:
    def system(wired: int) -> System:
        s = System()
        s.add("source", IdealSource())
        s.add("store", Storage())
        s.connect("source.pin", "store.pin")
        for k in range(4):
            s.add(f"f[{k}]", Follower(gain=1.0 + k))
            s.connect(f"f[{k}].pin", "source.pin")
            s.bind(f"f[{k}].bias", Constant(0.0))
            if k < wired:
                s.signal(f"f[{k}].u", "store.v")
            else:
                s.bind(f"f[{k}].u", Constant(1.0))
        return s

    assert build(system(0), fresh).compilations == 3
    assert build(system(1), fresh).compilations == 1
    built = build(system(3), fresh)
    assert built.compilations == 0
    assert [t.names for t in built.linked.types if t.unit.name == "Follower"] == [["f[0]", "f[1]", "f[2]"], ["f[3]"]]


def test_types_are_flattened_once_per_process() -> None:
    first, _ = unit_type(Storage(R=1.0))
    second, _ = unit_type(Storage(R=2.0))
    assert first is second
    assert unit_type(Storage(), keep=frozenset({"soc"}))[0] is not first


def test_an_empty_system_is_refused(fresh: KernelCache) -> None:
    with pytest.raises(GustformError, match="GF3022"):
        build(System(), fresh)


def test_a_system_without_unknowns_can_be_built(fresh: KernelCache) -> None:
    class Still(Component):
        x = Variable("1", "a constant")

        def equations(self) -> None:
            self.eq(self.x, 2)

    s = System()
    s.add("still", Still())
    linked = build(s, fresh).linked
    assert linked.table.n_unknowns == 0
    assert steady_state(linked).table.start.size == 0


def test_one_component_may_stand_for_many_instances(fresh: KernelCache) -> None:
    shared = Load(R=4.0)
    s = System()
    s.add("source", IdealSource())
    for k in range(50):
        s.add(f"load[{k}]", shared)
        s.connect(f"load[{k}].pin", "source.pin")
    s.change(1.0, "load[7].R", 5.0)
    linked = build(s, fresh).linked
    assert linked.types[1].table.parameters[:, 0].tolist() == [4.0] * 50
    assert linked.table.schedule_target.tolist() == [1, 7, 0]
    assert shared.R == 4.0

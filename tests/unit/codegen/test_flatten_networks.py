"""Random linear networks: whatever flattening makes of them, every equation as written still holds, and so does
Kirchhoff's law at every node, counted here and not by the code under test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gustform.interfaces import DcPort
from gustform.language import Component, Part
from gustform_codegen.flatten import flatten
from tests.unit.codegen.circuits import Capacitor, CurrentSource, Ground, Inductor, Resistor, VoltageSource
from tests.unit.codegen.numeric import assert_solves, solved_point

KINDS: dict[str, type[Component]] = {
    "R": Resistor, "C": Capacitor, "L": Inductor, "V": VoltageSource, "I": CurrentSource
}  # fmt: skip


@dataclass(frozen=True)
class Branch:
    """An element from one node to another; node 0 is ground."""

    kind: str
    a: int
    b: int
    value: float


@dataclass(frozen=True)
class Network:
    nodes: int
    branches: tuple[Branch, ...]
    terminals: tuple[int, ...]

    def component(self) -> Component:
        """The network as a unit with one terminal at each of `terminals`."""
        members: dict[str, Any] = {"ground": Part(Ground, "ground")}
        for k, b in enumerate(self.branches):
            value: dict[str, Any] = {b.kind: b.value}  # parameters have the name of their kind
            members[f"b{k}"] = Part(KINDS[b.kind], "a branch", **value)
        for k in range(len(self.terminals)):
            members[f"t{k}"] = DcPort("a terminal")

        def equations(component: Any) -> None:
            meeting: dict[int, list[Any]] = {0: [component.ground.pin]}
            for k, b in enumerate(self.branches):
                element = getattr(component, f"b{k}")
                meeting.setdefault(b.a, []).append(element.p)
                meeting.setdefault(b.b, []).append(element.n)
            for k, node in enumerate(self.terminals):
                meeting[node].append(getattr(component, f"t{k}"))
            for ports in meeting.values():
                for port in ports[1:] or ports:  # a lone end is connected to itself: no flow
                    component.connect(ports[0], port)

        kind: type[Component] = type("Case", (Component,), {**members, "equations": equations})
        return kind()


values = st.floats(0.5, 4.0)


@st.composite
def networks(draw: st.DrawFn, alone: bool = False) -> Network:
    """A tree of resistors from ground to every node, so that all is determined; at each node at most one element
    that holds a voltage (capacitor or source, to ground); further resistors, inductors and current sources anywhere.
    `alone`: without terminals."""
    nodes = draw(st.integers(2, 5))
    branches = [Branch("R", draw(st.integers(0, k - 1)), k, draw(values)) for k in range(1, nodes)]
    for node in range(1, nodes):
        holder = draw(st.sampled_from(["", "", "C", "V"]))
        if holder:
            branches.append(Branch(holder, node, 0, draw(values)))
    for kind in draw(st.lists(st.sampled_from("RLI"), max_size=4)):
        a, b = draw(st.tuples(st.integers(0, nodes - 1), st.integers(0, nodes - 1)).filter(lambda e: e[0] != e[1]))
        branches.append(Branch(kind, a, b, draw(values)))
    free = [n for n in range(1, nodes) if not any(b.kind in "CV" and b.a == n for b in branches)]
    terminals = draw(st.lists(st.sampled_from(free), max_size=2, unique=True)) if free and not alone else []
    return Network(nodes, tuple(draw(st.permutations(branches))), tuple(terminals))


@settings(max_examples=40)
@given(networks(), st.integers(0, 10))
def test_random_networks_hold(network: Network, seed: int) -> None:
    component = network.component()
    unit = flatten(component)
    assert len(unit.rows) == len(unit.unknowns)
    assert unit.n_states == sum(b.kind in "CL" for b in network.branches)
    point = solved_point(unit, component, seed)
    # Potentials are of order 1 to 100 V here and resistances not below 0.5 ohm: 1e-7 leaves room for the condition.
    assert_solves(component, point, 1e-7)
    current = [0.0] * network.nodes
    for k, b in enumerate(network.branches):
        current[b.a] += point[f"b{k}.p.i"]
        current[b.b] += point[f"b{k}.n.i"]
        assert point[f"b{k}.p.v"] - point[f"b{k}.n.v"] == pytest.approx(point[f"b{k}.v"], abs=1e-7)
    for k, node in enumerate(network.terminals):
        current[node] -= point[f"t{k}.i"]  # what flows into the unit there is fed to the node
        assert any(
            point[f"b{j}.{'p' if b.a == node else 'n'}.v"] == pytest.approx(point[f"t{k}.v"], abs=1e-9)
            for j, b in enumerate(network.branches)
            if node in (b.a, b.b)
        )
    assert point["ground.pin.v"] == 0.0
    assert current[0] + point["ground.pin.i"] == pytest.approx(0.0, abs=1e-7)
    assert current[1:] == pytest.approx([0.0] * (network.nodes - 1), abs=1e-7)


def test_a_bridge_by_nodal_analysis() -> None:
    """A Wheatstone bridge out of balance, against the nodal equations solved by hand."""
    network = Network(
        4,
        (
            Branch("R", 3, 1, 1.0),
            Branch("R", 3, 2, 2.0),
            Branch("R", 1, 0, 3.0),
            Branch("R", 2, 0, 1.0),
            Branch("R", 1, 2, 5.0),
        ),
        (3,),
    )
    component = network.component()
    point = solved_point(flatten(component), component, given={"t0.v": 10.0})
    # G v = i for nodes 1, 2 with node 3 at 10 V:
    # (1/1 + 1/3 + 1/5) v1 - v2/5 = 10/1;  -v1/5 + (1/2 + 1/1 + 1/5) v2 = 10/2.
    determinant = (23 / 15) * (17 / 10) - 1 / 25
    v1 = (10 * 17 / 10 + 5 / 5) / determinant
    v2 = (5 * 23 / 15 + 10 / 5) / determinant
    assert point["b4.p.v"] == pytest.approx(v1, rel=1e-9)
    assert point["b4.n.v"] == pytest.approx(v2, rel=1e-9)
    assert point["t0.i"] == pytest.approx((10 - v1) / 1 + (10 - v2) / 2, rel=1e-9)

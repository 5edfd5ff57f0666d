"""The same random network twice: flattened as one unit, and linked from one unit for each element. Potentials and
derivatives must agree, although nothing but the elements' equations is common to the two ways."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gustform.interfaces import DcPort
from gustform.language import Component
from gustform.language.system import System
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.flatten import flatten
from gustform_codegen.link import Linked
from tests.unit.codegen.assembled import Array, Assembled
from tests.unit.codegen.circuits import Ground
from tests.unit.codegen.compiled import INCLUDE
from tests.unit.codegen.numeric import solved_point
from tests.unit.codegen.test_flatten_networks import KINDS, Network, networks


class End(Component):
    """What hangs at the end of a branch where nothing else does."""

    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.pin.i, 0)


def as_system(network: Network) -> System:
    s = System()
    s.add("ground", Ground())
    hub = {0: "ground.pin"}
    ends = [b.a for b in network.branches] + [b.b for b in network.branches]
    for node in range(1, network.nodes):
        if ends.count(node) == 1:
            s.add(f"end{node}", End())
            hub[node] = f"end{node}.pin"
    for k, b in enumerate(network.branches):
        s.add(f"b{k}", KINDS[b.kind](**{b.kind: b.value}))
        for node, pin in ((b.a, f"b{k}.p"), (b.b, f"b{k}.n")):
            if node in hub:
                s.connect(hub[node], pin)
            hub.setdefault(node, pin)
    return s


def algebraic_and_derivatives(linked: Linked, y: Array) -> tuple[Array, Array]:
    """With the states in y kept, the algebraic unknowns and the derivatives that satisfy the linear system."""
    assembled = Assembled(linked)
    zero = np.zeros(assembled.n)
    states = linked.table.differential.astype(bool)
    still = np.where(states, y, 0.0)
    plain = assembled.jacobian(still, zero, 0.0)
    by_derivative = assembled.jacobian(still, zero, 1.0) - plain
    matrix = np.where(states[None, :], by_derivative, plain)
    found = np.linalg.solve(matrix, -assembled.residual(still, zero))
    return np.where(states, y, found), np.where(states, found, 0.0)


def _same_node(linked: Linked) -> dict[str, str]:
    """The name of the shared unknown of every port's potential."""
    first = linked.table.n_unknowns - len(linked.shared_names)
    return {path: linked.shared_names[index - first] for path, index in linked.shared.items()}


@settings(max_examples=15)
@given(network=networks(alone=True), seed=st.integers(0, 5))
def test_flattening_and_linking_agree(network: Network, seed: int, cache_folder: Path) -> None:
    component = network.component()
    point = solved_point(flatten(component), component, seed)
    linked = build(as_system(network), KernelCache(INCLUDE, cache_folder)).linked
    names = [linked.unknown_name(k) for k in range(linked.table.n_unknowns)]
    # The end of a branch has the potential of the branch there.
    other = {hub: path for path, hub in _same_node(linked).items() if not path.startswith("end")}
    names = [other[name] if name.startswith("end") else name for name in names]
    y = np.array([point[name] for name in names])  # of which only the states are used
    found, derivative = algebraic_and_derivatives(linked, y)
    for name, value, slope, is_state in zip(names, found, derivative, linked.table.differential, strict=True):
        assert value == pytest.approx(point[name], rel=1e-6, abs=1e-7), name
        if is_state:
            assert slope == pytest.approx(point[f"der({name})"], rel=1e-6, abs=1e-7), name

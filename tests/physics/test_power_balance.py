"""Power at every connector, outside and inside the units: what flows out of one flows into the others."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.line import Line
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.transformer import Transformer
from gustform.language.scope import elaborate
from gustform.language.system import Constant, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.cache import KernelCache
from tests.physics.running import Ready, ready

Array = NDArray[np.float64]
Channels = dict[str, Array]
Terms = dict[str, tuple[tuple[str, str, int], ...]]  # of a power: (potential, flow, sign), by connector type
Port = tuple[str, str, int]  # path, connector type, sign of its flows in the sum

S_N = 210e6  # VA
TOLERANCE = 1e-9  # of the plant's rating, in the unit of the connector
# Active (or the only) power from potentials and flows, and the reactive power where there is one.
ACTIVE: Terms = {
    "AcPort": (("vr", "ir", 1), ("vi", "ii", 1)),
    "DqPort": (("vd", "id", 1), ("vq", "iq", 1)),
    "DcPort": (("v", "i", 1),),
    "Shaft": (("w", "tau", 1),),
}
REACTIVE: Terms = {
    "AcPort": (("vi", "ir", 1), ("vr", "ii", -1)),
    "DqPort": (("vq", "id", 1), ("vd", "iq", -1)),
}


def radial_system(fidelity: str) -> System:
    """A plant, turbines and a load at one bus; a line and a transformer lead to loads on two others."""
    s = System()
    s.add("bus", Bus())
    s.add("sg", SynchronousGenerator(rating=S_N))
    s.add("wt", PmsgTurbine(aggregate=10, wind_speed=10.0, curtailment=0.1, fidelity=fidelity))
    s.add("load", ConstantPowerLoad(active=70e6, reactive=5e6))
    s.add("line", Line(R=0.2, X=0.9))
    s.add("far", Bus())
    s.add("far_load", ConstantPowerLoad(active=20e6, reactive=4e6))
    s.add("transformer", Transformer(rating=20e6, voltage_primary=33e3, voltage_secondary=11e3, r=0.01, x=0.08))
    s.add("low", Bus(voltage=11e3))
    s.add("low_load", ConstantPowerLoad(voltage=11e3, active=10e6, reactive=2e6))
    for pair in (
        ("sg.terminal", "bus.terminal"), ("wt.grid", "bus.terminal"), ("load.terminal", "bus.terminal"),
        ("line.sending", "bus.terminal"), ("line.receiving", "far.terminal"), ("far_load.terminal", "far.terminal"),
        ("transformer.primary", "far.terminal"), ("transformer.secondary", "low.terminal"),
        ("low_load.terminal", "low.terminal"),
    ):  # fmt: skip
        s.connect(*pair)
    s.frame("sg.omega")
    s.bind("wt.wind", Constant(10.0))
    s.change(1.0, "load.active", 90e6)
    return s


def joined(pairs: Iterable[tuple[Port, Port]]) -> list[list[Port]]:
    """Ports that are connected with each other, directly or through others."""
    groups: list[list[Port]] = []
    for pair in pairs:
        touched = [g for g in groups if pair[0] in g or pair[1] in g]
        groups = [g for g in groups if g not in touched]
        groups.append(list(dict.fromkeys([*(port for g in touched for port in g), *pair])))
    return groups


def connections(plant: Ready) -> list[list[Port]]:
    """The ports of every connection, of units and inside them."""
    system = plant.linked.system

    def outside(path: str) -> Port:
        return path, type(system.port(path)).__name__, 1

    found = joined((outside(a), outside(b)) for a, b in system.connections)
    for name, component in system.components.items():
        pairs = []
        for a, b, at, _ in elaborate(component).connections:
            # a component's own port hands on to its parts what flows into it
            one, other = (
                (f"{name}.{p.path}", type(p.connector).__name__, -1 if p.path.rpartition(".")[0] == at else 1)
                for p in (a, b)
            )
            pairs.append((one, other))
        found += joined(pairs)
    return found


def everything(plant: Ready, times: Array, **options: float) -> Channels:
    """All variables by name, those known under another name as well."""
    channels, aliases = plant.linked.select(["*"])
    found = plant.follow([c.name for c in channels], times, **options)
    return found | {name: sign * found[target] for name, (target, sign) in aliases.items()}


def power(values: Channels, ports: Iterable[Port], terms: Terms) -> Array:
    """What flows into all the ports together."""
    parts = [
        side * sign * values[f"{path}.{potential}"] * values[f"{path}.{flow}"]
        for path, kind, side in ports
        for potential, flow, sign in terms[kind]
    ]
    return np.asarray(np.sum(parts, axis=0))


def audit(plant: Ready, values: Channels) -> None:
    """Every connector in balance, and every unit that stores nothing loses what its resistance takes."""
    groups = connections(plant)
    assert {kind for group in groups for _, kind, _ in group} == set(ACTIVE)
    for group in groups:
        kind = group[0][1]
        base = 1.0 if kind == "DqPort" else S_N
        for terms in (ACTIVE, REACTIVE):
            if kind in terms:
                assert np.max(np.abs(power(values, group, terms))) < TOLERANCE * base, group
    active = {
        path: power(values, [(path, "AcPort", 1)], ACTIVE)
        for path in ("sg.terminal", "wt.grid", "load.terminal", "far_load.terminal", "low_load.terminal",
                     "line.sending", "line.receiving", "transformer.primary", "transformer.secondary")
    }  # fmt: skip
    square = values["line.sending.ir"] ** 2 + values["line.sending.ii"] ** 2
    lost = {
        "line": active["line.sending"] + active["line.receiving"] - 0.2 * square,
        "transformer": active["transformer.primary"] + active["transformer.secondary"]
        - 0.01 * 11e3**2 / 20e6 * (values["transformer.secondary.ir"] ** 2 + values["transformer.secondary.ii"] ** 2),
        # the machine: what the turbine gives, less what the rotor takes up and the stator loses
        "sg": active["sg.terminal"] + S_N * (
            values["sg.P_m"] - 12.0 * values["sg.omega"] * values["yp"][:, plant.numbers["sg.machine.omega"]]
            - 0.003 * (values["sg.machine.i_d"] ** 2 + values["sg.machine.i_q"] ** 2)
        ),
    }  # fmt: skip
    for name, wrong in lost.items():
        assert np.max(np.abs(wrong)) < TOLERANCE * S_N, name


@pytest.fixture(scope="module", params=["lossless", "rms", "dq"])
def plant(request: pytest.FixtureRequest, cache: KernelCache) -> Ready:
    """The turbine in each fidelity."""
    return ready(radial_system(request.param), cache)


def test_every_connector_is_in_balance_at_random_states(plant: Ready) -> None:
    rng = np.random.default_rng(11)
    names = {k: name for name, k in plant.numbers.items()}
    states = np.flatnonzero(plant.table.differential)
    for _ in range(20):
        # 2 % of each state and of its nominal value; the start of the run then solves for the voltages
        size = 0.02 * (np.abs(plant.table.start[states]) + plant.table.nominal[states])
        shift = size * rng.uniform(-1.0, 1.0, states.size)
        moved = plant.moved({names[int(k)]: float(by) for k, by in zip(states, shift, strict=True)})
        audit(moved, everything(moved, np.array([0.0]), rtol=1e-10))


def test_every_connector_stays_in_balance_along_a_run(plant: Ready) -> None:
    # rtol 2e-11: between steps the solver interpolates, and the network's equations hold to its tolerance only
    audit(plant, everything(plant, np.linspace(0.0, 10.0, 101), rtol=2e-11))

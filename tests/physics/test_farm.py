"""A small farm of unlike turbines behind cables and a transformer: nothing gets lost on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gustform.aero.table_rotor import TableRotor
from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.line import Line
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.transformer import Transformer
from gustform.language.system import Constant, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_runtime import Simulation
from tests.components.systems import sampled_table

WINDS = [6.0, 8.0, 10.0, 11.2, 12.5]  # m/s: below, around and above the speed limit and rated wind


def farm() -> System:
    s = System()
    s.add("bus", Bus(voltage=110e3))
    s.add("sg", SynchronousGenerator(rating=60e6, voltage=110e3))
    s.add("load", ConstantPowerLoad(voltage=110e3, active=30e6, reactive=3e6))
    s.add("collector", Bus(voltage=33e3))
    s.add("transformer", Transformer(rating=40e6, voltage_primary=33e3, voltage_secondary=110e3, r=0.003, x=0.12))
    for pair in (
        ("sg.terminal", "bus.terminal"), ("load.terminal", "bus.terminal"),
        ("transformer.primary", "collector.terminal"), ("transformer.secondary", "bus.terminal"),
    ):  # fmt: skip
        s.connect(*pair)
    table = sampled_table()
    for k, wind in enumerate(WINDS, start=1):
        rotor = TableRotor(cp=table)
        parts = {"rotor": rotor} if k % 2 else {}
        s.add(f"wt[{k}]", PmsgTurbine(wind_speed=wind, curtailment=0.1, **parts))
        s.add(f"cable[{k}]", Line(R=0.1 * k, X=0.2 * k))
        s.add(f"foot[{k}]", Bus(voltage=33e3))
        s.connect(f"wt[{k}].grid", f"foot[{k}].terminal")
        s.connect(f"cable[{k}].sending", f"foot[{k}].terminal")
        s.connect(f"cable[{k}].receiving", "collector.terminal")
        s.bind(f"wt[{k}].wind", Constant(wind))
    s.frame("sg.omega")
    return s


def test_farm_stands_still_and_its_powers_add_up(cache: KernelCache) -> None:
    built = build(farm(), cache)
    # bus, plant, load, transformer, line, and a turbine for each of the two rotors
    assert len(built.linked.types) == 7
    steady = steady_state(built.linked)
    channels, _ = built.linked.select(["sg.P", "load.P", "wt[*].P", "wt[*].P_wt", "sg.frequency"])
    rows: list[np.ndarray[tuple[int, int], np.dtype[np.float32]]] = []
    with Simulation(replace(steady.table, channels=channels).to_bytes()) as simulation:
        simulation.set_option("rtol", 1e-8)
        simulation.set_sink(1.0, lambda _time, values: rows.append(values))
        simulation.initialise(0.0)
        simulation.advance(20.0)
        _, y, _ = simulation.state()
    np.testing.assert_array_less(np.abs(y - steady.table.start) / steady.table.nominal, 1e-6)
    names = [c.name for c in channels]
    found = dict(zip(names, (float(v) for v in np.concatenate(rows)[-1]), strict=True))
    turbines = [found[f"wt[{k}].P"] for k in range(1, len(WINDS) + 1)]
    losses = found["sg.P"] + sum(turbines) - found["load.P"]
    assert 0.0 < losses < 0.03 * found["load.P"]
    for k, wind in enumerate(WINDS, start=1):
        # in equilibrium what the wind gives reaches the port but for the losses in filter and line
        assert found[f"wt[{k}].P_wt"] == pytest.approx(
            PmsgTurbine(wind_speed=wind, curtailment=0.1).operating_point().power, rel=2e-3
        )
        assert 0.98 < found[f"wt[{k}].P"] / (5e6 * found[f"wt[{k}].P_wt"]) < 1.0

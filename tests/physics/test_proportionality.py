"""What dual-port control promises of a steady state: deviations of frequency, DC voltage and speed in proportion."""

from __future__ import annotations

import pytest

from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_runtime import Simulation
from tests.physics import paper_system as mine

SETTLED = 1500.0  # s; the slowest mode, 0.017 /s at 8 m/s, has fallen to 1e-9 of the step by then
WITHIN = 1e-6  # pu, the issue's


@pytest.mark.parametrize("wind", [8.0, 10.0, 12.0])
@pytest.mark.parametrize("curtailment", [0.0, 0.1])
def test_deviations_are_in_proportion(wind: float, curtailment: float, cache: KernelCache) -> None:
    system = mine.paper_system(wind, curtailment)
    linked = build(system, cache).linked
    names = ["sg.machine.omega", "wt.omega_gsc", "wt.v_dc", "wt.omega_r"]
    channels, _ = linked.select(names)
    table = steady_state(linked).table.with_channels(channels)
    with Simulation(table.to_bytes()) as simulation:
        simulation.set_option("rtol", 1e-8)
        simulation.initialise(0.0)
        simulation.advance(SETTLED)
        _, y, _ = simulation.state()
    numbers = mine.unknown_numbers(linked)
    turbine = system.components["wt"]
    omega_sg = y[numbers["sg.machine.omega"]]
    v_dc = y[numbers["wt.dc_link.v"]] / 7920.0
    omega_r = y[numbers["wt.drive.w"]] / turbine.value("omega_base")
    xi = y[numbers["wt.control.gsc.xi"]]
    control = turbine.part("control")
    K_gsc, K_msc = control.value("K_gsc"), turbine.value("K_msc")
    omega_gsc = 1.0 + K_gsc * xi + control.value("K_d_gsc") / control.value("T_dc") * (v_dc - 1.0 - xi)
    assert abs(omega_sg - 1.0) > 4e-3  # a load step of 20 MW with a droop of 5 % and a dead band: it did move
    assert omega_gsc == pytest.approx(omega_sg, abs=WITHIN)
    assert v_dc - 1.0 == pytest.approx((omega_sg - 1.0) / K_gsc, abs=WITHIN)
    assert omega_r - turbine.value("omega_del") == pytest.approx(K_msc * (v_dc - 1.0), abs=WITHIN)

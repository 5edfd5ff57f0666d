"""The linearised paper system against the hand-written reference, finite differences of the kernels, and a run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from gustform.analysis import theorem
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_codegen.linear import Lineariser, LinearSystem
from gustform_codegen.link import Linked
from gustform_codegen.modes import NEUTRAL, REFERENCE, STABLE, Modes, modes
from gustform_codegen.table import SystemTable
from gustform_runtime import Simulation
from tests.physics import paper_system as mine
from tests.reference import paper_rms as ref
from tests.unit.codegen.assembled import Assembled

Array = NDArray[np.float64]


def start(wind: float, cache: KernelCache, curtailment: float = 0.1) -> tuple[Linked, SystemTable]:
    linked = build(mine.paper_system(wind, curtailment), cache).linked
    return linked, steady_state(linked).table


def linear(linked: Linked, table: SystemTable, *channels: str) -> LinearSystem:
    return Lineariser(linked, None, linked.select(channels)[0] if channels else ()).at(table)


def matched(found: NDArray[Any], expected: NDArray[Any]) -> float:
    """Largest relative distance between two sets of eigenvalues, taken one by one."""
    assert found.size == expected.size
    left = list(expected)
    worst = 0.0
    for value in found:
        k = int(np.argmin([abs(value - other) for other in left]))
        worst = max(worst, abs(value - left[k]) / max(abs(left[k]), 1.0))
        del left[k]
    return worst


@pytest.mark.parametrize("wind", [8.0, 10.0, 12.0])
def test_eigenvalues_equal_the_reference(wind: float, cache: KernelCache) -> None:
    found = modes(linear(*start(wind, cache)))
    dae = ref.flat_dae(ref.steady_state(ref.operating_point(wind)))
    expected = np.linalg.eigvals(ref.Explicit(dae).jacobian(dae.x0, wind, ref.LOAD_P))
    # the generator's angle is no state of the reference: its eigenvalue 0 is ours alone
    assert found.kinds.count(REFERENCE) == 1
    own = found.eigenvalues[[kind != REFERENCE for kind in found.kinds]]
    assert matched(own, expected) < 1e-6
    assert found.kinds.count(STABLE) == 21
    slowest = {8.0: -0.017, 10.0: -0.135, 12.0: -0.135}[wind]  # tests/reference/README.md
    assert found.rightmost.real == pytest.approx(slowest, abs=5e-4)


def differences(linked: Linked, table: SystemTable) -> tuple[Array, Array]:
    """F_y and F_y' by central differences of the compiled residual, steps in shares of nominal."""
    assembled = Assembled(linked, table)
    n, y, yp = table.n_unknowns, table.start, table.start_derivative
    F_y, F_yp = np.zeros((n, n)), np.zeros((n, n))
    for k in range(n):
        step = np.zeros(n)
        step[k] = 1e-5 * table.nominal[k]
        F_y[:, k] = (assembled.residual(y + step, yp) - assembled.residual(y - step, yp)) / (2.0 * step[k])
        F_yp[:, k] = (assembled.residual(y, yp + step) - assembled.residual(y, yp - step)) / (2.0 * step[k])
    return F_y, F_yp


def test_matrix_equals_finite_differences_of_the_kernels(cache: KernelCache) -> None:
    linked, table = start(8.0, cache)
    system = linear(linked, table)
    F_y, F_yp = differences(linked, table)
    x = table.differential != 0
    A = -np.linalg.solve(np.where(x, F_yp, F_y), F_y[:, x])[x]
    scaled, expected = (m * system.nominal / system.nominal[:, None] for m in (system.A, A))
    # h^2 = 1e-10 of nominal times the third derivative, and round-off 1e-16/1e-5 of rates up to 1e4 /s
    np.testing.assert_allclose(scaled, expected, atol=1e-6 * np.max(np.abs(expected)))
    assert matched(np.linalg.eigvals(system.A), np.linalg.eigvals(A)) < 1e-4


def test_a_small_load_step_runs_as_the_linear_system_says(cache: KernelCache) -> None:
    """B, C and D: 100 kW more, far inside the dead band, for 5 s."""
    s = mine.paper_system(8.0)  # at 10 m/s the speed limiter stands at its bend
    extra = 1e5  # W of 100 MW
    s.schedule.clear()
    s.change(0.5, "load.active", ref.LOAD_P + extra)
    linked = build(s, cache).linked
    names = ["sg.frequency", "wt.P_gsc", "bus.V", "wt.v_dc"]
    channels, _ = linked.select(names)
    table = replace(steady_state(linked).table, channels=channels)
    system = Lineariser(linked, ["load.active"], channels).at(table)
    times: list[Array] = []
    rows: list[NDArray[np.float32]] = []

    def keep(time: Array, values: NDArray[np.float32]) -> None:
        times.append(time)
        rows.append(values)

    with Simulation(table.to_bytes()) as simulation:
        simulation.set_option("rtol", 1e-10)
        simulation.set_option("atol", 1e-12)
        simulation.set_sink(0.05, keep)
        simulation.initialise(0.0)
        simulation.advance(5.5)
    time, values = np.concatenate(times), np.concatenate(rows).astype(float)
    n = len(system.states)
    whole = np.zeros((n + 1, n + 1))  # with the constant input as a state
    whole[:n, :n], whole[:n, n] = system.A, system.B[:, 0] * extra
    for k, channel in enumerate(channels):
        moved = np.zeros(time.size)
        for i, t in enumerate(time):
            if t > 0.5 + 1e-9:
                x = expm(whole * (t - 0.5))[:n, n]
                moved[i] = system.C[k] @ x + system.D[k, 0] * extra
        run = values[:, k] - system.y0[k]
        largest = np.max(np.abs(moved))
        # float32 rows: 6e-8 of the value itself; curvature: the square of the step
        tolerance = 0.01 * largest + 1.2e-7 * np.max(np.abs(values[:, k]))
        assert np.max(np.abs(run - moved)[time > 0.5 + 1e-9]) < tolerance, channel.name
        assert largest > 3.0 * tolerance, f"{channel.name}: the step is lost in float32"


def test_the_dead_band_makes_the_frequency_neutral_at_maximum_power(cache: KernelCache) -> None:
    """Without a reserve nothing answers to the frequency inside the governor's dead band; it is said so."""
    system = linear(*start(8.0, cache, curtailment=0.0))
    found = modes(system)
    governor = [limiter for limiter in system.flats if "sg.machine.omega" in limiter.unknowns]
    assert [limiter.instances for limiter in governor] == [["sg"]]
    # the slope of the power at the tip of Cp is zero but for what the operating point is solved to
    neutral = min((m for m in found.listed if m.kind != REFERENCE), key=lambda m: abs(m.eigenvalue))
    assert abs(neutral.eigenvalue) < 1e-6
    assert {name for name, _ in neutral.participation[:2]} == {"sg.machine.omega", "wt.drive.w"}


def matched_mode(full: Modes, value: complex) -> complex:
    return complex(full.eigenvalues[np.argmin(np.abs(full.eigenvalues - value))])


def test_the_lossless_system_has_the_eigenvalues_of_the_theorem(cache: KernelCache) -> None:
    """The linked system in the paper's own fidelity, without the droops of the voltages, against the 6 x 6 matrix.

    What is left between them is the load at the bus in between, some 0.25 % of the swing's frequency, and power over
    speed instead of power: the slow mode 0.1 %.
    """
    s = mine.paper_system(8.0)
    turbine = PmsgTurbine(
        aggregate=10, wind_speed=8.0, curtailment=0.1, fidelity="lossless", control={"K_q_gsc": 0.0, "K_q_msc": 0.0}
    )
    generator = SynchronousGenerator(rating=ref.S_SG, fidelity="lossless")
    s.components |= {"wt": turbine, "sg": generator}
    linked = build(s, cache).linked
    full = modes(linear(linked, steady_state(linked).table))
    assert full.stable
    simple = theorem.eigenvalues(theorem.of_components(turbine, generator))
    for value in simple:
        other = matched_mode(full, value)
        assert abs(other - value) < 3e-3 * abs(value)
        # the swing's damping, a thousandth of its frequency, is the theorem's too
        assert other.real == pytest.approx(value.real, rel=0.01)


def test_the_sixth_order_system_keeps_the_converter_modes_of_the_theorem(cache: KernelCache) -> None:
    """rms with governor set B: the DC link's mode is the same within 2 %, the swing's frequency within 5 %; the damping
    of the swing is another, because the generator's windings give most of it."""
    s = mine.paper_system(8.0)
    data: dict[str, dict[str, float]] = {
        "governor": {"half_dead_band": 0.0, "T1": 0.3, "T2": 2.5, "T3": 8.4, "droop": 0.0613},
        "machine": {"H": 8.0},
    }
    generator = SynchronousGenerator(rating=ref.S_SG, **data)
    s.components["sg"] = generator
    linked = build(s, cache).linked
    turbine = s.components["wt"]
    assert isinstance(turbine, PmsgTurbine)
    full = modes(linear(linked, steady_state(linked).table))
    assert full.stable
    assert NEUTRAL not in full.kinds
    simple = theorem.eigenvalues(theorem.of_components(turbine, generator), 0.002)
    dc_link = simple[np.argmin(np.abs(simple - (-94.0 + 98.0j)))]
    assert abs(matched_mode(full, dc_link) - dc_link) < 0.02 * abs(dc_link)
    swing = simple[np.argmin(np.abs(simple - 4.1j))]
    found = min(full.listed, key=lambda m: abs(m.eigenvalue - swing))
    assert found.eigenvalue.imag == pytest.approx(swing.imag, rel=0.05)
    assert found.damping is not None
    assert found.damping > 0.05
    assert {name for name, _ in found.participation[:2]} == {"wt.gsc.theta", "sg.machine.omega"}

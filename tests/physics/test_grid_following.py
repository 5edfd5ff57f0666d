"""The paper's system with grid-following turbines: published figures, maximum power point, PLL."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform.control.grid_following import GridFollowing
from gustform.language.system import Constant, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.cache import KernelCache
from tests.components.systems import with_turbine
from tests.physics import paper_system as mine
from tests.physics.running import ready

Array = NDArray[np.float64]
CHANNELS = ("sg.frequency", "wt.frequency", "wt.v_dc", "wt.omega_r", "wt.beta", "wt.P_gsc", "wt.P_wt", "wt.Q_gsc")
TIMES = np.concatenate([np.arange(0.0, 29.0, 5.0), np.arange(29.9, 40.0, 0.02), np.arange(40.0, 90.5, 1.0)])


def system(wind: float, curtailment: float = 0.0) -> System:
    s = mine.paper_system(wind, curtailment)
    turbine = PmsgTurbine(aggregate=10, wind_speed=wind, curtailment=curtailment, control=GridFollowing())
    s.components["wt"] = turbine
    return s


@pytest.mark.parametrize("wind", [8.0, 10.0, 12.0])
def test_published_figures(wind: float, cache: KernelCache) -> None:
    at_rest = ready(system(wind), cache)
    assert set(at_rest.free) == {"sg.governor.P_ref", "sg.exciter.V_ref"}  # nothing to find in the turbine
    run = at_rest.follow(CHANNELS, TIMES, rtol=1e-6)
    before = TIMES < 30.0
    # held: 1e-6 of nominal
    for name in ("wt.v_dc", "wt.omega_r", "wt.P_gsc"):
        assert np.ptp(run[name][before]) < 1e-6, name
    assert np.max(np.abs(run["sg.frequency"][before] - 50.0)) < 50e-6
    # published at 8 m/s: 49.397 Hz within 5 mHz, 49.709 Hz after 60 s within 3 mHz; the turbines give constant power,
    # so it is the same in any wind
    assert np.min(run["sg.frequency"]) == pytest.approx(49.397, abs=0.005)
    assert run["sg.frequency"][-1] == pytest.approx(49.709, abs=0.003)
    # the DC voltage stays, and the maximum power point with it
    assert np.max(np.abs(run["wt.v_dc"] - 1.0)) < 1e-3
    point = PmsgTurbine(wind_speed=wind).operating_point()
    assert run["wt.omega_r"][-1] == pytest.approx(point.omega_mpp, abs=1e-6)
    assert run["wt.beta"][-1] == pytest.approx(point.beta_mpp, abs=1e-4)  # deg
    assert run["wt.P_wt"][-1] == pytest.approx(point.power, abs=1e-6)
    assert run["wt.Q_gsc"][-1] == pytest.approx(0.0, abs=1e-6)
    # the PLL is with the grid again
    assert run["wt.frequency"][-1] == pytest.approx(run["sg.frequency"][-1], abs=1e-4)
    # and follows the fall of the frequency, 0.4 Hz/s at most
    falling = (TIMES > 30.3) & (TIMES < 33.0)
    assert np.max(np.abs(run["wt.frequency"] - run["sg.frequency"])[falling]) < 0.02


@pytest.mark.parametrize(("wind", "curtailment"), [(8.0, 0.1), (10.0, 0.1), (12.0, 0.1), (4.0, 0.0), (15.0, 0.0)])
def test_holds_the_operating_point(wind: float, curtailment: float, cache: KernelCache) -> None:
    run = ready(system(wind, curtailment), cache).follow(CHANNELS, TIMES, rtol=1e-6)
    point = PmsgTurbine(wind_speed=wind, curtailment=curtailment).operating_point()
    assert run["wt.omega_r"] == pytest.approx(np.full(TIMES.size, point.omega_del), abs=1e-5)
    assert run["wt.beta"] == pytest.approx(np.full(TIMES.size, point.beta_del), abs=1e-3)
    assert run["wt.P_wt"][-1] == pytest.approx(point.power, abs=1e-5)


def in_wind(point: float, wind: float, cache: KernelCache) -> dict[str, Array]:
    """A turbine at rest in one wind, followed in another."""
    s = with_turbine(PmsgTurbine(aggregate=10, wind_speed=point, control=GridFollowing()))
    s.inputs["wt.wind"] = Constant(point)
    at_rest = ready(s, cache)
    at_rest.table.input_value[at_rest.table.input_value == point] = wind
    return at_rest.follow(CHANNELS[2:], np.array([0.0, 150.0]), rtol=1e-6)


# Slowest mode of the rotor: 2 H omega d(omega)/dt at 7 m/s, 0.13 /s, so 150 s are 20 time constants.
@pytest.mark.parametrize("wind", [7.0, 9.5])
def test_finds_the_maximum_power_point_of_another_wind(wind: float, cache: KernelCache) -> None:
    run = in_wind(8.0, wind, cache)
    point = PmsgTurbine(wind_speed=wind).operating_point()
    assert run["wt.omega_r"][-1] == pytest.approx(point.omega_mpp, abs=1e-4)
    assert run["wt.P_wt"][-1] == pytest.approx(point.power, abs=1e-6)  # flat at its maximum


def test_pitch_above_rated_wind_is_no_part_of_the_schedule(cache: KernelCache) -> None:
    """From the pitch for 12 m/s back to none at 9 m/s, and up to that for 14 m/s."""
    low = in_wind(12.0, 9.0, cache)
    assert low["wt.beta"][-1] == pytest.approx(0.0, abs=1e-6)
    assert low["wt.P_wt"][-1] == pytest.approx(PmsgTurbine(wind_speed=9.0).operating_point().power, abs=1e-5)
    high = in_wind(12.0, 14.0, cache)
    point = PmsgTurbine(wind_speed=14.0).operating_point()
    assert high["wt.beta"][-1] == pytest.approx(point.beta_mpp, abs=1e-3)
    assert high["wt.P_wt"][-1] == pytest.approx(1.0, abs=1e-5)


def test_machine_in_its_own_frame(cache: KernelCache) -> None:
    """Power and voltage of the machine at rest against phasors: E = j omega psi, v = E - j omega L i, i = j i_q."""
    names = ["wt.omega_r", "wt.P_pmsg", "wt.Q_msc", "wt.P_wt", "wt.pmsg.i_q", "wt.pmsg.i_d"]
    names += ["wt.pmsg.terminal.vr", "wt.pmsg.terminal.vi"]
    run = {name: values[0] for name, values in ready(system(10.0), cache).follow(names, np.array([0.0])).items()}
    omega, i = run["wt.omega_r"], 1j * run["wt.pmsg.i_q"]
    v = 1j * omega / 1.2 - 1j * omega * 0.4 / 1.2 * i  # psi = 1/1.2, L = 0.4/1.2: project notes
    assert run["wt.pmsg.i_d"] == 0.0
    assert complex(run["wt.pmsg.terminal.vr"], run["wt.pmsg.terminal.vi"]) / 3.3e3 == pytest.approx(v, rel=1e-9)
    assert run["wt.P_pmsg"] == pytest.approx((v * i.conjugate()).real, rel=1e-9)
    assert run["wt.Q_msc"] == pytest.approx(-(v * i.conjugate()).imag, rel=1e-9)
    assert run["wt.P_pmsg"] == pytest.approx(run["wt.P_wt"], rel=1e-7)  # no losses


def test_reactive_power_goes_to_its_set_point(cache: KernelCache) -> None:
    control = GridFollowing(Q_ref=0.1)
    s = with_turbine(PmsgTurbine(aggregate=10, wind_speed=9.0, control=control))
    run = ready(s, cache).follow(["wt.Q_gsc", "wt.P_gsc"], np.array([0.0]))
    assert run["wt.Q_gsc"][0] == pytest.approx(0.1, abs=1e-6)

"""The looked-up operating point in a running turbine: ramp, step of curtailment, turbulence."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform.aero.cp_solver import cp_solver
from gustform.aero.table_rotor import TableRotor
from gustform.control.curtailment_schedule import CurtailmentSchedule, default_table, pitch_table, speed_table
from gustform.control.operating_point import OperatingPoint, operating_point, power_at
from gustform.electrical.bus import Bus
from gustform.electrical.stiff_grid import StiffGrid
from gustform.language import Component
from gustform.language.errors import GustformError
from gustform.language.system import Constant, Series, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.wind.kaimal import Kaimal, length_scale, standard_deviation
from gustform_cli.wind.turbulence import TurbulentWind
from gustform_codegen.cache import KernelCache
from tests.components.systems import sampled_table
from tests.physics.running import ready
from tests.support.case import open_case

Array = NDArray[np.float64]
SOURCES = ("measured", "estimated")


def turbine(wind: float, source: str, curtailment: float = 0.1, **schedule: float) -> PmsgTurbine:
    return PmsgTurbine(
        aggregate=10,
        wind_speed=wind,
        curtailment=curtailment,
        schedule=CurtailmentSchedule(wind_source=source, **schedule),
    )


def on_a_stiff_grid(unit: Component, wind: Constant | Series) -> System:
    s = System()
    s.add("grid", StiffGrid())
    s.add("bus", Bus())
    s.add("wt", unit)
    s.connect("grid.terminal", "bus.terminal")
    s.connect("wt.grid", "bus.terminal")
    s.frame("grid.omega")
    s.bind("wt.wind", wind)
    return s


def points(unit: PmsgTurbine, winds: Array, curtailment: float = 0.1) -> list[OperatingPoint]:
    return [operating_point(unit.rotor, float(v), curtailment, unit.limits()) for v in winds]


# ---- the tables -----------------------------------------------------------------------------------------------------
def test_splines_go_through_the_published_points_and_stay_near_between() -> None:
    unit = PmsgTurbine()
    speed, pitch = (make(unit.rotor, unit.limits()) for make in (speed_table, pitch_table))
    winds, etas = np.arange(6.0, 15.0, 0.013), np.array([0.8, 0.85, 0.9, 0.93, 0.98, 1.0])
    for v in (8.0, 10.0, 12.0):
        point = operating_point(unit.rotor, v, 0.1, unit.limits())
        at = np.array([v]), np.array([np.sqrt(0.1)])
        assert min(speed.evaluate(*at)[0][0], 1.2) == pytest.approx(point.omega_del, abs=1e-9)
        assert pitch.evaluate(*at)[0][0] == pytest.approx(point.beta_del, abs=1e-6)
    for eta in etas:
        root = np.full(winds.size, np.sqrt(1.0 - eta))
        omega = np.minimum(speed.evaluate(winds, root)[0], unit.omega_max)
        beta = np.maximum(pitch.evaluate(winds, root)[0], 0.0)
        right = points(unit, winds, float(1.0 - eta))
        # what the docstring of the schedule promises
        assert np.max(np.abs(omega - [p.omega_del for p in right])) < 0.007
        steps = np.array([p.beta_del for p in right])
        bend = np.abs(winds - 11.23) < 0.25
        assert np.max(np.abs(beta - steps)[bend]) < 0.3
        power = np.array(
            [power_at(unit.rotor, v, w, b, unit.limits()) for v, w, b in zip(winds, omega, beta, strict=True)]
        )
        error = np.abs(power - [p.power for p in right])
        assert np.max(error[bend]) < 0.004
        assert np.max(error) < 0.015


def test_the_observer_can_tell_winds_apart() -> None:
    # P_v = Cp(v_tip omega/v, beta) v^3 rises with v at fixed speed where 3 Cp > lambda dCp/dlambda
    aero = cp_solver(PmsgTurbine().rotor)
    for ratio in np.linspace(*aero.ratios, 30):
        for pitch in np.linspace(*aero.pitches, 25):
            assert 3.0 * aero.value(ratio, pitch) > ratio * aero.slopes(ratio, pitch)[0]


def test_turbines_alike_share_one_table() -> None:
    a, b = turbine(8.0, "estimated"), turbine(11.0, "estimated", 0.2)
    for name in ("omega_table", "beta_table", "cp"):
        assert a.schedule.table(name) is b.schedule.table(name)
    assert default_table(a.rotor, a.limits()).feasible.any()


# ---- at rest --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("wind", "rotor"), [(8.0, None), (10.0, None), (12.0, None), (9.0, "table")])
def test_starts_at_the_operating_point_and_stays(
    source: str, wind: float, rotor: str | None, cache: KernelCache
) -> None:
    unit = turbine(wind, source)
    if rotor is not None:
        unit = PmsgTurbine(
            aggregate=10, wind_speed=wind, curtailment=0.1, rotor=TableRotor(cp=sampled_table()),
            schedule=CurtailmentSchedule(wind_source=source),
        )  # fmt: skip
    run = ready(on_a_stiff_grid(unit, Constant(wind)), cache)
    got = run.follow(["wt.omega_r", "wt.beta", "wt.P_wt", "wt.schedule.v"], np.array([0.0, 30.0]), rtol=1e-8)
    point = unit.operating_point()
    # the spline goes through these points; the observer's Cp is a spline through samples, off by less than 1e-6
    assert got["wt.omega_r"] == pytest.approx([point.omega_del] * 2, abs=1e-6)
    assert got["wt.beta"] == pytest.approx([point.beta_del] * 2, abs=1e-4)
    assert got["wt.P_wt"] == pytest.approx([point.power] * 2, abs=1e-5)
    assert got["wt.schedule.v"] == pytest.approx([wind] * 2, abs=1e-5)


# ---- in motion ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("source", SOURCES)
def test_follows_a_slow_ramp_through_rated_wind(source: str, cache: KernelCache) -> None:
    rate, T_wind = 0.01, 10.0  # m/s^2, s
    unit = turbine(7.0, source, T_wind=T_wind)
    wind = Series("ramp", 7.0, time=np.array([0.0, 10.0, 610.0, 700.0]), value=np.array([7.0, 7.0, 13.0, 13.0]))
    run = ready(on_a_stiff_grid(unit, wind), cache)
    got = run.follow(
        ["wt.wind", "wt.omega_r", "wt.schedule.omega_del", "wt.P_pmsg"], np.arange(0.0, 700.0, 1.0), rtol=1e-7
    )
    right = points(unit, got["wt.wind"])
    # the machine side holds the rotor at the looked-up speed: K_msc (v_dc - 1) and d(rho)/dt are left
    assert np.max(np.abs(got["wt.omega_r"] - got["wt.schedule.omega_del"])) < 1e-3
    # the filter lags by T_wind rate, the observer by 2 s at most; omega_del rises by 1.2/8.29 pu for 1 m/s
    lag = rate * (T_wind + 2.0)
    speed = got["wt.omega_r"] - [p.omega_del for p in right]
    assert np.max(np.abs(speed)) < 1.2 / 8.29 * lag + 0.003
    # power: the lag of the wind (dP/dv is .36 pu at most, at rated wind and constant pitch less than that), the spline,
    # and what the speed limiter keeps of excursions above omega_max, 0.2 deg of pitch
    power = got["wt.P_pmsg"] - [p.power for p in right]
    assert np.max(np.abs(power)) < 0.03
    assert np.sqrt(np.mean(power**2)) < 0.012


@pytest.mark.parametrize("source", SOURCES)
def test_the_curtailment_may_be_changed_while_it_runs(source: str, cache: KernelCache) -> None:
    system = on_a_stiff_grid(turbine(10.0, source), Constant(10.0))
    system.change(10.0, "wt.curtailment", 0.2)
    system.change(200.0, "wt.curtailment", 0.05)
    unit = turbine(10.0, source)
    got = ready(system, cache).follow(
        ["wt.P_pmsg", "wt.beta", "wt.omega_r", "wt.schedule.v"], np.array([9.0, 190.0, 390.0]), rtol=1e-8
    )
    for k, curtailment in enumerate((0.1, 0.2, 0.05)):
        point = operating_point(unit.rotor, 10.0, curtailment, unit.limits())
        # 10 m/s is on the grid, 20 and 5 % lie between its curtailments
        assert got["wt.omega_r"][k] == pytest.approx(point.omega_del, abs=2e-3)
        assert got["wt.beta"][k] == pytest.approx(point.beta_del, abs=0.05)
        assert got["wt.P_pmsg"][k] == pytest.approx(point.power, abs=2e-3)
        assert got["wt.schedule.v"][k] == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize("source", SOURCES)
def test_runs_through_turbulence(source: str, cache: KernelCache) -> None:
    unit = turbine(10.0, source)
    # Kaimal, class B, 90 m hub height, felt by a rotor of 63 m
    spectrum = Kaimal(10.0, standard_deviation("B", 10.0), length_scale(90.0))
    samples = TurbulentWind(spectrum, step=0.05, seed=(1,), radius=63.0)(0, 6001)[1]
    series = Series("turbulence", 10.0, dt=0.05, value=samples)
    run = ready(on_a_stiff_grid(unit, series), cache)
    names = ["wt.wind", "wt.omega_r", "wt.P_pmsg", "wt.v_dc", "wt.schedule.v"]
    known = "wt.schedule.source.v" if source == "estimated" else "wt.wind"
    got = run.follow(list(dict.fromkeys([*names, known])), np.arange(20.0, 300.0, 0.5))
    assert np.ptp(got["wt.wind"]) > 3.0
    # 1 s of time constant on gusts of 1.2 m/s standard deviation and 10 s and more of length
    assert np.sqrt(np.mean((got[known] - got["wt.wind"]) ** 2)) < 0.25
    assert np.all((got["wt.omega_r"] > 0.6) & (got["wt.omega_r"] < 1.25))
    # 13 m/s carry 1.4 pu to a rotor at 1.2 pu before the power limiter has pitched it
    assert np.all((got["wt.P_pmsg"] > -0.05) & (got["wt.P_pmsg"] < 1.3))
    assert np.max(np.abs(got["wt.v_dc"] - 1.0)) < 0.01  # a stiff grid holds it


def test_what_the_table_does_not_reach_is_refused() -> None:
    with pytest.raises(GustformError, match=r"GF2003.*schedule\.curtailment must be at most 0\.4.*got 0\.5"):
        turbine(10.0, "measured", 0.5).parameter_values()
    with pytest.raises(GustformError, match="wind_source must be measured or estimated"):
        turbine(10.0, "guessed")


@pytest.mark.parametrize("wind", [9.0, 9.5, 10.0])
def test_starts_in_a_strong_grid_with_a_soft_shaft(wind: float) -> None:
    """The first guess has the generator, which delivers 1 % of its rating here, below no valve opening at all: a whole
    Newton step from there goes out of bounds, and across the limiters of the pitch, where nothing leads back."""
    case = open_case(
        "turbulent_10min",
        "components.sg.rating=4200 MVA",
        "components.wt.drive={type: TwoMass}",
        "components.wt.schedule={type: CurtailmentSchedule}",
        f"wind.wt.mean={wind} m/s",
    )
    with case.simulation(("wt.omega_r", "wt.schedule.omega_del", "wt.beta", "wt.schedule.beta_del")) as simulation:
        simulation.initialise(0.0)
        omega_r, omega_del, beta, beta_del = simulation.channels()
    assert omega_r == pytest.approx(omega_del, abs=1e-8)
    assert beta == pytest.approx(max(beta_del, 0.0), abs=1e-6)

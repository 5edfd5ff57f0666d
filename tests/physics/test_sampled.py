"""Closed loop at 1 kHz: the exported controller's C beside the turbine against its equations in the turbine, over 20 MW
of load at 8 m/s.

Between two samples the commands stand still, so the answer to the jump of the load comes up to one period late, and one
more with a delay of one sample: differences are in proportion to the period. Bounds are some 1.5 times what was
measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.case import Case, open_case
from tests.support.controller import CONTROLS

STEP, UNTIL = 30.0, 45.0  # s; the nadir is at 42 s
CHANNELS = ("sg.frequency", "wt.v_dc", "wt.omega_r", "wt.P_gsc", "wt.P_pmsg", "wt.beta")
FREQUENCY, V_DC, OMEGA_R, P_GSC, P_PMSG, BETA = CHANNELS
Rows = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Bound:
    """Largest differences after the step: v_dc and P_gsc in pu, frequency in mHz; and of the nadir, mHz."""

    v_dc: float
    P_gsc: float
    frequency: float = 0.1
    nadir: float = 0.1


# Without and with a delay of one sample. Rows are float32, 0.004 mHz at 50 Hz.
#
# Dual-port: K_d/T_dc answers to a change of the DC voltage within the sample, so that a late answer is a large one.
# Droop, VSM, matching: their DC voltage is held by a PI or in proportion, which acts one sample late.
# Virtual synchronous machine: it remembers the deviation from 1 pu, so that float does not lose the small increments.
BOUNDS = {
    "DualPort": (Bound(1.5e-4, 1.2e-3, 0.02, 0.02), Bound(5e-4, 4e-3, 0.03, 0.02)),
    "GridFollowing": (Bound(6e-6, 1.5e-4, 0.02, 0.02), Bound(1e-5, 3e-4, 0.02, 0.02)),
    "Droop": (Bound(4.5e-4, 3.6e-3, 0.2), Bound(9e-4, 7e-3, 0.35)),
    "VirtualSynchronousMachine": (Bound(3e-4, 1.2e-3, 0.15), Bound(8e-4, 2.5e-3, 0.35)),
    "Matching": (Bound(3e-4, 2.3e-3), Bound(9e-4, 7e-3, 0.3)),
}


def case(control: str, *changes: str) -> Case:
    return open_case("load_step_8ms", f"components.wt.control={{type: {control}}}", *changes)


def rows(found: Case, until: float = UNTIL) -> Rows:
    _, values, _ = found.run(CHANNELS, 5e-3, until, rtol=1e-6)
    return {name: column.astype(float) for name, column in values.items()}


def largest(a: Rows, b: Rows, name: str) -> float:
    return float(np.max(np.abs(a[name] - b[name])))


@pytest.fixture(scope="module", params=CONTROLS)
def control(request: pytest.FixtureRequest) -> tuple[str, Rows]:
    return str(request.param), rows(case(request.param))


def check(found: Rows, continuous: Rows, bound: Bound) -> None:
    assert largest(found, continuous, V_DC) < bound.v_dc
    assert largest(found, continuous, P_GSC) < bound.P_gsc
    assert 1e3 * largest(found, continuous, FREQUENCY) < bound.frequency
    assert 1e3 * abs(found[FREQUENCY].min() - continuous[FREQUENCY].min()) < bound.nadir


@pytest.mark.parametrize("delay", [0, 1])
def test_closed_loop_is_the_continuous_one(control: tuple[str, Rows], delay: int) -> None:
    name, continuous = control
    found = rows(case(name, "wt.control.sampled=1 ms", f"wt.control.delay={delay}"))
    check(found, continuous, BOUNDS[name][delay])
    assert np.ptp(continuous[FREQUENCY]) > 0.3  # Hz: there is something to follow
    # Before the step nothing moves. The commands of dual-port control jitter by K_d_msc/T_dc = 101 times what a float
    # of the DC voltage cannot tell, 3e-8, and with them the power of the machine, in a state that stands still.
    before = round(STEP / 5e-3)
    for channel in CHANNELS:
        unit = 50.0 if channel == FREQUENCY else 1.0
        bound = 1e-5 if channel in (P_PMSG, P_GSC) and name == "DualPort" else 1e-6
        assert np.max(np.abs(found[channel][:before] - continuous[channel][0])) < bound * unit, channel


def test_in_double_half_the_period_is_half_the_difference(control: tuple[str, Rows]) -> None:
    name, continuous = control
    found = {period: rows(case(name, f"wt.control={{type: {name}, sampled: {period}, real: double}}"))
             for period in ("1 ms", "0.5 ms")}  # fmt: skip
    check(found["1 ms"], continuous, BOUNDS[name][0])
    for channel in (V_DC, P_GSC):
        whole, half = (largest(found[period], continuous, channel) for period in ("1 ms", "0.5 ms"))
        # 2e-6: what the solver's tolerance and float rows leave of both
        assert half < 0.55 * whole + 2e-6, channel
    before = round(STEP / 5e-3)
    for channel in CHANNELS:
        unit = 50.0 if channel == FREQUENCY else 1.0
        assert np.max(np.abs(found["1 ms"][channel][:before] - continuous[channel][0])) < 1e-8 * unit, channel


@pytest.mark.parametrize("fidelity", ["lossless", "dq"])
@pytest.mark.parametrize(("name", "v_dc", "P_gsc"), [("DualPort", 4.5e-4, 4e-3), ("GridFollowing", 6e-6, 1.5e-4)])
def test_other_fidelities(name: str, v_dc: float, P_gsc: float, fidelity: str) -> None:
    changes = (f"fidelity={fidelity}", "events=[{at: 1 s, set: {load.active: 120 MW}}]")
    continuous = rows(case(name, *changes), 3.0)
    found = rows(case(name, *changes, "wt.control.sampled=1 ms"), 3.0)
    assert largest(found, continuous, V_DC) < v_dc
    assert largest(found, continuous, P_GSC) < P_gsc


CHANGES = {
    # of the plant and, through the gains at the operating point, of the controller
    "curtailment": ["wt.schedule.type=CurtailmentSchedule", "events=[{at: 1 s, set: {wt.curtailment: 25 %}}]"],
    "set point": ["events=[{at: 1 s, set: {wt.control.V_ref: 1.02}}]"],
    "gain": ["events=[{at: 1 s, set: {wt.control.K_gsc: 0.7}}, {at: 2 s, set: {load.active: 110 MW}}]"],
}


@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("source", ["measured", "estimated"])
def test_a_schedule_in_the_controller_follows_the_wind(source: str, real: str) -> None:
    """From 8 to 9 m/s in 10 s, through the bend at the highest speed; what it holds is told by the controller."""
    changes = (
        f"components.wt.schedule={{type: CurtailmentSchedule, wind_source: {source}, T_wind: 1 s}}",
        "wind.wt={type: ramp, from: 8 m/s, to: 9 m/s, at: 1 s, duration: 10 s}",
        "run.until=15 s",
    )
    channels = (OMEGA_R, V_DC, FREQUENCY, "wt.schedule.omega_del", "wt.schedule.beta_del")
    one, other = (
        case("DualPort", *changes, *more).run(channels, 5e-3, 15.0, rtol=1e-7)[1]
        for more in ((), ("wt.control.sampled=1 ms", f"wt.control.real={real}"))
    )
    differences = [float(np.max(np.abs(one[name].astype(float) - other[name]))) for name in channels]
    # The schedule tells of the sample before: 1 ms of the rates at which speed, 0.014 pu/s, and pitch, 2.3 deg/s, go.
    for difference, bound in zip(differences, (6e-6, 1.2e-6, 5e-5, 3e-5, 5e-3), strict=True):
        assert difference < bound
    assert np.ptp(one["wt.schedule.omega_del"]) > 0.04
    assert np.ptp(one["wt.schedule.beta_del"]) > 1.0


@pytest.mark.parametrize("what", CHANGES)
def test_changes_of_parameters_reach_the_controller(what: str) -> None:
    continuous = rows(case("DualPort", *CHANGES[what]), 6.0)
    found = rows(case("DualPort", *CHANGES[what], "wt.control.sampled=1 ms"), 6.0)
    assert largest(found, continuous, P_GSC) < 1e-3
    assert largest(found, continuous, V_DC) < 1.5e-4
    assert np.ptp(continuous[P_GSC]) > 1e-2

"""Grid-following and standard grid-forming control: transfer functions, limits and the converters that obey them."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from gustform.control.droop import Droop
from gustform.control.grid_following import GridFollowing
from gustform.control.low_speed_limit import LowSpeedLimit
from gustform.control.matching import Matching
from gustform.control.msc_dc_voltage import MscDcVoltage
from gustform.control.pi_control import PiControl
from gustform.control.pll import Pll
from gustform.control.virtual_synchronous_machine import VirtualSynchronousMachine
from gustform.control.voltage_droop import VoltageDroop
from gustform.electrical.gsc_current import GridSideCurrent
from gustform.electrical.msc_power import MachineSidePower
from gustform.language import Component, GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.components.evaluate import evaluate

ROUND_OFF = 1e-12
W0 = 2.0 * math.pi * 50.0  # rad/s


# ---- PI with limits ----
@pytest.mark.parametrize(
    ("e", "integral", "u", "rate"),
    [
        (0.01, 0.5, 0.5 + 4.0 * 0.01, 20.0 * 0.01),  # between the limits: a PI controller
        (0.2, 0.5, 1.0, 20.0 * 0.2),  # its output at the limit, the integral still on its way there
        (0.2, 1.0, 1.0, 0.0),  # both at the limit: no windup, whatever the error
        (-0.01, 1.0, 1.0 - 4.0 * 0.01, -20.0 * 0.01),  # comes off the limit with the sign of the error
        (-0.5, 0.0, 0.0, 0.0),
        (0.01, 0.0, 4.0 * 0.01, 20.0 * 0.01),
        (0.0, 1.1, 1.0, -0.1 / 0.01),  # a limit that has moved takes the integral with it, within T_release
    ],
)
def test_pi_does_not_wind_up(e: float, integral: float, u: float, rate: float) -> None:
    found = evaluate(PiControl(k_p=4.0, k_i=20.0), {"e": e, "lower": 0.0, "upper": 1.0, "integral": integral})
    assert found["u"] == pytest.approx(u, rel=ROUND_OFF, abs=ROUND_OFF)
    assert found["der(integral)"] == pytest.approx(rate, rel=1e-9, abs=ROUND_OFF)


@pytest.mark.parametrize("e", [-1e6, -1.0, 0.0, 1.0, 1e6])
def test_integral_never_leaves_the_limits(e: float) -> None:
    for integral, sign in ((0.0, 1.0), (1.0, -1.0)):
        found = evaluate(PiControl(), {"e": e, "lower": 0.0, "upper": 1.0, "integral": integral})
        assert sign * found["der(integral)"] >= 0.0


# ---- PLL ----
def test_pll_is_a_loop_of_second_order() -> None:
    """s^2 + w0 k_p s + w0 k_i at a voltage of any magnitude, from the slopes at rest."""
    pll = Pll(k_p=0.2, k_i=1.4)
    V, h = 0.83, 1e-6

    def rates(angle: float, integral: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """d(angle)/dt of the frame ahead of the voltage, and d(integral)/dt."""
        given = {"v_d": V * math.cos(angle), "v_q": -V * math.sin(angle), "integral": integral}
        found = evaluate(pll, given)
        return np.array([W0 * (found["omega"] - 1.0), found["der(integral)"]])

    columns = [(rates(*(h * unit)) - rates(*(-h * unit))) / (2.0 * h) for unit in np.eye(2)]
    # central differences of a sine: h^2/6, and round-off of 1 over h
    np.testing.assert_allclose(np.poly(np.array(columns).T), [1.0, W0 * 0.2, W0 * 1.4], rtol=1e-8)


def test_pll_reads_the_angle_of_the_voltage_and_its_gain_falls_with_a_low_one() -> None:
    v = cmath.rect(0.4, 0.3)
    given = {"v_d": v.real, "v_q": v.imag, "integral": -0.002}
    assert evaluate(Pll(), given)["omega"] == pytest.approx(1.0 + 0.2 * math.sin(0.3) - 0.002, rel=ROUND_OFF)
    given = {"v_d": 0.0, "v_q": 0.01, "integral": 0.0}  # a tenth of V_min
    assert evaluate(Pll(V_min=0.1), given)["omega"] == pytest.approx(1.0 + 0.2 * 0.1, rel=ROUND_OFF)


# ---- grid-following ----
GFL = {
    "v_dc": 1.0, "omega_r": 1.0, "v_d": 1.0, "v_q": 0.0, "Q_gsc": 0.0,
    "pll.integral": 0.0, "dc_voltage.integral": 0.5, "reactive.integral": 0.1,
}  # fmt: skip


@pytest.mark.parametrize(("omega", "P"), [(0.6, (0.6 / 1.2) ** 3), (1.2, 1.0), (1.3, 1.0)])
def test_power_by_the_cube_of_the_speed_up_to_the_limit(omega: float, P: float) -> None:
    # min((omega_r/1.2)^3, 1): project notes
    assert evaluate(GridFollowing(), GFL | {"omega_r": omega})["P_msc"] == pytest.approx(P, rel=ROUND_OFF)


def test_dc_voltage_gives_the_active_and_reactive_power_the_reactive_current() -> None:
    found = evaluate(GridFollowing(Q_ref=0.02), GFL | {"v_dc": 1.01, "Q_gsc": 0.05})
    assert found["i_d_gsc"] == pytest.approx(0.5 + 4.0 * 0.01, rel=ROUND_OFF)
    assert found["der(dc_voltage.integral)"] == pytest.approx(20.0 * 0.01, rel=1e-9)
    # Q = -v_d i_q: too much of it asks for more i_q
    assert found["i_q_gsc"] == pytest.approx(0.1 + 0.1 * 0.03, rel=ROUND_OFF)
    assert found["der(reactive.integral)"] == pytest.approx(10.0 * 0.03, rel=1e-9)


@pytest.mark.parametrize("v_dc", [0.5, 1.0, 1.05, 2.0])
@pytest.mark.parametrize("Q", [-3.0, 0.0, 3.0])
def test_current_limit_holds_for_any_references(v_dc: float, Q: float) -> None:
    at = GFL | {"v_dc": v_dc, "Q_gsc": Q, "dc_voltage.integral": 1.0, "reactive.integral": 0.9 * np.sign(Q)}
    found = evaluate(GridFollowing(i_max=1.1), at)
    assert math.hypot(found["i_d_gsc"], found["i_q_gsc"]) <= 1.1 * (1.0 + ROUND_OFF)
    if v_dc == 2.0:  # active current first: all but the share of the reactive one
        assert found["i_d_gsc"] == pytest.approx(1.1 * math.sqrt(0.99), rel=ROUND_OFF)


def test_cubic_law_goes_through_the_operating_point() -> None:
    for wind, curtailment in ((8.0, 0.0), (8.0, 0.1), (10.0, 0.1), (12.0, 0.1)):
        turbine = PmsgTurbine(wind_speed=wind, curtailment=curtailment, control=GridFollowing())
        control, point = turbine.control, turbine.operating_point()
        assert isinstance(control, GridFollowing)
        assert control.k_opt * point.omega_del**3 == pytest.approx(point.power, rel=1e-9)
        if curtailment == 0.0:  # 1 pu at 1.2 pu, to the digits of the notes' Cp: rated wind comes out at 11.2295 m/s
            assert control.k_opt == pytest.approx(1.2**-3, rel=1e-3)


def test_speed_limiter_starts_with_the_pitch_of_the_operating_point() -> None:
    turbine = PmsgTurbine(wind_speed=12.0, control=GridFollowing())
    assert turbine.pitch.beta_limiter == turbine.beta_del > 4.0  # deg; published: 4.3
    assert turbine.schedule.beta_point == 0.0
    dual_port = PmsgTurbine(wind_speed=12.0)
    assert (dual_port.pitch.beta_limiter, dual_port.schedule.beta_point) == (0.0, dual_port.beta_del)


# ---- grid-forming ----
FORMING = {"v_dc": 1.0, "Q_gsc": 0.0, "omega_r": 1.1, "omega_del": 1.16, "voltage.Q_filtered": 0.0}
FREE = {"P_ref": 0.5, "voltage.Q_ref": 0.05}


@pytest.mark.parametrize("w", [0.1, 10.0, 500.0])
def test_droop_is_a_filtered_gain(w: float) -> None:
    """-m_p/(T_p s + 1) from power to frequency at s = jw."""
    control, h = Droop(droop=0.03, T_p=0.04), 1e-3
    at = FORMING | {"P_gsc": 0.5, "P_filtered": 0.5, "dc_voltage.pi.integral": 0.5}

    def slope(of: str, to: str) -> float:
        up, down = (evaluate(control, at | {to: at[to] + sign * h}, FREE)[of] for sign in (1.0, -1.0))
        return (up - down) / (2.0 * h)

    a, b = slope("der(P_filtered)", "P_filtered"), slope("der(P_filtered)", "P_gsc")
    c, d = slope("omega_gsc", "P_filtered"), slope("omega_gsc", "P_gsc")
    assert c * b / (1j * w - a) + d == pytest.approx(-0.03 / (0.04j * w + 1.0), rel=1e-8)
    assert evaluate(control, at, FREE)["omega_gsc"] == 1.0


def test_virtual_machine_obeys_its_swing_equation() -> None:
    control = VirtualSynchronousMachine(H=3.0, droop=0.04, D=20.0, T_f=0.2)
    at = FORMING | {"P_gsc": 0.6, "w": -0.01, "w_f": -0.008, "dc_voltage.pi.integral": 0.5}
    found = evaluate(control, at, FREE)
    torque = 0.5 - 0.6 + 0.01 / 0.04 + 20.0 * 0.002
    assert found["der(w)"] == pytest.approx(torque / 6.0, rel=1e-9)
    assert found["der(w_f)"] == pytest.approx(-0.002 / 0.2, rel=1e-9)


@pytest.mark.parametrize(("v_dc", "P"), [(1.0, 0.5), (0.98, 0.5 + 0.3 / 0.06 * 0.02), (0.8, 1.0), (1.2, 0.0)])
def test_matching_turns_the_dc_voltage_into_frequency_and_power(v_dc: float, P: float) -> None:
    control = Matching(K_theta=0.3, droop=0.06)
    found = evaluate(control, FORMING | {"v_dc": v_dc}, FREE)
    assert found["omega_gsc"] == pytest.approx(1.0 + 0.3 * (v_dc - 1.0), rel=ROUND_OFF)
    assert found["P_msc"] == pytest.approx(P, abs=ROUND_OFF)
    assert control.K_theta / control.K_dc == pytest.approx(control.droop, rel=ROUND_OFF)


def test_voltage_droop_and_its_filter() -> None:
    found = evaluate(VoltageDroop(K_q=0.02, T_v=0.05), {"Q": 0.3, "Q_filtered": 0.1}, {"Q_ref": 0.05})
    assert found["V"] == pytest.approx(1.0 + 0.02 * (0.05 - 0.1), rel=ROUND_OFF)
    assert found["der(Q_filtered)"] == pytest.approx(0.2 / 0.05, rel=1e-9)


@pytest.mark.parametrize(("omega", "share"), [(1.2, 1.0), (0.6, 1.0), (0.45, 0.5), (0.3, 0.0), (0.0, 0.0), (-0.1, 0.0)])
def test_slow_rotor_gives_no_power(omega: float, share: float) -> None:
    limit = LowSpeedLimit(P_max=0.9, omega_min=0.6, stop=0.5)
    assert evaluate(limit, {"omega_r": omega})["P_limit"] == pytest.approx(0.9 * share, abs=ROUND_OFF)


@pytest.mark.parametrize(
    ("omega", "v_dc", "P"), [(1.1, 0.99, 0.54), (1.1, 0.5, 0.9), (0.45, 0.9, 0.45), (1.1, 1.5, 0.0)]
)
def test_machine_side_holds_the_dc_voltage_within_its_limits(omega: float, v_dc: float, P: float) -> None:
    control = MscDcVoltage(P_max=0.9)
    found = evaluate(control, {"v_dc": v_dc, "omega_r": omega, "pi.integral": 0.5})
    assert found["P"] == pytest.approx(P, abs=ROUND_OFF)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        (Droop, "droop", 0.0),
        (Droop, "T_p", -0.1),
        (VirtualSynchronousMachine, "H", 0.0),
        (VirtualSynchronousMachine, "D", -1.0),
        (Matching, "K_theta", 0.0),
        (GridFollowing, "i_max", 0.0),
        (GridFollowing, "reactive_share", 1.0),
        (LowSpeedLimit, "stop", 1.0),
    ],
)
def test_values_outside_their_range_are_refused(kind: type[Component], name: str, value: float) -> None:
    with pytest.raises(GustformError, match=f"{kind.__name__}.{name} must be") as caught:
        kind(**{name: value})
    assert caught.value.code == "GF2003"


# ---- converters ----
def port(name: str, v: complex) -> dict[str, float]:
    return {f"{name}.vr": v.real, f"{name}.vi": v.imag}


@pytest.mark.parametrize("blocked", [0.0, 1.0])
def test_current_imposing_grid_side(blocked: float) -> None:
    theta, v, i = 0.15, cmath.rect(3.2e3, 0.02), 0.8 - 0.3j
    given = port("grid", v) | {"i_d": i.real, "i_q": i.imag, "i_d_ref": 0.9, "i_q_ref": -0.3, "blocked": blocked}
    found = evaluate(GridSideCurrent(T=0.005), given | {"omega": 1.002, "frame": 0.998, "theta": theta, "dc.v": 8000.0})
    amperes = (1.0 - blocked) * i * cmath.exp(1j * theta) * 5e6 / 3.3e3
    assert complex(found["grid.ir"], found["grid.ii"]) == pytest.approx(-amperes, rel=ROUND_OFF)
    e = v + complex(0.01, 0.1) * 3.3e3**2 / 5e6 * amperes  # before the filter
    assert complex(found["P"], found["Q"]) == pytest.approx(e * amperes.conjugate(), rel=ROUND_OFF)
    assert found["dc.i"] == pytest.approx(found["P"] / 8000.0, rel=ROUND_OFF)
    assert (found["der(i_d)"], found["der(i_q)"]) == pytest.approx((0.1 / 0.005, 0.0), rel=1e-9)
    seen = v * cmath.exp(-1j * theta) / 3.3e3
    assert complex(found["v_d"], found["v_q"]) == pytest.approx(seen, rel=ROUND_OFF)


@pytest.mark.parametrize(("v_q", "blocked"), [(0.9, 0.0), (0.9, 1.0), (0.01, 0.0)])
def test_power_taking_machine_side(v_q: float, blocked: float) -> None:
    v = complex(0.1, v_q) * 3.3e3
    given = port("machine", v) | {"dc.v": 8000.0, "P_ref": 0.6, "i_q": 0.5, "blocked": blocked}
    found = evaluate(MachineSidePower(T=0.02), given)
    current = (1.0 - blocked) * 0.5 * 5e6 / 3.3e3
    assert (found["machine.ir"], found["machine.ii"]) == pytest.approx((0.0, current), rel=ROUND_OFF)
    assert found["P"] == pytest.approx(v.imag * current, rel=ROUND_OFF)
    assert found["Q"] == pytest.approx(v.real * current, rel=ROUND_OFF)  # delivered: +x |i|^2 of the machine
    assert found["dc.i"] == pytest.approx(-found["P"] / 8000.0, rel=ROUND_OFF)
    # the current that takes P_ref, but not more than at V_min = 0.1 pu
    assert found["der(i_q)"] == pytest.approx((0.6 / max(v_q, 0.1) - 0.5) / 0.02, rel=1e-9)

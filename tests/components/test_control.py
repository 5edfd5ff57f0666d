"""Controllers against their transfer functions and limits."""

from __future__ import annotations

import pytest

from gustform.control.dual_port import DualPort
from gustform.control.dual_port_gsc import DualPortGsc
from gustform.control.dual_port_msc import DualPortMsc
from gustform.control.pi_limiter import PiLimiter
from gustform.control.pitch import PitchControl
from gustform.control.pitch_servo import PitchServo
from gustform.language import Component
from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.components.evaluate import evaluate

GSC = {"v_dc": 1.0, "dv_dc": 0.0, "Q": 0.0, "xi": 0.0, "Q_filtered": 0.0}
MSC = GSC | {"omega_del": 1.16}


@pytest.mark.parametrize(
    ("control", "at", "free"),
    [
        (DualPortGsc(K_theta=0.5, K_d=0.0067), GSC, {"Q_ref": 0.0}),
        (DualPortMsc(K_theta=15.0, K_d=0.2), MSC, {"V_ref": 1.0}),
    ],
)
@pytest.mark.parametrize("w", [0.1, 10.0, 500.0, 1e4])
def test_frequency_response_is_a_filtered_pd(
    control: Component, at: dict[str, float], free: dict[str, float], w: float
) -> None:
    """(K + K_d s)/(T s + 1) at s = jw, from the slopes of the state equation and of the output."""
    h = 1e-3

    def slope(of: str, to: str) -> float:
        up, down = (evaluate(control, at | {to: at[to] + sign * h}, free)[of] for sign in (1.0, -1.0))
        return (up - down) / (2.0 * h)

    a, b = slope("der(xi)", "xi"), slope("der(xi)", "v_dc")
    c, d = slope("omega", "xi"), slope("omega", "v_dc")
    K, K_d, T = (control.value(name) for name in ("K_theta", "K_d", "T_dc"))
    # shifted by one: v_dc of 1 pu is the set point
    assert c * b / (1j * w - a) + d == pytest.approx((K + 1j * w * K_d) / (1j * w * T + 1.0), rel=1e-6)


def test_voltage_droop_and_filter_of_the_reactive_power() -> None:
    found = evaluate(DualPortGsc(), GSC | {"Q": 0.3, "Q_filtered": 0.1}, {"Q_ref": 0.05})
    assert found["V"] == pytest.approx(1.0 + 0.02 * (0.05 - 0.1), rel=1e-12)
    assert found["der(Q_filtered)"] == pytest.approx((0.3 - 0.1) / 0.05, rel=1e-12)
    assert found["omega"] == 1.0


def test_lossless_form_is_a_pd_of_the_dc_voltage_at_constant_ac_voltage() -> None:
    at = {"v_dc": 1.02, "dv_dc": -0.4, "Q": 0.3}
    found = evaluate(DualPortGsc(lossless=True, K_theta=0.5, K_d=0.0067), at, {"Q_ref": 0.1})
    assert found["omega"] == pytest.approx(1.0 + 0.5 * 0.02 - 0.0067 * 0.4, rel=1e-12)
    assert found["V"] == 1.0
    found = evaluate(DualPortMsc(lossless=True, K_theta=15.0, K_d=0.2), at | {"omega_del": 1.16}, {"V_ref": 0.93})
    assert found["omega"] == pytest.approx(1.16 + 15.0 * 0.02 - 0.2 * 0.4, rel=1e-12)
    assert found["V"] == 0.93


def test_both_sides_share_the_ratio_of_their_gains() -> None:
    control = PmsgTurbine(wind_speed=8.0, curtailment=0.1).control
    assert isinstance(control, DualPort)
    gsc, msc = control.gsc, control.msc
    # the condition of the stability theorem: K_d/K_theta equal on both sides
    assert msc.K_d / msc.K_theta == pytest.approx(gsc.K_d / gsc.K_theta, rel=1e-12)
    # and that of the project notes, without which the published filter is unstable
    assert gsc.T_dc < gsc.K_d / gsc.K_theta


@pytest.mark.parametrize(
    ("x", "integral", "rate", "u"),
    [
        (0.9, 0.0, 0.0, 0.0),  # below the maximum it rests at zero
        (0.9, 1.0, -0.2, 0.9),  # comes back with k_i e
        (0.9, 0.005, -0.1, 0.0),  # and close to zero with -I/T_release, so that it never gets below
        (1.1, 0.0, 0.2, 0.1),  # above the maximum it acts and integrates
        (1.1, 2.0, 0.2, 2.1),
        (1.1, 30.0, 0.0, 30.0),  # at the largest demand neither of them goes on
        (0.9, 30.0, -0.2, 29.9),
    ],
)
def test_limiter(x: float, integral: float, rate: float, u: float) -> None:
    found = evaluate(PiLimiter(x_max=1.0, k_p=1.0, k_i=2.0, u_max=30.0, T_release=0.05), {"x": x, "integral": integral})
    assert found["der(integral)"] == pytest.approx(rate, abs=1e-12)
    assert found["u"] == pytest.approx(u, abs=1e-12)


@pytest.mark.parametrize(("error", "rate"), [(0.3, 1.0), (-0.3, -1.0), (3.0, 8.0), (-3.0, -8.0), (0.0, 0.0)])
def test_servo_has_a_rate_limit(error: float, rate: float) -> None:
    found = evaluate(PitchServo(), {"beta_ref": 5.0 + error, "beta": 5.0})
    assert found["der(beta)"] == pytest.approx(rate, abs=1e-12)


@pytest.mark.parametrize(
    ("omega", "P", "integrals", "demand"),
    [
        (1.1, 0.5, (0.0, 0.0), 3.0 + 20.0 * (1.1 - 1.15)),  # proportional part alone
        (0.9, 0.5, (0.0, 0.0), 0.0),  # never below the lowest pitch
        (1.25, 0.5, (0.7, 0.0), 3.0 + 20.0 * 0.1 + 60.0 * 0.05 + 0.7),  # speed limiter
        (1.1, 1.2, (0.0, 0.4), 3.0 - 1.0 + 0.2 + 0.4),  # power limiter
    ],
)
def test_pitch_demand(omega: float, P: float, integrals: tuple[float, float], demand: float) -> None:
    control = PitchControl(K_p=20.0)
    given = {"beta_del": 3.0, "omega_del": 1.15, "omega_r": omega, "P": 0.5, "P_filtered": P, "servo.beta": 3.0}
    given |= {"speed_limiter.integral": integrals[0], "power_limiter.integral": integrals[1]}
    found = evaluate(control, given)
    assert found["beta_ref"] == pytest.approx(demand, abs=1e-12)
    assert found["der(P_filtered)"] == pytest.approx((0.5 - P) / 0.5, abs=1e-12)

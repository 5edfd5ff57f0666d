"""The reference must itself reach the published figures before anything is compared with it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.reference import paper_rms as ref


@pytest.fixture(scope="module")
def fr8() -> ref.Trajectory:
    return ref.load_step(8.0, method=ref.integrate_idas)


@pytest.fixture(scope="module")
def fr10() -> ref.Trajectory:
    return ref.load_step(10.0, method=ref.integrate_idas)


# tolerance: half a unit of the last published digit, or 1 % for K_p (the paper computes it from rounded values)
@pytest.mark.parametrize(
    ("wind", "name", "published", "tolerance"),
    [
        (8.0, "omega_del", 1.16, 0.005), (10.0, "omega_del", 1.2, 1e-12), (12.0, "omega_del", 1.2, 1e-12),
        (8.0, "beta_del", 0.0, 1e-12), (10.0, "beta_del", 3.0, 0.05), (12.0, "beta_del", 5.4, 0.05),
        (12.0, "beta_mpp", 4.3, 0.05),
        (8.0, "K_msc", 15.1, 0.05), (10.0, "K_msc", 6.6, 0.05), (12.0, "K_msc", 1.0, 1e-12),
        (8.0, "K_p", 0.0, 1e-12), (10.0, "K_p", 22.7, 0.227), (12.0, "K_p", 270.0, 2.7),
        (8.0, "K_wr", 0.119, 0.0005), (10.0, "K_wr", 0.082, 0.0005), (12.0, "K_wr", 0.0, 1e-12),
        (8.0, "K_beta", 0.0, 1e-12), (10.0, "K_beta", 0.02, 0.0005),
        (8.0, "m_p", 0.277, 0.0005), (10.0, "m_p", 0.142, 0.0005),
        # not the paper's .083 and 2.3 %: this surface gives .091 and 2.05 % (project notes)
        (12.0, "K_beta", 0.091, 0.0005), (12.0, "m_p", 0.0205, 0.00005),
    ],
)  # fmt: skip
def test_control_tables(wind: float, name: str, published: float, tolerance: float) -> None:
    assert getattr(ref.operating_point(wind), name) == pytest.approx(published, abs=tolerance)


def test_rated_wind() -> None:
    assert pytest.approx(11.23, abs=0.005) == ref.WIND_RATED


@pytest.mark.parametrize("wind", [8.0, 10.0, 12.0])
def test_start_is_a_stable_equilibrium(wind: float) -> None:
    dae = ref.flat_dae(ref.steady_state(ref.operating_point(wind)))
    explicit = ref.Explicit(dae)
    assert np.max(np.abs(explicit.ode(dae.x0, wind, ref.LOAD_P))) < 1e-11  # round-off times the fastest rate, 500 /s
    assert np.max(np.linalg.eigvals(explicit.jacobian(dae.x0, wind, ref.LOAD_P)).real) < -0.01


def test_published_filter_time_constant_is_unstable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ref, "T_DC", 0.05)
    dae = ref.flat_dae(ref.steady_state(ref.operating_point(8.0)))
    assert np.max(np.linalg.eigvals(ref.Explicit(dae).jacobian(dae.x0, 8.0, ref.LOAD_P)).real) > 1.0


def test_published_frequencies(fr8: ref.Trajectory, fr10: ref.Trajectory) -> None:
    at8, at10 = ref.frequency_figures(fr8), ref.frequency_figures(fr10)
    assert at8["nadir_hz"] == pytest.approx(49.644, abs=0.005)
    assert at8["settle_hz"] == pytest.approx(49.724, abs=0.003)
    assert at10["nadir_hz"] == pytest.approx(49.613, abs=0.005)
    for figures in (at8, at10):
        assert figures["held_hz"] < 1e-4


def test_published_frequencies_grid_following() -> None:
    figures = ref.frequency_figures(ref.load_step(8.0, turbine=False, method=ref.integrate_idas))
    assert figures["nadir_hz"] == pytest.approx(49.397, abs=0.005)
    assert figures["settle_hz"] == pytest.approx(49.709, abs=0.003)


def test_two_integrators_agree(fr8: ref.Trajectory) -> None:
    radau = ref.load_step(8.0)
    # both at rtol 1e-8: 1e-6 Hz is 2e-8 of the frequency, twice that
    assert np.max(np.abs(radau["frequency"] - fr8["frequency"])) < 1e-6
    assert np.max(np.abs(radau["omega_r"] - fr8["omega_r"])) < 1e-6
    assert np.max(np.abs(radau["v_dc"] - fr8["v_dc"])) < 1e-6


def test_first_slope_is_the_inertia_of_the_generator() -> None:
    # without the turbine nothing but H answers in the first instant: RoCoF = -f0 dP/(2 H S); the governor has .3 s
    run = ref.load_step(8.0, turbine=False, method=ref.integrate_idas)
    expected = -ref.F0 * ref.LOAD_STEP / (2.0 * ref.H_SG * ref.S_SG)
    assert ref.frequency_figures(run)["rocof_hz_per_s"] == pytest.approx(expected, rel=0.01)


def test_frequency_dc_voltage_and_rotor_speed_settle_in_proportion(fr10: ref.Trajectory) -> None:
    op = ref.operating_point(10.0)
    dv = fr10["v_dc"][-1] - 1.0
    # 1e-5: what is left of the slowest mode (-0.135 /s) 60 s after the step
    assert dv == pytest.approx((fr10["frequency"][-1] / ref.F0 - 1.0) / ref.K_GSC, abs=1e-5)
    assert fr10["omega_r"][-1] - op.omega_del == pytest.approx(op.K_msc * dv, abs=1e-5)


def test_ida_residual_and_jacobian_vanish_and_match() -> None:
    dae = ref.flat_dae(ref.steady_state(ref.operating_point(10.0)))
    residual, jacobian = ref.residual_functions(dae)
    y = np.concatenate([dae.x0, dae.z0])
    y[dae.x_names.index("wt.omega_r")] -= 1e-3  # off the kink that sits exactly at the operating point
    zero, h, c = np.zeros(y.size), 1e-6, 7.0
    J = np.asarray(jacobian(y, zero, 10.0, ref.LOAD_P, c))
    for k in range(y.size):
        e = np.zeros(y.size)
        e[k] = h
        up, down = (np.asarray(residual(y + s * e, s * c * e, 10.0, ref.LOAD_P)).ravel() for s in (1.0, -1.0))
        np.testing.assert_allclose((up - down) / (2.0 * h), J[:, k], rtol=1e-5, atol=1e-5)

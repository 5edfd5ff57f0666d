"""Table data: the spline through it, clamping, derivatives, resampling and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform.language.table import TableData

Array = NDArray[np.float64]


def smooth(x: Any, y: Any) -> Any:
    return np.sin(x) * np.exp(-0.3 * y) + 0.1 * x * y


def table(x: Array, y: Array) -> TableData:
    return TableData(x, y, smooth(x[:, None], y[None, :]))


UNIFORM = table(np.linspace(-1.0, 2.0, 16), np.linspace(0.0, 3.0, 13))


def test_uniform_data_is_interpolated_exactly() -> None:
    xx, yy = np.meshgrid(UNIFORM.x, UNIFORM.y, indexing="ij")
    value, _, _ = UNIFORM.evaluate(xx.ravel(), yy.ravel())
    # Solving for the coefficients and summing 16 terms costs a few units in the last place.
    np.testing.assert_allclose(value, UNIFORM.value.ravel(), rtol=1e-13, atol=1e-14)
    assert UNIFORM.resampling_error < 1e-14
    assert (UNIFORM.spline()["n_x"], UNIFORM.spline()["n_y"]) == (16, 13)


def test_a_plane_is_reproduced_everywhere() -> None:
    # A natural cubic spline reproduces straight lines, so a bilinear function is exact between the points too.
    x, y = np.linspace(0.0, 5.0, 6), np.linspace(-2.0, 2.0, 5)
    plane = TableData(x, y, 3.0 + 2.0 * x[:, None] - 1.5 * y[None, :] + 0.5 * x[:, None] * y[None, :])
    px, py = np.array([0.1, 2.7, 4.99]), np.array([-1.9, 0.3, 1.7])
    value, dx, dy = plane.evaluate(px, py)
    np.testing.assert_allclose(value, 3.0 + 2.0 * px - 1.5 * py + 0.5 * px * py, rtol=1e-13)
    np.testing.assert_allclose(dx, 2.0 + 0.5 * py, rtol=1e-12)
    np.testing.assert_allclose(dy, -1.5 + 0.5 * px, rtol=1e-12)


def test_the_error_between_points_falls_as_the_spacing_squared_or_faster() -> None:
    px, py = np.random.default_rng(1).uniform(0.5, 1.5, (2, 200))  # away from the edges, where it is natural
    errors = []
    for n in (12, 24, 48):
        finer = table(np.linspace(-1.0, 2.0, n), np.linspace(0.0, 3.0, n))
        errors.append(np.max(np.abs(finer.evaluate(px, py)[0] - smooth(px, py))))
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[1] / 4


@given(st.floats(-1.0, 2.0), st.floats(0.0, 3.0))
def test_derivatives_agree_with_differences(x: float, y: float) -> None:
    # Central differences with h = 1e-5: error h^2 f'''/6 ~ 1e-11 plus rounding 1e-16/1e-5 = 1e-11, third
    # derivatives jump at grid lines (by ~ 1, hence 1e-5 on the second), so 1e-4 has a wide margin. One-sided at edges.
    h = 1e-5
    x0, x1, y0, y1 = max(x - h, -1.0), min(x + h, 2.0), max(y - h, 0.0), min(y + h, 3.0)
    value, dx, dy = UNIFORM.evaluate(np.array([x, x0, x1, x, x]), np.array([y, y, y, y0, y1]))
    assert dx[0] == pytest.approx((value[2] - value[1]) / (x1 - x0), abs=1e-4)
    assert dy[0] == pytest.approx((value[4] - value[3]) / (y1 - y0), abs=1e-4)


def test_value_and_first_two_derivatives_are_continuous_across_grid_lines() -> None:
    line, y = float(UNIFORM.x[5]), np.full(2, 1.234)
    h = 1e-9
    value, dx, _ = UNIFORM.evaluate(np.array([line - h, line + h]), y)
    assert value[0] == pytest.approx(value[1], abs=1e-8)
    assert dx[0] == pytest.approx(dx[1], abs=1e-7)
    h = 1e-4  # second derivative from differences of the first, which is quadratic on either side
    _, d, _ = UNIFORM.evaluate(np.array([line - 2 * h, line - h, line + h, line + 2 * h]), np.full(4, 1.234))
    assert (d[1] - d[0]) / h == pytest.approx((d[3] - d[2]) / h, abs=0.01)


def test_arguments_are_clamped_and_the_slope_is_zero_outside() -> None:
    x = np.array([-100.0, 50.0, 0.5, 0.5, -1e9])
    y = np.array([1.0, 1.0, -5.0, 99.0, 1e9])
    value, dx, dy = UNIFORM.evaluate(x, y)
    inside, _, _ = UNIFORM.evaluate(np.clip(x, -1.0, 2.0), np.clip(y, 0.0, 3.0))
    np.testing.assert_array_equal(value, inside)
    assert dx[[0, 1, 4]].tolist() == [0.0, 0.0, 0.0]
    assert dy[[2, 3, 4]].tolist() == [0.0, 0.0, 0.0]
    assert np.all(dx[[2, 3]] != 0.0)  # the other argument still has a slope
    assert np.all(dy[[0, 1]] != 0.0)


def test_non_uniform_data_is_resampled_and_its_error_told() -> None:
    x = np.array([0.0, 0.1, 0.3, 0.7, 1.5, 3.0])
    y = np.linspace(0.0, 3.0, 7)
    data = table(x, y)
    s = data.spline()
    assert s["n_x"] == 31  # 3.0 / smallest step 0.1, plus one
    assert s["x_step"] == pytest.approx(0.1)
    assert s["n_y"] == 7
    xx, yy = np.meshgrid(x, y, indexing="ij")
    off = np.abs(data.evaluate(xx.ravel(), yy.ravel())[0] - data.value.ravel())
    assert data.resampling_error == pytest.approx(off.max(), rel=1e-12)
    # All points lie on the finer grid here, so the resampled spline still goes through them.
    assert data.resampling_error < 1e-12


def test_points_off_the_uniform_grid_leave_an_honest_error() -> None:
    x = np.array([0.0, 0.37, 1.0, 1.9, 2.35, 3.0])
    data = TableData(x, x, np.where(x[:, None] > 1.5, 1.0, 0.0) + 0 * x[None, :], name="step")
    assert 1e-4 < data.resampling_error < 0.5  # a step of 1, seen through 8 uniform points


def test_a_needle_in_the_grid_does_not_exhaust_memory() -> None:
    x = np.array([0.0, 1e-9, 1.0, 2.0])
    data = TableData(x, np.arange(4.0), np.ones((4, 4)))
    assert data.spline()["n_x"] == 512  # the cap, instead of two thousand million points


@pytest.mark.parametrize(
    ("x", "y", "value", "message"),
    [
        ([0, 1, 2], [0, 1, 2, 3], (3, 4), "x needs at least 4 grid points; got 3"),
        ([0, 1, 2, 3], [0, 1], (4, 2), "y needs at least 4 grid points; got 2"),
        ([0, 1, 1, 3], [0, 1, 2, 3], (4, 4), "x must be finite and increasing"),
        ([0, 2, 1, 3], [0, 1, 2, 3], (4, 4), "x must be finite and increasing"),
        ([0, 1, 2, 3], [0, 1, np.nan, 3], (4, 4), "y must be finite and increasing"),
        ([0, 1, 2, np.inf], [0, 1, 2, 3], (4, 4), "x must be finite and increasing"),
        ([0, 1, 2, 3], [0, 1, 2, 3, 4], (5, 4), "values are (5, 4), the grid is (4, 5)"),
        ([[0, 1, 2, 3]], [0, 1, 2, 3], (4, 4), "x needs at least 4 grid points"),
    ],
)
def test_bad_grids_are_refused(x: Any, y: Any, value: tuple[int, ...], message: str) -> None:
    with pytest.raises(GustformError) as refusal:
        TableData(np.array(x, float), np.array(y, float), np.ones(value), name="cp.csv")
    assert refusal.value.code == "GF2010"
    assert f"cp.csv: {message}" in str(refusal.value)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_by_number(bad: float) -> None:
    value = np.ones((4, 5))
    value[1, 2] = bad
    with pytest.raises(GustformError, match="value number 7 is not finite"):  # 1 * 5 + 2
        TableData(np.arange(4.0), np.arange(5.0), value)

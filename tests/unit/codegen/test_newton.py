from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform_codegen.newton import newton

Array = NDArray[np.float64]
FREE = np.array([-np.inf, -np.inf]), np.array([np.inf, np.inf])


def circle(x: Array) -> Array:
    """x^2 + y^2 = 2 and x = y: (1, 1) and (-1, -1)."""
    return np.array([x[0] ** 2 + x[1] ** 2 - 2.0, x[0] - x[1]])


def circle_slopes(x: Array) -> Array:
    return np.array([[2.0 * x[0], 2.0 * x[1]], [1.0, -1.0]])


def test_it_comes_to_the_root_nearby() -> None:
    found = newton(circle, circle_slopes, np.array([1.1, 0.8]), *FREE)
    assert found is not None
    assert found[0] == pytest.approx([1.0, 1.0], abs=1e-11)
    assert found[1] <= 5  # quadratic: 1e-1, 1e-2, 1e-4, 1e-8, 1e-16


def test_a_start_that_solves_it_stays() -> None:
    found = newton(circle, circle_slopes, np.array([-1.0, -1.0]), *FREE)
    assert found is not None
    assert found[1] == 0
    assert np.array_equal(found[0], [-1.0, -1.0])


def test_a_value_between_equal_bounds_stays() -> None:
    def residual(x: Array) -> Array:
        return np.array([x[0] * x[1] - 6.0])

    def slopes(x: Array) -> Array:
        return np.array([[x[1], x[0]]])

    found = newton(residual, slopes, np.array([1.0, 2.0]), np.array([-9.0, 2.0]), np.array([9.0, 2.0]))
    assert found is not None
    assert found[0] == pytest.approx([3.0, 2.0], abs=1e-11)


@pytest.mark.parametrize(
    ("start", "low", "high"),
    [
        ([1.1, 0.8], [1.05, 0.0], [9.0, 9.0]),  # the root is out of bounds
        ([0.0, 0.0], [-9.0, -9.0], [9.0, 9.0]),  # singular
        ([1e-9, 0.0], [-9.9e9, -9.9e9], [9.9e9, 9.9e9]),  # the first step leads to 1e9
        ([np.nan, 0.0], [-9.0, -9.0], [9.0, 9.0]),
    ],
)
def test_it_says_when_it_finds_none(start: list[float], low: list[float], high: list[float]) -> None:
    assert newton(circle, circle_slopes, np.array(start), np.array(low), np.array(high)) is None


@pytest.mark.parametrize("start", [8.0, 100.0])
def test_where_whole_steps_leave_the_bounds_shorter_ones_do_not(start: float) -> None:
    """ln x = 0: the tangent at 8 is zero at 8 - 8 ln 8 < 0."""
    low, high = np.array([1e-9]), np.array([1e9])
    found = newton(np.log, lambda x: np.array([1.0 / x]), np.array([start]), low, high)
    assert found is not None
    assert found[0] == pytest.approx([1.0], abs=1e-11)


def test_where_whole_steps_are_thrown_from_side_to_side_shorter_ones_are_not() -> None:
    """atan x = 0 from 3: whole steps go to -9.5, 124, ..."""
    free = np.array([-np.inf]), np.array([np.inf])
    found = newton(np.arctan, lambda x: np.array([1.0 / (1.0 + x * x)]), np.array([3.0]), *free)
    assert found is not None
    assert found[0] == pytest.approx([0.0], abs=1e-11)


def test_one_of_many_roots_is_none() -> None:
    """x + y = 1 and 2 x + 2 y = 2: a line of roots."""

    def residual(x: Array) -> Array:
        return np.array([x[0] + x[1] - 1.0, 2.0 * (x[0] + x[1] - 1.0)])

    def slopes(x: Array) -> Array:
        return np.array([[1.0, 1.0], [2.0, 2.0]])

    assert newton(residual, slopes, np.array([0.0, 0.0]), *FREE) is None

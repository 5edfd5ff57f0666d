"""Modes of linear systems given as matrices: kinds of eigenvalues, participation, scale."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform_codegen.linear import LinearSystem, Quantity
from gustform_codegen.modes import CONSTANT, NEUTRAL, REFERENCE, STABLE, UNSTABLE, modes

Array = NDArray[np.float64]


def of(A: object, units: str = "", nominal: object = None) -> LinearSystem:
    """A system of that matrix; `units` gives a letter for each state, r for an angle."""
    matrix = np.array(A, dtype=float)
    n = matrix.shape[0]
    units = units or "1" * n
    states = [Quantity(f"x{k}", {"r": "rad"}.get(u, "1"), "") for k, u in enumerate(units)]
    none = np.zeros((n, 0))
    return LinearSystem(
        A=matrix, B=none, C=none.T, D=np.zeros((0, 0)), states=states, inputs=[], outputs=[], x0=np.zeros(n),
        u0=np.zeros(0), y0=np.zeros(0), nominal=np.ones(n) if nominal is None else np.array(nominal, dtype=float),
        bends=[], flats=[], held=[],
    )  # fmt: skip


def machines(reference: bool, damping: float = 0.5) -> LinearSystem:
    """Two machines, angles and speeds: d(delta)/dt = w - frame, dw/dt = -K (delta difference) - D w. The frame turns
    with the first one, or stands still."""
    K, D, w0 = 3.0, damping, 100.0
    frame = 1.0 if reference else 0.0
    return of(
        [
            [0.0, 0.0, w0 * (1.0 - frame), 0.0],
            [0.0, 0.0, -w0 * frame, w0],
            [-K / w0, K / w0, -D, 0.0],
            [K / w0, -K / w0, 0.0, -D],
        ],
        "rr11",
    )


@pytest.mark.parametrize("reference", [True, False])
def test_the_reference_angle_is_no_instability(reference: bool) -> None:
    found = modes(machines(reference))
    # difference of the angles: s^2 + D s + 2 K = 0; sum of the speeds: -D; all angles: 0
    expected = sorted([0.0, -0.5, *np.roots([1.0, 0.5, 6.0])], key=lambda v: (-v.real, -v.imag))
    np.testing.assert_allclose(found.eigenvalues, expected, atol=1e-12)
    assert found.kinds[0] == REFERENCE
    assert found.kinds[1:] == [STABLE] * 3
    assert found.stable
    np.testing.assert_allclose(found.right[:2, 0], found.right[0, 0], rtol=1e-9)
    assert found.rightmost.real == pytest.approx(-0.25)


def test_the_reference_angle_turns_phasors_too() -> None:
    """Currents that are states in the frame of the network turn with the angle; it is the reference all the same."""
    found = modes(of([[0.0, 0.0, 0.0], [4.0, -2.0, 1.0], [-3.0, -1.0, -2.0]], "r11"))
    assert sorted(found.kinds) == sorted([REFERENCE, STABLE, STABLE])
    assert found.stable


def test_without_damping_the_frequency_is_neutral() -> None:
    found = modes(machines(True, damping=0.0))
    assert sorted(found.kinds) == sorted([REFERENCE, NEUTRAL, NEUTRAL, NEUTRAL])  # +-j sqrt(6) do not fade either
    assert not found.stable
    neutral = next(m for m in found.listed if m.kind == NEUTRAL and abs(m.eigenvalue) < 1e-9)
    assert neutral.damping is None


def test_kinds() -> None:
    found = modes(of([[0.3, 0.0, 0.0], [1.0, -2.0, 5.0], [0.0, 0.0, 0.0]]))
    assert found.kinds == [UNSTABLE, CONSTANT, STABLE]
    assert not found.stable
    assert found.rightmost == pytest.approx(0.3)
    np.testing.assert_allclose(found.eigenvalues, [0.3, 0.0, -2.0])
    # with a constant the vectors are whole: A r = lambda r and l A = lambda l for all three
    A = np.array([[0.3, 0.0, 0.0], [1.0, -2.0, 5.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(A @ found.right, found.right * found.eigenvalues, atol=1e-12)
    np.testing.assert_allclose(found.left @ A, found.eigenvalues[:, None] * found.left, atol=1e-12)
    np.testing.assert_allclose(found.left @ found.right, np.eye(3), atol=1e-12)


def test_participation_of_a_triangle_and_of_two_alike() -> None:
    # a cascade: each mode belongs to its own state, whatever the coupling
    cascade = modes(of([[-1.0, 0.0], [50.0, -3.0]]))
    np.testing.assert_allclose(cascade.participation, np.eye(2), atol=1e-12)
    alike = modes(of([[-2.0, 1.0], [1.0, -2.0]]))
    np.testing.assert_allclose(alike.participation, 0.5, atol=1e-12)
    np.testing.assert_allclose(alike.eigenvalues, [-1.0, -3.0])


def test_participation_does_not_depend_on_units() -> None:
    rng = np.random.default_rng(4)
    A = rng.standard_normal((6, 6)) - 2.0 * np.eye(6)
    scale = 10.0 ** rng.uniform(-6.0, 6.0, 6)  # V beside pu beside W
    plain = modes(of(A))
    other = modes(of(A * scale[:, None] / scale, nominal=scale))
    np.testing.assert_allclose(other.eigenvalues, plain.eigenvalues, rtol=1e-9)
    np.testing.assert_allclose(other.participation, plain.participation, atol=1e-9)
    np.testing.assert_allclose(other.participation.sum(axis=0), 1.0)
    B = A * scale[:, None] / scale
    residual = B @ other.right - other.right * other.eigenvalues
    assert np.max(np.abs(residual) / scale[:, None]) < 1e-9
    np.testing.assert_allclose(other.left @ other.right, np.eye(6), atol=1e-9)


def test_conjugates_stand_together_and_are_listed_once() -> None:
    found = modes(of([[-1.0, 4.0, 0.0], [-4.0, -1.0, 0.0], [0.0, 0.0, -0.5]]))
    np.testing.assert_allclose(found.eigenvalues, [-0.5, -1.0 + 4.0j, -1.0 - 4.0j])
    assert [m.eigenvalue.imag for m in found.listed] == [0.0, pytest.approx(4.0)]
    assert found.listed[1].frequency == pytest.approx(4.0 / (2.0 * np.pi))
    assert found.listed[1].damping == pytest.approx(1.0 / np.sqrt(17.0))


def test_coinciding_modes_are_told() -> None:
    assert modes(of([[-1.0, 1.0], [0.0, -1.0]])).ill_conditioned  # a Jordan block: one eigenvector only
    assert not modes(of([[-1.0, 0.0], [0.0, -1.0]])).ill_conditioned  # the same eigenvalues, two eigenvectors

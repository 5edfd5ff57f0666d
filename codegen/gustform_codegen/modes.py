"""Modes of a linear system: eigenvalues, eigenvectors, participation factors.

    A r_i = lambda_i r_i,    l_i A = lambda_i l_i,    l_i r_i = 1,    p_ki = |l_ik r_ki| / sum_k |l_ik r_ki|

p_ki, the participation of state k in mode i, is without unit; it depends neither on the units nor on the scale of the
states. The eigenproblem is solved with every state in its nominal value. A state whose rate is zero whatever happens
(the angle of the machine that gives the phasor frame) is taken out before, because its eigenvalue 0 is known.
Source: Perez-Arriaga, Verghese, Schweppe 1982; Kundur, Power System Stability and Control, 12.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gustform_codegen.linear import LinearSystem, Quantity

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_ZERO = 1e-9  # eigenvalues below this share of the largest count as zero: round-off of the eigenproblem
_CONSTANT = 1e-14  # rates below this share of the largest count as zero
_ILL = 1e12  # condition of the eigenvectors above which modes cannot be told apart

REFERENCE, CONSTANT, NEUTRAL, UNSTABLE, STABLE = "reference angle", "constant", "neutral", "unstable", "stable"


@dataclass(frozen=True)
class Mode:
    """An eigenvalue (of a conjugate pair the one with positive imaginary part), 1/s, and who takes part in it."""

    number: int  # in the arrays of Modes
    eigenvalue: complex
    kind: str  # stable, unstable, neutral (0), reference angle (0), constant (0)
    participation: list[tuple[str, float]]  # falling

    @property
    def frequency(self) -> float:
        """Frequency of the oscillation, Hz."""
        return abs(self.eigenvalue.imag) / (2.0 * math.pi)

    @property
    def damping(self) -> float | None:
        """Damping ratio -Re/|lambda|; None for an eigenvalue 0."""
        if self.kind in (REFERENCE, CONSTANT, NEUTRAL):
            return None
        return -self.eigenvalue.real / abs(self.eigenvalue)


@dataclass(frozen=True, eq=False)
class Modes:
    """Eigenvalues from the least damped on; columns of `right` and rows of `left` belong to them, in physical units."""

    states: list[Quantity]
    eigenvalues: ComplexArray
    kinds: list[str]
    right: ComplexArray
    left: ComplexArray
    participation: Array  # (states, modes)
    condition: float  # of the right eigenvectors; large: modes that cannot be told apart

    @cached_property
    def stable(self) -> bool:
        """All eigenvalues have a negative real part, but for that of the reference angle and of constants."""
        return all(kind in (STABLE, REFERENCE, CONSTANT) for kind in self.kinds)

    @property
    def ill_conditioned(self) -> bool:
        """Participation factors mean nothing: some modes (nearly) coincide."""
        return not self.condition < _ILL

    @cached_property
    def listed(self) -> list[Mode]:
        """One entry for each real eigenvalue and each pair."""
        result = []
        for number, (value, kind) in enumerate(zip(self.eigenvalues, self.kinds, strict=True)):
            if value.imag < 0.0:
                continue
            column = self.participation[:, number]
            order = np.argsort(-column, kind="stable")
            result.append(Mode(number, complex(value), kind, [(self.states[k].name, float(column[k])) for k in order]))
        return result

    @property
    def rightmost(self) -> complex:
        """The eigenvalue with the largest real part, but for those of the reference angle and of constants."""
        some = [v for v, kind in zip(self.eigenvalues, self.kinds, strict=True) if kind not in (REFERENCE, CONSTANT)]
        return complex(max(some, key=lambda v: v.real)) if some else complex(-math.inf)


def modes(system: LinearSystem) -> Modes:
    """Solve the eigenproblem of A."""
    n, scale = len(system.states), system.nominal
    A = system.A * scale / scale[:, None]
    largest = float(np.abs(A).max(initial=0.0))
    constant = np.abs(A).max(axis=1, initial=0.0) <= _CONSTANT * largest
    free, fixed = np.flatnonzero(~constant), np.flatnonzero(constant)
    inner, cross = A[np.ix_(free, free)], A[np.ix_(free, fixed)]
    values, vectors = np.linalg.eig(inner)
    zero = np.abs(values) <= _ZERO * max(float(np.abs(values).max(initial=0.0)), 1e-300)
    condition = float(np.linalg.cond(vectors)) if free.size else 1.0
    left_inner = np.linalg.pinv(vectors) if not condition < _ILL else np.linalg.inv(vectors)
    # l A = lambda l over all states: what the fixed states do to a mode is l_inner cross / lambda
    right, left = np.zeros((n, n), complex), np.zeros((n, n), complex)
    m = free.size
    right[free, :m], left[:m, free] = vectors, left_inner
    left[:m, fixed] = np.where(zero[:, None], 0.0, left_inner @ cross / np.where(zero, 1.0, values)[:, None])
    for j, k in enumerate(fixed):
        right[k, m + j] = left[m + j, k] = 1.0
        right[free, m + j] = -np.linalg.lstsq(inner, cross[:, j], rcond=None)[0] if m else 0.0
    eigenvalues = np.concatenate([values.astype(complex), np.zeros(fixed.size, complex)])
    right, left = np.asarray(right * scale[:, None]), np.asarray(left / scale)
    limit = _ZERO * max(float(np.abs(values).max(initial=0.0)), 1e-300)
    kinds = []
    for i, value in enumerate(eigenvalues):
        if i >= m:  # an angle whose rate is always zero is the one all others are measured against
            kinds.append(REFERENCE if system.states[fixed[i - m]].unit == "rad" else CONSTANT)
        elif abs(value) <= limit:
            kinds.append(REFERENCE if _turns_all_angles(right[:, i], system) else NEUTRAL)
        else:
            kinds.append(UNSTABLE if value.real > limit else NEUTRAL if value.real > -limit else STABLE)
    share = np.abs(left.T * right)
    total = share.sum(axis=0)
    order = np.lexsort((-eigenvalues.imag, np.abs(eigenvalues.imag), -np.round(eigenvalues.real, 9)))
    return Modes(
        states=system.states,
        eigenvalues=eigenvalues[order],
        kinds=[kinds[i] for i in order],
        right=right[:, order],
        left=left[order],
        participation=(share / np.where(total > 0.0, total, 1.0))[:, order],
        condition=condition,
    )


def _turns_all_angles(vector: ComplexArray, system: LinearSystem) -> bool:
    """Whether a motion turns angles, all by the same amount, and leaves everything else alone."""
    size = np.abs(vector) / system.nominal
    moved = np.flatnonzero(size > 1e-6 * size.max())
    if any(system.states[k].unit != "rad" for k in moved):
        return False
    return bool(np.all(np.abs(vector[moved] - vector[moved[0]]) <= 1e-6 * abs(vector[moved[0]])))

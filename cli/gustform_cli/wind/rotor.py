"""From the wind at a point to the wind a whole rotor feels.

Eddies smaller than the rotor average out over it. As a linear filter of the point wind (an admittance of the rotor):

    H(s) = (sqrt(2) + b s) / ((sqrt(2) + b sqrt(a) s) (1 + b s / sqrt(a))),   a = 0.55,  b = 1.3 R / U

R rotor radius m, U mean wind m/s. H(0) = 1, so the mean and slow changes pass unchanged.

Where the wind is made here, H multiplies its spectrum. Where it comes from a file, `RotorWind` filters the samples:
H is the sum of two first-order lags, and each is solved exactly for the straight line between two samples, at any
distance of theirs.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_A = 0.55
_BLOCK = 8192  # samples
_MOST_STATES = 4096  # kept for going back; beyond, every other one goes

Reader = Callable[[int, int], tuple[NDArray[np.float64], NDArray[np.float64]]]


def rotor_effective(frequency: NDArray[np.float64], radius: float, mean: float) -> NDArray[np.complex128]:
    """H(j 2 pi f) for f in Hz."""
    a, b = _A, 1.3 * radius / mean
    s = 2j * math.pi * frequency
    result: NDArray[np.complex128] = (math.sqrt(2.0) + b * s) / (
        (math.sqrt(2.0) + b * math.sqrt(a) * s) * (1.0 + b * s / math.sqrt(a))
    )
    return result


class RotorWind:
    """The wind of `reader` at a point, as a rotor of `radius`, m, feels it in a mean wind `mean`, m/s.

    Samples go through in blocks of fixed numbers, and the state at the beginning of a block is what all samples before
    it make of it: a sample comes out the same to the last bit, whatever was asked for before. It starts in the steady
    state of the first sample. Going on at sample k in a new process filters the k samples before it once.
    """

    def __init__(self, reader: Reader, radius: float, mean: float) -> None:
        self._reader = reader
        b = 1.3 * radius / mean
        poles = np.array([math.sqrt(2.0) / (b * math.sqrt(_A)), math.sqrt(_A) / b])
        # H = sum of share_i / (1 + s / pole_i)
        shares = [(math.sqrt(2.0) - b * pole) / (math.sqrt(2.0) * (1.0 - pole / other))
                  for pole, other in zip(poles, poles[::-1], strict=True)]  # fmt: skip
        self._poles, self._shares = poles, np.array(shares)
        # Time of the sample before block k, its speed, and the two lags at that time.
        self._states: dict[int, tuple[float, float, float, float]] = {}
        self._stride = 1
        self._kept: dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}
        self._next: tuple[int, tuple[float, float, float, float]] | None = None

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1, fewer at the end."""
        times: list[NDArray[np.float64]] = []
        speeds: list[NDArray[np.float64]] = []
        done = 0
        while done < count:
            block, offset = divmod(first + done, _BLOCK)
            t, v = (part[offset : offset + count - done] for part in self._block(block))
            if t.size == 0:
                break
            times.append(t)
            speeds.append(v)
            done += t.size
        empty = np.empty(0)
        return np.concatenate([empty, *times]), np.concatenate([empty, *speeds])

    def _block(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if number not in self._kept:
            at = max((block for block in self._states if block <= number), default=0)
            if self._next is not None and at <= self._next[0] <= number:
                at = self._next[0]
            for passed in range(at, number):
                self._filter(passed)
            found = self._filter(number)
            while len(self._kept) >= 3:
                del self._kept[next(iter(self._kept))]
            self._kept[number] = found
        return self._kept[number]

    def _filter(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Samples of a block whose state is known; notes the state of the next."""
        times, speeds = self._reader(number * _BLOCK, _BLOCK)
        if times.size == 0:
            return times, speeds
        if self._next is not None and self._next[0] == number:
            state = self._next[1]
        elif number in self._states:
            state = self._states[number]
        else:  # number 0
            state = (float(times[0]), float(speeds[0]), float(speeds[0]), float(speeds[0]))
        if number % self._stride == 0:
            self._states[number] = state
            if len(self._states) > _MOST_STATES:
                self._stride *= 2
                self._states = {key: kept for key, kept in self._states.items() if key % self._stride == 0}
        step = np.diff(times, prepend=state[0])
        u = np.concatenate(([state[1]], speeds))
        lags = [_lag(step, u, pole, start) for pole, start in zip(self._poles, state[2:], strict=True)]
        self._next = number + 1, (float(times[-1]), float(speeds[-1]), float(lags[0][-1]), float(lags[1][-1]))
        result: NDArray[np.float64] = self._shares[0] * lags[0] + self._shares[1] * lags[1]
        return times, result


def _lag(step: NDArray[np.float64], u: NDArray[np.float64], pole: float, start: float) -> NDArray[np.float64]:
    """x' = pole (u - x) for u linear between samples: x at the end of each step, from x = start.

    x_n = e_n x_(n-1) + w_n, e = exp(-pole step). The chain is doubled log2(n) times, which keeps it in numpy and never
    divides by a vanishing e.
    """
    z = pole * step
    e = np.exp(-z)
    # Weights of the two ends of a straight line; series where the closed form cancels.
    rise = -np.expm1(-z)
    small = z < 1e-3
    ramp = np.where(small, z / 2.0 - z * z / 6.0 + z**3 / 24.0, 1.0 - rise / np.where(small, 1.0, z))
    w = ramp * u[1:] + (rise - ramp) * u[:-1]
    if w.size:
        w[0] += e[0] * start
        e[0] = 0.0
    reach = 1
    while reach < w.size:
        w[reach:] += e[reach:] * w[:-reach].copy()
        e[reach:] *= e[:-reach].copy()
        reach *= 2
    return w

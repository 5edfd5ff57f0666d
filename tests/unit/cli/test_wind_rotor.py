"""Point wind as a rotor feels it: the filter against its transfer function, from any sample on; and 3P."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from gustform.language.errors import GustformError
from gustform_cli.wind.rotor import RotorWind, rotor_effective
from gustform_cli.wind.three_p import BladeWind, check_spacing
from tests.unit.cli.wind_data import whole

RADIUS, MEAN = 63.0, 10.0


class Samples:
    """A reader of arrays that counts what is asked of it."""

    def __init__(self, times: NDArray[Any], speeds: NDArray[Any]) -> None:
        self.times, self.speeds, self.delivered = times, speeds, 0

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        self.delivered += min(count, max(0, self.times.size - first))
        return self.times[first : first + count], self.speeds[first : first + count]


@pytest.mark.parametrize("frequency", [0.002, 0.02, 0.1, 0.5])
def test_frequency_response(frequency: float) -> None:
    times = np.arange(0.0, 3000.0, 0.02)  # 100 samples a period at the highest frequency: 3e-4 by its straight lines
    speeds = MEAN + np.sin(2.0 * math.pi * frequency * times)
    _, out = whole(RotorWind(Samples(times, speeds), RADIUS, MEAN))
    settled = times > 1000.0  # the slower lag, 11 s, has died away; 2000 s are whole periods of all four
    phasor = 2.0 * np.mean((out - MEAN)[settled] * np.exp(-2j * math.pi * frequency * times[settled])) * 1j
    (wanted,) = rotor_effective(np.array([frequency]), RADIUS, MEAN)
    assert phasor == pytest.approx(wanted, abs=1e-3 * abs(wanted))


def test_exact_between_samples_at_any_distance() -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.01, 30.0, 200))
    speeds = rng.uniform(3.0, 20.0, 200)
    _, out = whole(RotorWind(Samples(times, speeds), RADIUS, MEAN))
    # The filter as differential equations: H = (sqrt2 + b s) / (sqrt2 + b sqrt(a) s) / (1 + b s / sqrt(a)).
    b, root = 1.3 * RADIUS / MEAN, math.sqrt(0.55)

    def slopes(t: float, x: NDArray[np.float64]) -> list[float]:
        u = float(np.interp(t, times, speeds))
        first = (u - x[0]) * root / b  # 1 / (1 + b s / root)
        return [first, (math.sqrt(2.0) * (x[0] - x[1]) + b * first) / (b * root)]

    x = np.array([speeds[0], speeds[0]])
    reference = [x[1]]
    for begin, end in pairwise(times):
        x = solve_ivp(slopes, (begin, end), x, rtol=1e-10, atol=1e-12).y[:, -1]
        reference.append(x[1])
    assert out == pytest.approx(np.array(reference), abs=1e-8)


def test_mean_and_calm_pass_unchanged() -> None:
    times = np.arange(0.0, 100.0, 0.05)
    _, out = whole(RotorWind(Samples(times, np.full(times.size, 9.5)), RADIUS, MEAN))
    assert out == pytest.approx(9.5, abs=1e-12)


def test_the_same_to_the_last_bit_from_any_sample_on() -> None:
    times = 0.05 * np.arange(200_000)
    speeds = np.random.default_rng(2).uniform(3.0, 20.0, times.size)
    source = Samples(times, speeds)
    reader = RotorWind(source, RADIUS, MEAN)
    _, out = whole(reader)
    assert source.delivered <= times.size, "each sample is read once"
    for first in (150_000, 20, 199_990, 65_536):
        assert np.array_equal(reader(first, 100)[1], out[first : first + 100])
        fresh = RotorWind(Samples(times, speeds), RADIUS, MEAN)
        assert np.array_equal(fresh(first, 100)[1], out[first : first + 100])
    reader(190_000, 10)
    before = source.delivered
    reader(100_000, 10)
    assert source.delivered - before <= 8192, "the state is known: one block, not all before it"
    assert reader(200_000, 10)[0].size == 0
    assert [part.size for part in reader(199_995, 10)] == [5, 5]


def test_blades() -> None:
    times = 0.05 * np.arange(2000)
    speed = 12.1 * math.pi / 30.0
    _, out = BladeWind(Samples(times, np.full(2000, 10.0)), 0.05, speed)(100, 1200)
    # 3 x 12.1 / min = 0.605 Hz with an amplitude of 5 % of 10 m/s.
    assert out == pytest.approx(10.0 + 0.5 * np.sin(2.0 * math.pi * 0.605 * times[100:1300]), abs=1e-9)
    check_spacing("wind.wt", 0.2, speed)  # 1.65 s a period
    with pytest.raises(GustformError, match=r"GF2513.*wind.wt.three_p needs samples every 0.207 s"):
        check_spacing("wind.wt", 0.25, speed)

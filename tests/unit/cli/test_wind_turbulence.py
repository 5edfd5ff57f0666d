"""Turbulent wind: spectrum, standard deviation, and that a block follows from seed and number alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gustform_cli.wind.kaimal import Kaimal, length_scale, standard_deviation
from gustform_cli.wind.rotor import rotor_effective
from gustform_cli.wind.turbulence import LOWEST_SPEED, TurbulentWind

STEP = 0.05
GOLDEN = [12.936615225750396, 13.214305665337815, 12.99657340886669]
CLASS_B = Kaimal(mean=10.0, sigma=standard_deviation("B", 10.0), length=length_scale(90.0))


def wind(seed: int = 1, turbine: int = 1, radius: float | None = None) -> TurbulentWind:
    return TurbulentWind(CLASS_B, step=STEP, seed=(seed, turbine), radius=radius)


def test_iec_figures() -> None:
    assert standard_deviation("B", 10.0) == pytest.approx(1.834, abs=1e-12)
    assert standard_deviation("A", 15.0) == pytest.approx(0.16 * (0.75 * 15 + 5.6))
    assert length_scale(90.0) == pytest.approx(340.2)
    assert length_scale(30.0) == pytest.approx(8.1 * 21.0)


def test_kaimal_integral_is_the_variance() -> None:
    frequency = np.geomspace(1e-6, 1e4, 20_000)
    numeric = np.trapezoid(CLASS_B.density(frequency) * frequency, np.log(frequency))
    assert numeric == pytest.approx(CLASS_B.sigma**2, rel=1e-3)  # the rest lies beyond 10 kHz
    assert CLASS_B.variance_below(np.array([1e9]))[0] == pytest.approx(CLASS_B.sigma**2, rel=1e-5)


def test_standard_deviation_of_point_wind() -> None:
    # Variance about the true mean over 300 independent stretches of 819 s. A stretch holds some 20 independent values
    # (integral time scale L/U = 34 s), so the estimate scatters by about 1 / sqrt(2 * 300 * 20) = 1 %.
    squares = [np.mean((wind(seed)(0, 16_384)[1] - 10.0) ** 2) for seed in range(300)]
    assert math.sqrt(np.mean(squares)) == pytest.approx(1.834, rel=0.03)


def test_variance_is_the_same_at_every_moment_of_a_block() -> None:
    samples = np.array([wind(seed)(0, 16_384)[1] for seed in range(400)]) - 10.0
    by_moment = np.sqrt((samples**2).mean(axis=0).reshape(8, -1).mean(axis=1))
    assert by_moment == pytest.approx(1.834, rel=0.12)  # 400 values, several per stretch: 2-3 %, four sigma


def test_spectrum_follows_kaimal() -> None:
    size = 8192
    window = np.hanning(size)
    power = np.zeros(size // 2 + 1)
    count = 0
    for seed in range(40):
        samples = wind(seed)(0, 8 * size)[1] - 10.0
        for start in range(0, samples.size - size + 1, size // 2):
            power += np.abs(np.fft.rfft(samples[start : start + size] * window)) ** 2
            count += 1
    power *= 2.0 * STEP / (window**2).sum() / count
    frequency = np.fft.rfftfreq(size, STEP).astype(np.float64)
    for low, high in ((0.006, 0.02), (0.02, 0.1), (0.1, 0.5), (0.5, 2.0), (2.0, 9.0)):
        band = (frequency >= low) & (frequency < high)
        ratio = float(np.mean(power[band] / CLASS_B.density(frequency[band])))
        assert ratio == pytest.approx(1.0, abs=0.06), f"{low} ... {high} Hz"  # 600 spectra, many bins: below 3 %


def test_rotor_filter() -> None:
    gain = np.abs(rotor_effective(np.array([0.0, 0.01, 0.1, 1.0, 10.0]), 63.0, 10.0))
    assert gain[0] == 1.0
    assert np.all(np.diff(gain) < 0.0)
    # Well above the corner it falls with 1/f: H -> b s / (b sqrt(a) s * b s / sqrt(a)) = 1 / (b s).
    assert gain[-1] == pytest.approx(10.0 / (1.3 * 63.0 * 2.0 * math.pi * 10.0), rel=1e-2)
    point, rotor = wind()(0, 16_384)[1], wind(radius=63.0)(0, 16_384)[1]
    assert np.abs(np.diff(rotor)).max() < 0.2 * np.abs(np.diff(point)).max()
    assert np.corrcoef(point, rotor)[0, 1] > 0.7  # the same gusts, smoother and later


def test_a_block_needs_seed_and_number_only() -> None:
    source = wind()
    in_order = np.concatenate([source.block(k) for k in range(4)])
    assert np.array_equal(wind().block(3), in_order[3 * source.block_size :])
    again = wind()
    again.block(7)
    assert np.array_equal(again.block(0), in_order[: source.block_size])
    assert np.array_equal(wind()(0, 12_000)[1], in_order[:12_000])


@pytest.mark.parametrize("piece", [1, 7, 4096, 100_000])
def test_samples_do_not_depend_on_how_they_are_read(piece: int) -> None:
    whole = wind()(0, 20_000)
    total = 20_000 if piece > 1 else 300
    source = wind()
    parts = [source(first, min(piece, total - first)) for first in range(0, total, piece)]
    assert np.array_equal(np.concatenate([times for times, _ in parts]), whole[0][:total])
    assert np.array_equal(np.concatenate([speeds for _, speeds in parts]), whole[1][:total])


def test_blocks_join_without_a_jump() -> None:
    source = wind()
    samples = source(0, 5 * source.block_size)[1]
    steps = np.abs(np.diff(samples))
    seams = steps[source.block_size - 1 :: source.block_size]
    assert seams.max() < 5.0 * steps.std() + steps.mean()


def test_streams_are_independent() -> None:
    one = wind(1, 1)(0, 100_000)[1]
    for other in (wind(2, 1), wind(1, 2)):
        assert abs(np.corrcoef(one, other(0, 100_000)[1])[0, 1]) < 0.2  # some 150 independent values: 0.08


def test_the_first_samples_stay_for_ever() -> None:
    # Results of published scenarios hang on these; the generator must not drift with numpy's version.
    assert wind()(0, 3)[1] == pytest.approx(GOLDEN, rel=1e-12)


def test_wind_never_stands_still() -> None:
    gusty = TurbulentWind(Kaimal(mean=2.0, sigma=1.5, length=340.2), step=1.0, seed=(1,))
    assert gusty(0, 100_000)[1].min() == LOWEST_SPEED

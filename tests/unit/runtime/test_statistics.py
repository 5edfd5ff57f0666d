"""Statistics against numpy, SciPy and rainflow on the same samples."""

from __future__ import annotations

import numpy as np
import pytest
import rainflow
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from gustform.language.system import Series
from gustform_runtime import Keep, RunError, Simulation, Statistics, Status
from tests.unit.runtime.lag import Array, lag_table

DT = 0.05


def gusty(n: int, seed: int = 1) -> Array:
    """Wind-like: slow and fast parts, quantised as measured data are, with level stretches."""
    random = np.random.default_rng(seed)
    slow = signal.lfilter([0.01], [1.0, -0.99], random.normal(size=n))
    return np.asarray(np.round(9.0 + 8.0 * slow + 0.3 * random.normal(size=n), 2), dtype=np.float64)


def filled(keep: Keep, values: Array, pieces: int = 1) -> Statistics:
    statistics = Statistics([keep], 1, DT)
    times = DT * np.arange(values.size)
    for part in np.array_split(np.arange(values.size), pieces):
        statistics.add(times[part], values[part])
    return statistics


@pytest.mark.parametrize("n", [1, 2, 7, 255, 256, 257, 5000])
def test_moments_are_numpys(n: int) -> None:
    values = gusty(n)
    found = filled(Keep(0), values, pieces=min(n, 7)).moments()
    assert (found.count, found.not_finite) == (n, 0)
    assert found.mean == pytest.approx(values.mean(), rel=1e-14)
    assert found.deviation == pytest.approx(values.std(), rel=1e-12, abs=1e-14)
    assert (found.minimum, found.maximum) == (values.min(), values.max())
    assert (found.t_minimum, found.t_maximum) == (DT * np.argmin(values), DT * np.argmax(values))


def test_moments_stay_exact_over_ten_million_rows() -> None:
    """The goal is 1e-10; the second column has a mean a million times its deviation."""
    statistics = Statistics([Keep(0), Keep(1)], 2, DT)
    random = np.random.default_rng(3)
    everything = []
    for k in range(10):
        values = np.stack([random.normal(9.0, 2.0, 1_000_000), random.normal(1e6, 1.0, 1_000_000)], axis=1)
        statistics.add(DT * (1e6 * k + np.arange(1e6)), values)
        everything.append(values)
    whole = np.concatenate(everything)
    for k in range(2):
        found = statistics.moments(k)
        exact = whole[:, k].astype(np.longdouble)
        mean = exact.mean()
        deviation = np.sqrt(((exact - mean) ** 2).mean())
        assert found.count == 10_000_000
        assert abs(found.mean - mean) <= 1e-13 * abs(mean)
        assert abs(found.deviation - deviation) <= 1e-10 * deviation
        assert abs(found.mean - whole[:, k].mean()) <= 1e-10 * abs(mean)
        assert abs(found.deviation - whole[:, k].std()) <= 1e-10 * deviation


@pytest.mark.parametrize(
    "edges",
    [np.linspace(0.0, 25.0, 26), np.linspace(7.0, 11.0, 41), np.array([0.0, 8.99, 9.0, 9.01, 30.0]),
     np.geomspace(0.1, 40.0, 200), np.array([8.0, 10.0])],
)  # fmt: skip
def test_histogram_is_numpys(edges: Array) -> None:
    values = gusty(20_000)
    found = filled(Keep(0, edges=edges), values, pieces=11).histogram()
    expected, _ = np.histogram(values, edges)
    assert found.count.tolist() == expected.tolist()
    assert found.below == np.sum(values < edges[0])
    assert found.above == np.sum(values > edges[-1])
    assert found.count.sum() + found.below + found.above == values.size


@pytest.mark.parametrize("segment", [8, 64, 1024, 4096])
def test_spectrum_is_scipys(segment: int) -> None:
    values = gusty(segment * 9 + 77)
    found = filled(Keep(0, segment=segment), values, pieces=5).spectrum()
    frequency, density = signal.welch(values, fs=1.0 / DT, nperseg=segment)
    assert found.segments == (values.size - segment // 2) // (segment // 2)
    np.testing.assert_allclose(found.frequency, frequency, rtol=1e-14)
    # The goal is 1e-6. The mean is taken off before, so the smallest densities carry the rounding of the largest.
    np.testing.assert_allclose(found.density, density, rtol=1e-9, atol=1e-14 * density.max())


def counted(values: Array) -> tuple[list[float], dict[float, float]]:
    cycles = list(rainflow.extract_cycles(values.tolist()))
    return [c[2] for c in cycles], {m: sum(c[2] * c[0] ** m for c in cycles) for m in (1.0, 3.0, 4.0, 10.0, 3.5)}


@pytest.mark.parametrize("n", [1, 2, 3, 4, 10, 257, 40_000])
def test_cycles_are_those_of_the_rainflow_package(n: int) -> None:
    values = gusty(n)
    exponents = (1.0, 3.0, 4.0, 10.0, 3.5)
    found = filled(Keep(0, exponents=exponents, ranges=40, range_width=0.25), values, pieces=min(n, 6)).cycles()
    counts, damage = counted(values)
    assert (found.full, found.half, found.forced) == (counts.count(1.0), counts.count(0.5), 0)
    np.testing.assert_allclose(found.damage, [damage[m] for m in exponents], rtol=1e-12)
    ranges = [(c[0], c[2]) for c in rainflow.extract_cycles(values.tolist())]
    bins = np.zeros(41)
    for size, count in ranges:
        bins[min(int(size / 0.25), 40)] += count
    assert found.cycles.tolist() == bins.tolist()
    if ranges:
        assert found.largest == max(size for size, _ in ranges)
        load = found.equivalent(exponents, n * DT)
        assert load[1] == pytest.approx((damage[3.0] / (n * DT)) ** (1.0 / 3.0), rel=1e-12)


@given(st.lists(st.integers(-5, 5), max_size=60))
def test_cycles_of_any_samples(numbers: list[int]) -> None:
    """Small integers: level stretches and equal ranges, where implementations differ."""
    values = np.array(numbers, dtype=np.float64)
    found = filled(Keep(0, exponents=(1.0,)), values, pieces=3).cycles()
    counts, damage = counted(values)
    assert (found.full, found.half) == (counts.count(1.0), counts.count(0.5))
    assert found.damage[0] == damage[1.0]


def test_an_endless_residue_is_bounded() -> None:
    """An oscillation that decays by so little that more ranges stay open than there is room for."""
    n = 6000
    values: Array = np.where(np.arange(n) % 2, 1.0, -1.0)
    values *= 1.0 - 1e-5 * np.arange(n)
    found = filled(Keep(0, exponents=(3.0,)), values).cycles()
    counts, damage = counted(values)
    assert counts.count(1.0) == 0  # nothing closes
    # Everything beyond the room of 4096 is counted as full cycles, each instead of two half ones of nearly its range.
    assert found.forced == found.full > 900
    assert found.full + found.half / 2 == pytest.approx(sum(counts), abs=1.0)
    assert found.damage[0] == pytest.approx(damage[3.0], rel=1e-4)


def test_asking_changes_nothing_and_portions_do_not_matter() -> None:
    values = gusty(5000)
    keep = Keep(0, edges=np.linspace(0, 20, 21), segment=64, exponents=(4.0,), ranges=10, range_width=1.0)
    whole = filled(keep, values)
    asked = Statistics([keep], 1, DT)
    for k in range(values.size):
        asked.add([DT * k], [[values[k]]])
        if k % 333 == 0:
            asked.moments()
            asked.histogram()
            asked.spectrum()
            asked.cycles()
    assert asked.save() == whole.save()


def test_state_goes_on_in_another_object() -> None:
    values = gusty(4000)
    keep = Keep(0, edges=np.linspace(0, 20, 21), segment=128, exponents=(4.0,), ranges=10, range_width=1.0)
    whole, first, second = filled(keep, values), filled(keep, values[:1777]), Statistics([keep], 1, DT)
    second.restore(first.save())
    second.add(DT * np.arange(1777, 4000), values[1777:])
    assert second.save() == whole.save()
    with pytest.raises(RunError, match="FOREIGN_CHECKPOINT"):
        Statistics([Keep(0, segment=256)], 1, DT).restore(first.save())
    state = first.save()
    for wrong in (b"", state[:50], state[:-1], state + b"x", b"GUSTSTA2" + state[8:]):
        with pytest.raises(RunError, match="BAD_CHECKPOINT"):
            second.restore(wrong)
    for k in range(0, len(state), 97):
        spoilt = bytearray(state)
        spoilt[k] ^= 0x10
        with pytest.raises(RunError, match="CHECKPOINT"):
            second.restore(bytes(spoilt))


def test_samples_that_are_no_numbers_are_left_out() -> None:
    values = gusty(3000)
    spoilt = values.copy()
    spoilt[[5, 900, 901, 2999]] = [np.nan, np.inf, -np.inf, np.nan]
    kept = spoilt[np.isfinite(spoilt)]
    keep = Keep(0, edges=np.linspace(0, 20, 21), segment=64, exponents=(4.0,))
    statistics = filled(keep, spoilt)
    found = statistics.moments()
    assert (found.count, found.not_finite) == (2996, 4)
    assert found.mean == pytest.approx(kept.mean(), rel=1e-13)
    assert statistics.histogram().count.tolist() == np.histogram(kept, keep.edges)[0].tolist()
    assert statistics.cycles().full == counted(kept)[0].count(1.0)
    # A spectrum closes no gap: the segments of the stretches between.
    stretches = [spoilt[6:900], spoilt[902:2999]]
    parts = [signal.welch(s, fs=1.0 / DT, nperseg=64)[1] for s in stretches]
    weights = [(s.size - 32) // 32 for s in stretches]
    assert statistics.spectrum().segments == sum(weights)
    np.testing.assert_allclose(statistics.spectrum().density, np.average(parts, axis=0, weights=weights), rtol=1e-9)


@pytest.mark.parametrize(
    ("keep", "says"),
    [
        (Keep(1), "no such column"),
        (Keep(-1), "no such column"),
        (Keep(0, edges=[1.0]), "ascending"),
        (Keep(0, edges=[1.0, 1.0]), "ascending"),
        (Keep(0, edges=[0.0, np.nan]), "ascending"),
        (Keep(0, segment=100), "power of two"),
        (Keep(0, segment=-8), "power of two"),
        (Keep(0, exponents=[0.0]), "greater than 0"),
        (Keep(0, ranges=4), "width"),
    ],
)
def test_settings_are_checked(keep: Keep, says: str) -> None:
    with pytest.raises(RunError, match=says) as caught:
        Statistics([keep], 1, DT)
    assert caught.value.code == Status.BAD_ARGUMENT


def test_what_is_not_kept_cannot_be_asked_for() -> None:
    statistics = Statistics([Keep(0)], 1, DT)
    assert np.isnan(statistics.moments().mean)
    for ask in (statistics.histogram, statistics.spectrum, statistics.cycles):
        with pytest.raises(RunError, match="channel 0 "):
            ask()
    with pytest.raises(RunError, match="no channel 3"):
        statistics.moments(3)
    with pytest.raises(RunError, match="shape"):
        statistics.add([0.0], [[1.0, 2.0]])
    for interval in (0.0, np.nan, np.inf):
        with pytest.raises(RunError, match="interval"):
            Statistics([Keep(0)], 1, interval)
    with pytest.raises(RunError, match="at least one"):
        Statistics([], 1, DT)
    statistics.close()
    with pytest.raises(RunError, match="closed"):
        statistics.moments()


def test_a_simulation_feeds_them_on_their_own_grid() -> None:
    """Rows stored each second, statistics from rows each 50 ms after a transient: those of a run that stores these."""
    values = gusty(4001)
    table = lag_table(Series("wind", 9.0, dt=DT, value=values, on_end="hold"))
    keep = [Keep(1, segment=256), Keep(0, exponents=(4.0,))]
    coarse: list[Array] = []
    fine: list[Array] = []

    def run(interval: float, to: list[Array], statistics: Statistics | None) -> None:
        with Simulation(table.to_bytes()) as simulation:
            simulation.set_sink(interval, lambda t, rows: to.append(np.column_stack([t, rows])))
            if statistics is not None:
                simulation.set_statistics(statistics, 20.0)
            simulation.initialise(0.0)
            simulation.advance(200.0)

    online = Statistics(keep, 2, DT)
    run(1.0, coarse, online)
    run(DT, fine, None)
    assert np.concatenate(coarse).shape[0] == 201
    rows = np.concatenate(fine)
    rows = rows[rows[:, 0] > 20.0 - DT / 2]
    assert online.moments(0).count == rows.shape[0] == 3601
    # Stored rows are single precision.
    for channel, column in ((0, 2), (1, 1)):
        found = online.moments(channel)
        assert found.mean == pytest.approx(rows[:, column].mean(), abs=1e-6)
        assert found.deviation == pytest.approx(rows[:, column].std(), rel=1e-6)
        assert found.maximum == pytest.approx(rows[:, column].max(), rel=1e-7)
        assert found.t_maximum == pytest.approx(rows[np.argmax(rows[:, column]), 0], abs=1e-9)
    _, density = signal.welch(rows[:, 2], fs=1.0 / DT, nperseg=256)
    np.testing.assert_allclose(online.spectrum(0).density, density, rtol=1e-4, atol=1e-9)
    assert online.cycles(1).damage[0] == pytest.approx(counted(rows[:, 1])[1][4.0], rel=1e-5)


def test_statistics_must_fit_the_simulation() -> None:
    table = lag_table(Series("wind", 9.0, dt=1.0, value=np.ones(3), on_end="hold"))
    with Simulation(table.to_bytes()) as simulation:
        with pytest.raises(RunError, match="rows of 3 columns, and the simulation has 2 channels"):
            simulation.set_statistics(Statistics([Keep(0)], 3, DT), 0.0)
        with pytest.raises(RunError, match="start"):
            simulation.set_statistics(Statistics([Keep(0)], 2, DT), float("nan"))
        simulation.initialise(0.0)
        with pytest.raises(RunError, match="before initialise"):
            simulation.set_statistics(Statistics([Keep(0)], 2, DT), 0.0)

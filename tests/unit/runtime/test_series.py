"""PCHIP in the runtime against SciPy's, through blocks, ends and shapes of every kind."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from gustform.language.system import Series
from gustform_codegen.table import SystemTable
from gustform_runtime import Simulation
from tests.unit.runtime.lag import Array, lag_table, values_of

BLOCK = 16  # samples; the smallest there is, so that borders are everywhere


def samples(seed: int, n: int) -> tuple[Array, Array]:
    """Stamps with uneven spacing; values that rise, turn and stay level."""
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(0.05, 2.0, n))
    values = np.round(random.normal(8.0, 3.0, n), 1)
    values[random.uniform(size=n) < 0.3] = 8.0
    return times - times[0], values


def interpolated(table: SystemTable, times: Array, stamps: Array | None, values: Array, blocks: bool) -> Array:
    """What the runtime makes of the samples: all at once, or read in blocks."""
    series = table.series[0]
    if blocks:
        table = dataclasses.replace(
            table,
            series=[dataclasses.replace(series, value=None, time=None if stamps is None else np.empty(0), source=1)],
        )
    with Simulation(table.to_bytes()) as simulation:
        if blocks:
            simulation.set_option("series_block", BLOCK)

            def read(first: int, count: int) -> tuple[Array, Array]:
                part = slice(first, first + count)
                return (values[part] if stamps is None else stamps[part]), values[part]

            simulation.set_series_reader(0, read)
        simulation.initialise(0.0)
        return values_of(simulation, times)


@pytest.mark.parametrize("blocks", [False, True])
@pytest.mark.parametrize("n", [2, 3, 4, 15, 16, 17, 31, 33, 200])
@pytest.mark.parametrize("uniform", [False, True])
def test_pchip_is_scipys(uniform: bool, n: int, blocks: bool) -> None:
    uneven, values = samples(n, n)
    stamps = np.linspace(0.0, 0.25 * (n - 1), n) if uniform else uneven
    if uniform:
        source = Series("wind", 8.0, dt=0.25, value=values, interpolation="pchip", on_end="hold")
    else:
        source = Series("wind", 8.0, time=stamps, value=values, interpolation="pchip", on_end="hold")
    at = np.sort(np.concatenate([np.linspace(0.0, stamps[-1], 997), stamps]))
    got = interpolated(lag_table(source), at, None if uniform else stamps, values, blocks)
    # The same formulas in another order: rounding only.
    np.testing.assert_allclose(got, PchipInterpolator(stamps, values)(at), rtol=1e-12, atol=1e-12)
    backwards = interpolated(lag_table(source), at[::-1], None if uniform else stamps, values, blocks)
    assert np.array_equal(backwards[::-1], got)


@settings(max_examples=40)
@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(-1e6, 1e6)), min_size=2, max_size=40))
def test_pchip_is_scipys_for_any_samples(pairs: list[tuple[float, float]]) -> None:
    stamps = np.cumsum([gap for gap, _ in pairs])
    stamps = stamps - stamps[0]
    values = np.array([value for _, value in pairs])
    source = Series("wind", 8.0, time=stamps, value=values, interpolation="pchip", on_end="hold")
    at = np.linspace(0.0, stamps[-1], 211)
    with np.errstate(over="ignore", divide="ignore"):  # SciPy's weights at nearly level samples
        expected = PchipInterpolator(stamps, values)(at)
    got = interpolated(lag_table(source), at, stamps, values, blocks=True)
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(values)))


def test_only_jumps_stop_the_integrator() -> None:
    """Linear and PCHIP are run through; a held series stops at each sample that differs from the one before."""
    values = np.repeat(8.0 + np.sin(np.arange(50.0)), 2)
    counts = {}
    for kind in ("linear", "pchip", "hold"):
        table = lag_table(Series("wind", 8.0, dt=1.0, value=values, interpolation=kind, on_end="hold"))
        with Simulation(table.to_bytes()) as simulation:
            simulation.initialise(0.0)
            simulation.advance(99.5)
            counts[kind] = simulation.statistics()["events"]
    assert counts == {"linear": 0, "pchip": 0, "hold": 49}

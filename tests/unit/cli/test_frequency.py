"""Nadir, settling frequency and rate of change from blocks of rows."""

from __future__ import annotations

import numpy as np
import pytest

from gustform_cli.frequency import FrequencyWatch

EVERY = 0.02


def response(times: np.ndarray) -> np.ndarray:
    """50 Hz, from 30 s on a damped dip whose figures are known: slope -0.5 Hz/s, then back to 49.7 Hz."""
    after = np.maximum(times - 30.0, 0.0)
    return 50.0 - 0.3 * (1.0 - np.exp(-after / 5.0)) - 0.44 * after * np.exp(-after)


@pytest.mark.parametrize("block", [1, 7, 1024, 10_000])
def test_figures_do_not_depend_on_the_blocks(block: int) -> None:
    times = np.arange(0.0, 100.0 + EVERY / 2, EVERY)
    values = response(times)
    watch = FrequencyWatch(event=30.0, until=100.0)
    for first in range(0, times.size, block):
        watch.add(times[first : first + block], values[first : first + block])
    figures = watch.summary(EVERY)
    lowest = int(np.argmin(values))
    assert figures["nadir_hz"] == values[lowest]
    assert figures["nadir_time_s"] == times[lowest]
    assert figures["settle_hz"] == pytest.approx(response(np.array([90.0]))[0], abs=1e-12)
    assert figures["rocof_hz_per_s"] == pytest.approx((response(np.array([30.1]))[0] - 50.0) / 0.1, rel=1e-9)


def test_the_nadir_is_sought_after_the_event() -> None:
    watch = FrequencyWatch(event=10.0, until=20.0)
    watch.add(np.array([0.0, 10.0, 20.0]), np.array([49.0, 50.0, 49.8]))
    assert watch.summary(EVERY)["nadir_hz"] == 49.8


def test_settling_is_the_end_of_a_shorter_run() -> None:
    watch = FrequencyWatch(event=10.0, until=30.0)
    watch.add(np.array([0.0, 10.0, 20.0]), np.array([50.0, 50.0, 49.9]))
    assert watch.summary(EVERY)["settle_hz"] == 49.9, "interrupted"
    watch.add(np.array([30.0]), np.array([49.7]))
    assert watch.summary(EVERY)["settle_hz"] == 49.7


def test_nothing_is_invented() -> None:
    assert set(FrequencyWatch(event=10.0, until=30.0).summary(EVERY).values()) == {None}
    calm = FrequencyWatch(event=None, until=30.0)
    calm.add(np.array([0.0, 30.0]), np.array([50.0, 49.9]))
    assert calm.summary(EVERY) == {
        "nadir_hz": 49.9, "nadir_time_s": 30.0, "settle_hz": 49.9, "rocof_hz_per_s": None,
    }  # fmt: skip
    coarse = FrequencyWatch(event=10.0, until=30.0)
    coarse.add(np.array([0.0, 10.0, 20.0]), np.array([50.0, 50.0, 49.0]))
    assert coarse.summary(every=10.0)["rocof_hz_per_s"] is None, "rows every 10 s do not show 0.1 s"

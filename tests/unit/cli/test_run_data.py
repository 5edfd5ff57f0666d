"""Thinning for figures keeps the extremes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gustform_cli.run_data import _envelope


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=200), st.integers(2, 17))
def test_the_envelope_holds_the_extremes_of_every_bin(values: list[float], rows: int) -> None:
    data = np.array(values)
    thin = _envelope(data, rows)
    whole = data.size // rows
    assert thin.size == 2 * whole + (1 if data.size % rows else 0)
    for k in range(whole):
        bin_ = data[k * rows : (k + 1) * rows]
        assert {thin[2 * k], thin[2 * k + 1]} == {bin_.min(), bin_.max()}


def test_times_and_instances_keep_their_shape() -> None:
    times = np.arange(10.0)
    assert _envelope(times, 4).tolist() == [0.0, 3.0, 4.0, 7.0, 9.0]
    table = np.stack([times, -times], axis=1)
    # The extremes of an increasing and of a decreasing column come at the same places.
    assert _envelope(table, 4).tolist() == [[0.0, 0.0], [3.0, -3.0], [4.0, -4.0], [7.0, -7.0], [9.0, -9.0]]
    assert _envelope(times, 1) is times

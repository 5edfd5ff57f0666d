"""Winds by a formula: figures of IEC 61400-1 by hand."""

from __future__ import annotations

import numpy as np
import pytest

from gustform_cli.wind.gusts import ecg, eog, eog_amplitude, ramp


def test_operating_gust() -> None:
    # Class I B, 12 m/s, D = 126 m, hub 90 m: sigma_1 = 0.14 (9 + 5.6) = 2.044; 3.3 * 2.044 / (1 + 12.6 / 42) = 5.18862;
    # V_e1 = 0.8 * 1.4 * 50 = 56, 1.35 * 44 = 59.4 is more.
    amplitude = eog_amplitude(12.0, "I", "B", 90.0, 126.0)
    assert amplitude == pytest.approx(5.188615, abs=1e-6)
    times, speeds = eog(12.0, amplitude, 30.0)
    assert (times[0], times[1], times[-1]) == (0.0, 30.0, 40.5)
    assert speeds[[0, 1, -1]] == pytest.approx(12.0, abs=1e-12)
    # At T/2: sin(3 pi / 2) = -1, 1 - cos(pi) = 2: the top, 12 + 0.74 V_gust; at T/6: sin = 1, 1 - cos(pi/3) = 1/2.
    assert speeds.max() == pytest.approx(12.0 + 0.74 * amplitude, abs=1e-9)
    assert np.interp(30.0 + 10.5 / 6.0, times, speeds) == pytest.approx(12.0 - 0.185 * amplitude, abs=1e-9)
    # With x = pi t/T the least is where tan 3x = -1.5 tan x, so tan^2 x = 9/11 and sin^2 x = 0.45.
    dip = 0.37 * 2.0 * (3.0 * 0.45**0.5 - 4.0 * 0.45**1.5) * 0.45
    assert speeds.min() == pytest.approx(12.0 - dip * amplitude, abs=1e-4)


def test_operating_gust_near_the_extreme_wind() -> None:
    # Class III: V_e1 = 42 m/s; at 41 m/s 1.35 * 1 = 1.35 is the smaller one.
    assert eog_amplitude(41.0, "III", "C", 90.0, 126.0) == pytest.approx(1.35)
    assert eog_amplitude(43.0, "III", "C", 90.0, 126.0) < 0.0


def test_coherent_gust() -> None:
    times, speeds = ecg(10.0, 15.0, 20.0)
    assert (times[-1], speeds[-1]) == (30.0, pytest.approx(25.0))
    assert np.interp(25.0, times, speeds) == pytest.approx(17.5)
    assert np.interp(20.0 + 10.0 / 3.0, times, speeds) == pytest.approx(10.0 + 3.75, abs=1e-4)  # cos(60 deg)


def test_ramp() -> None:
    times, speeds = ramp(8.0, 12.0, 5.0, 10.0)
    assert times.tolist() == [0.0, 5.0, 15.0]
    assert speeds.tolist() == [8.0, 8.0, 12.0]
    assert ramp(8.0, 12.0, 0.0, 10.0)[0].tolist() == [0.0, 10.0]

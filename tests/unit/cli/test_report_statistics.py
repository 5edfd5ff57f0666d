"""Statistics of stored channels against numpy and scipy, and the axes and numbers of charts."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.integrate
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from gustform_cli.report import axis, numbers
from gustform_cli.report.channel_statistics import histogram, moments, octaves, spectrum
from gustform_cli.report.report import write_report
from tests.support.html_page import Page
from tests.support.run_folders import write_result

ROWS = 200_000  # more than three blocks


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    draw = np.random.default_rng(1)
    time = np.linspace(0.0, 0.05 * (ROWS - 1), ROWS)
    noise = scipy.signal.lfilter([0.1], [1.0, -0.9], draw.standard_normal(ROWS))
    channels = {
        "wt.wind": ("m/s", 10.0 + noise),
        "sg.frequency": ("Hz", 50.0 + 1e-3 * noise),
        "wt.P": ("W", 1e6 * np.stack([10.0 + noise, 20.0 + draw.standard_normal(ROWS)], axis=1)),
    }
    return write_result(tmp_path_factory.mktemp("run") / "result.nc", time, channels)


@pytest.mark.parametrize("name", ["wt.wind", "sg.frequency", "wt.P"])
def test_moments_are_numpy_s(result: Path, name: str) -> None:
    with h5py.File(result) as file:
        found = moments(file[name], file["time"])
        values, time = np.asarray(file[name], np.float64), np.asarray(file["time"])
    # Sums of 2e5 values in double precision.
    assert found.mean == pytest.approx(values.mean(), rel=1e-12)
    assert found.std == pytest.approx(values.std(), rel=1e-9)
    assert (found.low, found.high) == (values.min(), values.max())
    whole = values.reshape(ROWS, -1).sum(axis=1)
    assert found.integral == pytest.approx(float(scipy.integrate.trapezoid(whole, time)), rel=1e-12)


def test_the_spectrum_is_scipy_s(result: Path) -> None:
    with h5py.File(result) as file:
        frequency, density = spectrum(file["wt.wind"], 0.05, 4096)
        values = np.asarray(file["wt.wind"], np.float64)
    wanted = scipy.signal.welch(values, fs=20.0, window="hann", nperseg=4096, noverlap=2048, detrend="constant")
    np.testing.assert_allclose(frequency, wanted[0], rtol=1e-12)
    # both in double precision over the same float32 rows
    np.testing.assert_allclose(density, wanted[1], rtol=1e-9)
    # Parseval: the integral of the density is the variance, but for what is slower than a segment.
    assert np.trapezoid(density, frequency) == pytest.approx(values.var(), rel=0.05)


def test_bands_keep_the_mean_density() -> None:
    frequency = np.linspace(0.0, 10.24, 1025)
    across, density = octaves(frequency, np.full(1025, 3.0))
    assert np.all(density == pytest.approx(3.0))
    assert np.all(np.diff(across) > 0.0)
    assert across.size < 130  # ten octaves


def test_the_histogram_is_numpy_s(result: Path) -> None:
    with h5py.File(result) as file:
        values = np.asarray(file["wt.wind"], np.float64)
        edges, share = histogram(file["wt.wind"], values.min(), values.max(), 40)
    counts, wanted = np.histogram(values, 40)
    np.testing.assert_allclose(edges, wanted)
    assert share.sum() == pytest.approx(1.0)
    # An edge may round to the other side of a value.
    np.testing.assert_allclose(share * ROWS, counts, atol=2.0)


def test_a_turbulent_run_shows_distributions_and_spectra(result: Path) -> None:
    text = write_report(result.parent).read_text()
    page = Page(text)
    assert "Spectral densities" in page.text
    assert "(m/s)²/Hz" in page.text
    assert "turbulence intensity" in page.text
    # 200,000 rows are thinned to what a screen can show
    assert len(text) < 300_000


def test_a_step_of_wind_is_no_turbulence(tmp_path: Path) -> None:
    time = np.linspace(0.0, 100.0, 2001)
    write_result(tmp_path / "result.nc", time, {"wt.wind": ("m/s", np.where(time < 50.0, 8.0, 9.0))})
    assert "Spectral densities" not in write_report(tmp_path).read_text()


# ---- axes and numbers -----------------------------------------------------------------------------------------------
@given(st.floats(-1e9, 1e9), st.floats(0.0, 1e9))
def test_an_axis_holds_its_values_and_has_some_ticks(low: float, span: float) -> None:
    made = axis.linear(low, low + span)
    assert made.low <= low <= low + span <= made.high
    assert 2 <= len(made.ticks) <= 8
    assert all(made.low <= tick <= made.high for tick in made.ticks)
    assert len(set(made.texts)) == len(made.texts)


@given(st.floats(1e-3, 1e9), st.floats(0.0, 1e9))
def test_time_axes_have_some_ticks(span: float, begin: float) -> None:
    made = axis.time(begin, begin + span)
    assert len(made.ticks) <= 10
    assert made.label in ("time, s", "time, h", "time, d")


def test_time_is_in_the_unit_of_its_span() -> None:
    assert axis.time(0.0, 600.0).texts == ("0", "100", "200", "300", "400", "500", "600")
    assert axis.time(0.0, 86400.0).texts == ("0", "3", "6", "9", "12", "15", "18", "21", "24")
    assert axis.time(0.0, 86400.0).label == "time, h"
    assert axis.time(0.0, 365 * 86400.0).label == "time, d"


@given(st.floats(1e-12, 1e12), st.floats(1.0, 1e12))
def test_decades_have_their_ends_in_place(low: float, ratio: float) -> None:
    made = axis.decades(low, low * ratio)
    assert made.place(made.low) == pytest.approx(0.0)
    assert made.place(made.high) == pytest.approx(1.0)
    assert len(made.ticks) >= 1


@pytest.mark.parametrize(
    ("value", "text"),
    [(49.64160, "49.64"), (0.0123456, "0.01235"), (1026.0, "1026"), (1.23e-7, "1.230e-07"), (0.0, "0"), (-0.5, "-0.5")],
)
def test_significant_digits(value: float, text: str) -> None:
    assert numbers.significant(value) == text


def test_numbers_without_a_value_are_a_dash() -> None:
    assert numbers.significant(math.nan) == numbers.fixed(math.inf, 2) == "–"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (90.0, "90 s"),
        (600.0, "10 min"),
        (86400.0, "24 h"),
        (365 * 86400.0, "365 d"),
        (0.5, "0.5 s"),
        (7290.0, "2.025 h"),
    ],
)
def test_spans_of_time(seconds: float, text: str) -> None:
    assert numbers.duration(seconds) == text


def test_decimals_show_the_spread() -> None:
    # 49.9912 +- 0.0012 needs four or five decimals, 32.8 +- 9.4 one.
    assert numbers.places(0.0074, 50.001) == 5
    assert numbers.places(43.8, 54.1) == 1
    assert numbers.places(0.0, 0.0) == 0


def test_units_get_prefixes_where_they_have_them() -> None:
    assert numbers.scale("W", 2.1e7) == (1e6, "MW")
    assert numbers.scale("pu", 2.1e7) == (1.0, "pu")
    assert numbers.scale("kg*m^2", 1e9) == (1.0, "kg·m²")

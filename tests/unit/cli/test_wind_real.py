"""Measured and published wind files, each against another reading of it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.wind.bladed import bladed_box
from gustform_cli.wind.box import BoxWind, disc_weights, hub_weights
from gustform_cli.wind.clean import LOWEST_SPEED, Policy
from gustform_cli.wind.csv_file import Columns, CsvFile
from gustform_cli.wind.mann import mann_box
from gustform_cli.wind.stamps import Clock
from gustform_cli.wind.survey import Survey, TableWind, survey
from gustform_cli.wind.turbsim import turbsim_box
from gustform_cli.wind.uniform_file import UniformFile
from tests.unit.cli.wind_data import DATA, whole

LHB = DATA / "lhb" / "la-haute-borne_R80711_2014-2015.csv.gz"
MAST = DATA / "brightwind" / "demo_data_80m_10min.csv.gz"
M5 = DATA / "nwtc_m5" / "2015_April.csv.gz"
WEATHER = DATA / "windpowerlib" / "weather.csv.gz"
END = 1e12


def look(
    file: Path, time: str | int, speed: str | int, until: float = END, *, header_rows: int = 1, **policy: Any
) -> Survey:
    return survey(CsvFile(file, Columns(time, speed, header_rows=header_rows), Clock()), Policy(**policy), until)


def pandas_says(series: pd.Series[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Seconds and speeds of the valid rows that come later than all before, calm raised."""
    series = series[
        series.index > series.index.to_series().cummax().shift(fill_value=series.index.min() - pd.Timedelta("1s"))
    ]
    series = series.dropna()
    seconds = (series.index - series.index[0]) / pd.Timedelta("1s")
    return seconds.to_numpy(np.float64), np.maximum(series.to_numpy(np.float64), LOWEST_SPEED)


def test_la_haute_borne() -> None:
    frame = pd.read_csv(LHB)
    index = pd.to_datetime(frame["Date_time"], utc=True)
    with pytest.raises(GustformError) as caught:
        look(LHB, "Date_time", "Ws_avg")
    error = caught.value
    # Facts of SOURCES.md: 475 NaN, 12 duplicate stamps, 2 gaps (6 steps of missing rows, at the changes of the clock).
    assert (error.code, "475 values missing or NaN" in error.message) == ("GF2505", True)
    assert "12 duplicate stamps" in error.message
    first_missing = int(np.flatnonzero(frame["Ws_avg"].isna())[0])
    assert error.place is not None
    assert error.place.line == first_missing + 2, "the header is line 1"
    found = look(LHB, "Date_time", "Ws_avg", gaps="interpolate", longest_gap=2 * 86400.0)
    times, speeds = whole(TableWind(found))
    expected = pandas_says(pd.Series(frame["Ws_avg"].to_numpy(), index=pd.DatetimeIndex(index)))
    assert np.array_equal(times, expected[0])
    assert np.array_equal(speeds, expected[1])
    steps = np.diff(expected[0])
    assert found.findings.gaps.count == np.count_nonzero(steps > 900.0)
    assert found.findings.longest == steps.max()
    assert found.findings.duplicate.count == index.duplicated().sum() == 12
    assert found.mean == pytest.approx(np.trapezoid(speeds, times) / times[-1], rel=1e-12)
    skipped = look(LHB, "Date_time", "Ws_avg", gaps="skip")
    assert np.array_equal(whole(TableWind(skipped))[0], 600.0 * np.arange(times.size)), "closed up, it has no gap left"
    assert skipped.findings.removed == times[-1] - 600.0 * (times.size - 1)
    held = look(LHB, "Date_time", "Ws_avg", gaps="hold", longest_gap=2 * 86400.0)
    grid = np.arange(0.0, times[-1] + 1.0, 600.0)
    filled = pd.Series(speeds, index=times).reindex(grid, method="ffill").to_numpy()
    assert np.array_equal(np.interp(grid, *whole(TableWind(held))), filled)
    for first in (104_000, 50, 70_001):
        assert np.array_equal(TableWind(found)(first, 20)[1], speeds[first : first + 20])


def test_brightwind_mast() -> None:
    frame = pd.read_csv(MAST, index_col="Timestamp", parse_dates=True)
    with pytest.raises(GustformError, match=r"GF2510.*2 gaps, the longest 19.68 d"):
        look(MAST, "Timestamp", "Spd80mN")
    times, speeds = whole(TableWind(look(MAST, "Timestamp", "Spd80mN", gaps="interpolate", longest_gap=30 * 86400.0)))
    expected = pandas_says(frame["Spd80mN"])
    assert np.array_equal(times, expected[0])
    assert np.array_equal(speeds, expected[1])


def test_nwtc_m5_mast() -> None:
    frame = pd.read_csv(M5, index_col="Date")
    frame.index = pd.to_datetime(frame.index, utc=True)
    found = look(M5, "Date", "Speed (cup_ 80 m)", gaps="interpolate", longest_gap=86400.0)
    times, speeds = whole(TableWind(found))
    expected = pandas_says(frame["Speed (cup_ 80 m)"])
    assert np.array_equal(times, expected[0])
    assert np.array_equal(speeds, expected[1])
    assert found.table.shown(0.0) == "2015-04-01 00:00:00-06:00"
    with pytest.raises(GustformError, match=r"GF2503.*try Speed \(cup_ 8"):
        look(M5, "Date", "Speed (cup_ 81 m)")


def test_windpowerlib_weather() -> None:
    frame = pd.read_csv(WEATHER, index_col=0, header=[0, 1])
    found = look(WEATHER, 1, "wind_speed 80", header_rows=2)
    times, speeds = whole(TableWind(found))
    assert np.array_equal(times, 3600.0 * np.arange(8760))
    assert np.array_equal(speeds, np.maximum(frame[("wind_speed", "80")].to_numpy(), LOWEST_SPEED))
    by_number = look(WEATHER, 1, 7, header_rows=2)
    assert np.array_equal(whole(TableWind(by_number))[1], speeds)


@pytest.mark.parametrize(
    "name", ["rosco/NoShr_3-15_50s", "rosco/long_step_wind", "rosco/NoShr_9-14_Inc1_50s", "turbsim/FASTWnd"]
)
def test_uniform_files(name: str) -> None:
    file = DATA / f"{name}.wnd"
    raw = np.loadtxt(file, comments="!")
    rows = pd.DataFrame(raw[:, [0, 1]] + raw[:, [3, 7]] * [0, 1]).drop_duplicates().to_numpy()  # no vertical wind there
    times, speeds = whole(TableWind(survey(UniformFile(file, Clock()), Policy(), END)))
    assert np.array_equal(times, rows[:, 0])
    assert np.array_equal(speeds, rows[:, 1])


@pytest.mark.parametrize("name", ["TurbSim_FAST", "TurbSim_NoTwr", "TurbSim_WithTwr"])
def test_turbsim_files(name: str) -> None:
    from openfast_io.turbsim_file import TurbSimFile

    other = TurbSimFile(str(DATA / "turbsim" / f"{name}.bts"))
    u = np.asarray(other["u"][0], dtype=np.float64)  # (time, y, z)
    box = turbsim_box(DATA / "turbsim" / f"{name}.bts")
    assert (box.planes, box.dt) == (u.shape[0], 0.05)
    assert box.y == pytest.approx(other["y"], abs=1e-4)
    assert box.z == pytest.approx(other["z"], abs=1e-4)
    hub = np.array([_at_hub(plane, other["y"], other["z"], 90.0) for plane in u])
    assert whole(BoxWind(box, hub_weights(box)))[1][:-1] == pytest.approx(hub, abs=2e-5)
    inside = np.hypot(*np.meshgrid(other["y"], other["z"] - 90.0, indexing="ij")) <= 30.0
    assert whole(BoxWind(box, disc_weights(box, 30.0)[0]))[1][:-1] == pytest.approx(u[:, inside].mean(axis=1), abs=2e-5)


def _at_hub(plane: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64], hub: float) -> float:
    columns = [np.interp(hub, z, column) for column in plane]
    return float(np.interp(0.0, y, columns))


@pytest.mark.parametrize("shape", [(32, 4, 8), (2, 4, 8)])
def test_mann_files(shape: tuple[int, int, int]) -> None:
    file = DATA / "turbsim" / "MannBox_{}x{}x{}.bin".format(*shape)
    u = np.fromfile(file, np.float32).reshape(shape).astype(np.float64)
    box = mann_box(file, shape, (3.0, 5.0, 6.0), mean=10.0, scale=1.0)
    middle = 10.0 + u[:, 1:3, 3:5].mean(axis=(1, 2))
    assert whole(BoxWind(box, hub_weights(box)))[1][:-1] == pytest.approx(np.maximum(middle, LOWEST_SPEED), rel=1e-6)
    everywhere, said = disc_weights(box, 100.0)
    assert "averaged over the 32 points" in said[0]
    mean = 10.0 + u.mean(axis=(1, 2))
    assert whole(BoxWind(box, everywhere))[1][:-1] == pytest.approx(np.maximum(mean, LOWEST_SPEED), rel=1e-6)


def test_bladed_file() -> None:
    file = DATA / "turbsim" / "pyTurbSim_movie_bladed.wnd"
    data = file.read_bytes()
    # By hand from a hex dump: header of 80 bytes and six length scales, TI_u at byte 20, U at 48, 694 x 15 x 15 x 3.
    (intensity,), (mean,) = struct.unpack("<f", data[20:24]), struct.unpack("<f", data[48:52])
    assert (intensity, mean) == (pytest.approx(6.1048, abs=1e-4), pytest.approx(2.131817, abs=1e-6))
    u = np.frombuffer(data[104:], "<i2").reshape(694, 15, 15, 3)[..., 0] / 1000.0
    box = bladed_box(file)
    assert (box.planes, box.dt, box.hub) == (694, 0.05, 16.0)
    hub = mean * (1.0 + intensity / 100.0 * u[:, 7, 7])
    assert whole(BoxWind(box, hub_weights(box)))[1] == pytest.approx(hub, rel=1e-6)
    # What TurbSim promises of the file: mean and intensity at the hub, with a few eddies only.
    assert hub.std() / hub.mean() == pytest.approx(intensity / 100.0, rel=0.1)
    assert hub.mean() == pytest.approx(mean, rel=0.05)

"""Wind from Parquet, netCDF, uniform files, and full-field boxes: made here, read back, broken."""

from __future__ import annotations

import struct
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.wind.bladed import bladed_box
from gustform_cli.wind.box import Box, BoxWind, disc_weights, hub_weights
from gustform_cli.wind.clean import Policy
from gustform_cli.wind.csv_file import Columns
from gustform_cli.wind.mann import mann_box
from gustform_cli.wind.netcdf_file import NetcdfFile
from gustform_cli.wind.parquet_file import ParquetFile
from gustform_cli.wind.stamps import Clock
from gustform_cli.wind.survey import TableWind, survey
from gustform_cli.wind.turbsim import turbsim_box
from gustform_cli.wind.uniform_file import UniformFile
from tests.unit.cli.wind_data import whole

COUNT = 100_000
RNG = np.random.default_rng(3)
SPEEDS = RNG.uniform(3.0, 20.0, COUNT)
FIRST = datetime(2015, 3, 29, 0, 0)


def fault(act: Callable[[], Any]) -> GustformError:
    with pytest.raises(GustformError) as caught:
        act()
    assert caught.value.hint
    return caught.value


# ---- Parquet --------------------------------------------------------------------------------------------------------
def parquet(path: Path, times: Any, speeds: Any = SPEEDS, groups: int = 30_000) -> Path:
    pq.write_table(pa.table({"when": times, "v": speeds}), path, row_group_size=groups)
    return path


def test_parquet_with_numbers(tmp_path: Path) -> None:
    file = parquet(tmp_path / "w.parquet", 0.05 * np.arange(COUNT) / 60.0, SPEEDS * 3.6)
    table = ParquetFile(file, Columns("when", 2, 1.0 / 3.6), Clock(60.0))
    found = survey(table, Policy(), 1e9)
    times, speeds = whole(TableWind(found))
    assert times == pytest.approx(0.05 * np.arange(COUNT), abs=1e-9)
    assert speeds == pytest.approx(SPEEDS, rel=1e-14)
    assert len(found.index) >= 4
    for first in (99_000, 31_000, 65_535):
        assert np.array_equal(TableWind(found)(first, 5)[1], speeds[first : first + 5])


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Paris"])
def test_parquet_with_timestamps(tmp_path: Path, zone: str | None) -> None:
    moments = pa.array([FIRST + timedelta(minutes=10 * k) for k in range(1000)], pa.timestamp("us"))
    stamps = moments if zone is None else moments.cast(pa.timestamp("us", zone))
    file = parquet(tmp_path / "w.pq", stamps, SPEEDS[:1000])
    table = ParquetFile(file, Columns("when", "v"), Clock(start=FIRST + timedelta(hours=1)))
    found = survey(table, Policy(), 3600.0)
    times, speeds = TableWind(found)(0, 100)
    assert times.tolist() == [600.0 * k for k in range(7)]
    assert np.array_equal(speeds, SPEEDS[6:13])
    assert table.shown(0.0).startswith("2015-03-29 01:00:00")


def test_parquet_local_time_with_a_zone(tmp_path: Path) -> None:
    utc = [datetime(2015, 3, 28, 23, 0, tzinfo=UTC) + timedelta(minutes=30 * k) for k in range(20)]
    from zoneinfo import ZoneInfo

    local = [moment.astimezone(ZoneInfo("Europe/Paris")).replace(tzinfo=None) for moment in utc]
    file = parquet(tmp_path / "w.pq", pa.array(local, pa.timestamp("ms")), SPEEDS[:20])
    found = survey(ParquetFile(file, Columns("when", "v"), Clock(zone="Europe/Paris")), Policy(), 1e9)
    assert TableWind(found)(0, 30)[0].tolist() == [1800.0 * k for k in range(20)]


def test_broken_parquet(tmp_path: Path) -> None:
    good = parquet(tmp_path / "w.parquet", np.arange(10.0), SPEEDS[:10])
    clock = Clock()
    error = fault(lambda: ParquetFile(good, Columns("when", "speed"), clock))
    assert (error.code, "when, v" in error.message) == ("GF2503", True)
    assert fault(lambda: ParquetFile(tmp_path / "none.parquet", Columns(), clock)).code == "GF2501"
    cut = tmp_path / "cut.parquet"
    cut.write_bytes(good.read_bytes()[:-50])
    assert fault(lambda: ParquetFile(cut, Columns("when", "v"), clock)).code == "GF2508"
    cut.write_text("time,speed\n0,8\n")
    assert fault(lambda: ParquetFile(cut, Columns("when", "v"), clock)).code == "GF2508"
    words = parquet(tmp_path / "words.parquet", np.arange(2.0), ["calm", "storm"])
    assert fault(lambda: ParquetFile(words, Columns("when", "v"), clock)).code == "GF2505"
    empty = parquet(tmp_path / "empty.parquet", np.empty(0), np.empty(0))
    assert fault(lambda: ParquetFile(empty, Columns("when", "v"), clock)).code == "GF2502"
    holes = parquet(tmp_path / "holes.parquet", np.arange(4.0), [8.0, None, float("nan"), 9.0])
    error = fault(lambda: survey(ParquetFile(holes, Columns("when", "v"), clock), Policy(), 3.0))
    assert "2 values missing or NaN in rows 2 (1 s), 3 (2 s)" in error.message
    assert error.place is not None
    assert error.place.line == 0, "an editor has no line for a row of a binary file"


# ---- netCDF ---------------------------------------------------------------------------------------------------------
def netcdf(path: Path, times: Any, speeds: Any, **attributes: Any) -> Path:
    data = xarray.Dataset({"v": ("time", speeds, attributes)}, coords={"time": times})
    data.to_netcdf(path, engine="h5netcdf")
    return path


def nc(path: Path, clock: Clock | None = None, columns: Columns | None = None, **units: str | None) -> NetcdfFile:
    said = {"time_unit": None, "speed_unit": None, **units}
    return NetcdfFile(path, columns or Columns("time", "v"), clock or Clock(), **said)


def test_netcdf_knows_its_units(tmp_path: Path) -> None:
    moments = np.datetime64("2015-04-01T00:00", "ns") + np.arange(1000) * np.timedelta64(10, "m")
    file = netcdf(tmp_path / "w.nc", moments, SPEEDS[:1000] * 3.6, units="km/h")
    found = survey(nc(file, Clock(start=datetime(2015, 4, 1, 1, 0))), Policy(), 1e9)
    times, speeds = whole(TableWind(found))
    assert times.tolist() == [600.0 * k for k in range(994)]
    assert speeds == pytest.approx(SPEEDS[6:1000], rel=1e-14)
    assert np.array_equal(TableWind(found)(990, 3)[1], speeds[990:993])
    seconds = netcdf(
        tmp_path / "s.nc", ("time", np.arange(0.0, 5.0, 0.5), {"units": "min"}), SPEEDS[:10], units="m s-1"
    )
    found = survey(nc(seconds), Policy(), 1e9)
    assert whole(TableWind(found))[0].tolist() == [30.0 * k for k in range(10)]
    scenario = survey(nc(seconds, Clock(3600.0), time_unit="h"), Policy(), 1e9)
    assert scenario.last == 4.5 * 3600.0, "what the scenario says goes first"


def test_netcdf_packing(tmp_path: Path) -> None:
    file = tmp_path / "p.nc"
    data = xarray.Dataset({"v": ("time", [8.0, np.nan, 9.5])}, coords={"time": np.arange(3.0)})
    data.to_netcdf(
        file,
        engine="h5netcdf",
        encoding={"v": {"dtype": "i2", "scale_factor": 0.5, "add_offset": 1.0, "_FillValue": -1}},
    )
    found = survey(nc(file), Policy("interpolate"), 1e9)
    assert [part.tolist() for part in TableWind(found)(0, 9)] == [[0.0, 2.0], [8.0, 9.5]]


def test_broken_netcdf(tmp_path: Path) -> None:
    good = netcdf(tmp_path / "w.nc", np.arange(3.0), SPEEDS[:3])
    assert fault(lambda: nc(tmp_path / "none.nc")).code == "GF2501"
    error = fault(lambda: nc(good, columns=Columns("time", "speed")))
    assert (error.code, "time, v" in error.message or "v, time" in error.message) == ("GF2503", True)
    cut = tmp_path / "cut.nc"
    cut.write_bytes(good.read_bytes()[:-500])
    assert fault(lambda: nc(cut)).code == "GF2508"
    cut.write_bytes(b"CDF\x01" + bytes(100))
    assert "nccopy" in fault(lambda: nc(cut)).hint
    odd = netcdf(tmp_path / "odd.nc", np.arange(3.0), SPEEDS[:3], units="kg")
    assert fault(lambda: nc(odd)).code == "GF2303"
    lunar = netcdf(tmp_path / "lunar.nc", ("time", np.arange(3.0), {"units": "moons since creation"}), SPEEDS[:3])
    assert fault(lambda: nc(lunar)).code == "GF2511"
    year = netcdf(
        tmp_path / "year.nc",
        ("time", np.arange(3.0), {"units": "days since 2000-01-01", "calendar": "360_day"}),
        SPEEDS[:3],
    )
    assert fault(lambda: nc(year)).code == "GF2511"


# ---- uniform --------------------------------------------------------------------------------------------------------
def test_uniform(tmp_path: Path) -> None:
    file = tmp_path / "w.hh"
    file.write_text(
        "! made here\n0 8 0 0 0 0 0 0\n10 8 0 0 0 0 0 1 ! a gust\n10 8 0 0 0 0 0 1\n\n20 9 0 0 0 0.2 0 0 7\n"
    )
    table = UniformFile(file, Clock())
    assert table.warnings == ("vertical shear in the file: left out, the turbine does not know them",)
    found = survey(table, Policy(), 1e9)
    assert [part.tolist() for part in TableWind(found)(0, 9)] == [[0.0, 10.0, 20.0], [8.0, 9.0, 9.0]]
    for text, line, part in (
        ("0 8 0 0 0 0 0 0\n1 8 0 0\n", 2, "got 4"),
        ("Time Wind\n0 8 0 0 0 0 0 0\n", 1, "'Time Wind'"),
        ("\x00\x01\x02\n", 1, "8 numbers"),
    ):
        file.write_text(text)
        error = fault(lambda: survey(UniformFile(file, Clock()), Policy(), 1.0))
        assert (error.code, error.place and error.place.line) == ("GF2508", line)
        assert part in error.message
    file.write_text("! nothing\n")
    assert fault(lambda: survey(UniformFile(file, Clock()), Policy(), 1.0)).code == "GF2502"
    file.write_text("0 8 0 0 0 0 0 0\n1 8 0 0 0 0 0 0\n1 9 0 0 0 0 0 0\n2 9 0 0 0 0 0 0\n")
    error = fault(lambda: survey(UniformFile(file, Clock()), Policy(), 2.0))
    assert (error.code, error.place and error.place.line) == ("GF2504", 3), "two speeds at one time"


# ---- boxes ----------------------------------------------------------------------------------------------------------
PLANES, NZ, NY = 40, 5, 4


def turbsim(path: Path, field: NDArray[np.float64], *, kind: int = 8, tower: int = 2, cut: int = 0) -> Path:
    """A .bts file of the speeds (plane, z, y): dz 10 m, dy 12 m, dt 0.1 s, hub at 50 m, bottom at 30 m."""
    planes, nz, ny = field.shape
    slope, intercept = 1000.0, -10_000.0
    text = b"by a test"
    raw = np.zeros((planes, 3 * (nz * ny + tower)), dtype="<i2")
    raw[:, : 3 * nz * ny].reshape(planes, nz, ny, 3)[..., 0] = np.round(field * slope + intercept)
    head = struct.pack(
        "<h4i12fi",
        kind,
        nz,
        ny,
        tower,
        planes,
        10.0,
        12.0,
        0.1,
        8.0,
        50.0,
        30.0,
        slope,
        intercept,
        1,
        0,
        1,
        0,
        len(text),
    )
    data = head + text + raw.tobytes()
    path.write_bytes(data[: len(data) - cut])
    return path


def field() -> NDArray[np.float64]:
    return np.random.default_rng(4).uniform(4.0, 12.0, (PLANES, NZ, NY)).round(3)


def samples(box: Box, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    return whole(BoxWind(box, weights))[1]


def test_turbsim_box(tmp_path: Path) -> None:
    speeds = field()
    box = turbsim_box(turbsim(tmp_path / "w.bts", speeds))
    assert (box.dt, box.mean, box.planes, box.periodic) == (0.1, 8.0, PLANES, True)
    assert box.duration == pytest.approx(4.0)
    # The hub, 50 m, is row 2; y = 0 lies between columns 1 and 2.
    hub = 0.5 * (speeds[:, 2, 1] + speeds[:, 2, 2])
    assert samples(box, hub_weights(box)) == pytest.approx(np.append(hub, hub[0]), abs=1e-12)
    # 15 m round the hub: y = +-6 m in rows 1, 2 and 3.
    disc = speeds[:, 1:4, 1:3].mean(axis=(1, 2))
    weights, said = disc_weights(box, 15.0)
    assert samples(box, weights) == pytest.approx(np.append(disc, disc[0]), abs=1e-12)
    assert not said
    assert "does not cover" in disc_weights(box, 40.0)[1][0]
    ending = turbsim_box(turbsim(tmp_path / "end.bts", speeds, kind=7, tower=0))
    assert ending.samples == PLANES
    assert ending.duration == pytest.approx(3.9)


def test_box_from_any_sample_on(tmp_path: Path) -> None:
    speeds = np.random.default_rng(5).uniform(4.0, 12.0, (60_000, NZ, NY)).round(3)
    box = turbsim_box(turbsim(tmp_path / "w.bts", speeds))
    reader = BoxWind(box, hub_weights(box))
    times, values = whole(reader)
    for first in (59_990, 3, 30_000):
        got = BoxWind(box, hub_weights(box))(first, 50)
        assert np.array_equal(got[1], values[first : first + 50])
        assert np.array_equal(got[0], times[first : first + 50])
    assert reader(60_001, 1)[0].size == 0


def test_broken_turbsim(tmp_path: Path) -> None:
    file = tmp_path / "w.bts"
    assert fault(lambda: turbsim_box(file)).code == "GF2501"
    error = fault(lambda: turbsim_box(turbsim(file, field(), cut=1)))
    assert (error.code, "planes of 4 x 5 points" in error.message) == ("GF2508", True)
    for data in (b"", b"\x08\x00", b"time,speed\n0,8\n" * 10, struct.pack("<h4i12fi", 7, -1, 3, 0, 5, *[1.0] * 12, 0)):
        file.write_bytes(data)
        assert fault(lambda: turbsim_box(file)).code == "GF2508"


def mann(path: Path) -> NDArray[np.float32]:
    u = np.random.default_rng(6).normal(size=(16, NY, NZ)).astype("<f4")
    path.write_bytes(u.tobytes())
    return u


def test_mann_box(tmp_path: Path) -> None:
    u = mann(tmp_path / "u.bin")
    box = mann_box(tmp_path / "u.bin", (16, NY, NZ), (2.0, 6.0, 5.0), mean=10.0, scale=1.5)
    assert (box.dt, box.samples) == (0.2, 17)
    assert box.duration == pytest.approx(3.2)
    hub = 10.0 + 1.5 * 0.5 * (u[:, 1, 2] + u[:, 2, 2]).astype(np.float64)
    assert samples(box, hub_weights(box)) == pytest.approx(np.append(hub, hub[0]), rel=1e-6)
    # 4 m round the middle: only y = +-3 m of the middle row.
    assert samples(box, disc_weights(box, 4.0)[0])[:16] == pytest.approx(hub, rel=1e-6)
    error = fault(lambda: mann_box(tmp_path / "u.bin", (32, NY, NZ), (2.0, 6.0, 5.0), 10.0, 1.0))
    assert (error.code, error.hint) == ("GF2509", "shape: [16, 4, 5]")
    assert fault(lambda: mann_box(tmp_path / "u.bin", (16, 7, 7), (2.0, 6.0, 5.0), 10.0, 1.0)).code == "GF2509"
    assert fault(lambda: mann_box(tmp_path / "v.bin", (16, 7, 7), (2.0, 6.0, 5.0), 10.0, 1.0)).code == "GF2501"


def test_a_box_with_nan_says_where(tmp_path: Path) -> None:
    u = mann(tmp_path / "u.bin")
    u[11, 1, 2] = np.nan
    (tmp_path / "u.bin").write_bytes(u.tobytes())
    box = mann_box(tmp_path / "u.bin", (16, NY, NZ), (2.0, 6.0, 5.0), 10.0, 1.0)
    error = fault(lambda: samples(box, hub_weights(box)))
    assert (error.code, "plane 12 of 16" in error.message) == ("GF2505", True)


def bladed(path: Path, *, kind: int = 4, cut: int = 0) -> NDArray[np.int16]:
    raw = np.random.default_rng(7).integers(-3000, 3000, (2 * 6, 3, 3, 3)).astype("<i2")
    head = struct.pack(
        "<2hi6f3fif3f2i2i", -99, kind, 3, 50.0, 0.1, 80.0, 12.0, 10.0, 6.0, 4.0, 4.0, 0.5, 6, 10.0, 1, 2, 3, 0, 1, 3, 3
    )
    data = head + struct.pack("<6f", *range(6)) + raw.tobytes()
    path.write_bytes(data[: len(data) - cut])
    return raw


def test_bladed_box(tmp_path: Path) -> None:
    raw = bladed(tmp_path / "w.wnd")
    box = bladed_box(tmp_path / "w.wnd")
    assert (box.planes, box.dt, box.mean, box.hub) == (12, 0.05, 10.0, 80.0)
    hub = 10.0 * (1.0 + 0.12 * raw[:, 1, 1, 0] / 1000.0)  # U (1 + TI u / sigma), 1000 for u = sigma
    assert samples(box, hub_weights(box)) == pytest.approx(hub, rel=1e-6)  # the intensity is a 4-byte number
    disc = 10.0 * (1.0 + 0.12 * raw[..., 0].mean(axis=(1, 2)) / 1000.0)
    assert samples(box, disc_weights(box, 6.0)[0]) == pytest.approx(disc, rel=1e-6)
    bladed(tmp_path / "w.wnd", cut=2)
    assert "12 planes of 3 x 3 points" in fault(lambda: bladed_box(tmp_path / "w.wnd")).message
    bladed(tmp_path / "w.wnd", kind=7)
    assert "kind 7" in fault(lambda: bladed_box(tmp_path / "w.wnd")).message
    (tmp_path / "w.wnd").write_bytes(b"\x9d\xff\x04")
    assert fault(lambda: bladed_box(tmp_path / "w.wnd")).code == "GF2508"

"""Wind as a scenario says it: what is refused, what is said about it, and runs with each kind."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from gustform.language.errors import GustformError
from gustform.language.system import Series
from gustform_cli import document
from gustform_cli.assemble import Assembled, assemble
from gustform_cli.errors import ErrorList
from gustform_cli.main import app
from gustform_cli.scenario import validate
from gustform_cli.wind import files
from gustform_cli.wind.blocks import FileWind, GustWind, RampWind, StepWind, TurbulentWindBlock
from gustform_cli.wind.survey import Survey, survey
from tests.unit.cli.test_wind_formats import field, mann, turbsim
from tests.unit.cli.wind_data import DATA

LINES = """\
name: wind
components:
  bus: {{type: Bus, voltage: 33 kV}}
  sg: {{type: SynchronousGenerator, at: bus}}
  wt: {{type: PmsgTurbine, at: bus, aggregate: 10, rotor: {{radius: 63 m}}}}
  load: {{type: ConstantPowerLoad, at: bus, active: 60 MW}}
frame: sg
wind:
  wt: {wind}
run: {{until: {until}}}
output: {{every: {every}, channels: [wt.wind, wt.omega_r]}}
"""


def text(wind: str, until: str = "8 s", every: str = "1 s") -> str:
    return LINES.format(wind=wind, until=until, every=every)


def made(wind: str, folder: Path = Path(), until: str = "8 s") -> Assembled:
    return assemble(document.parse(text(wind, until), str(folder / "s.yaml")))


def faults(wind: str, folder: Path = Path(), until: str = "8 s") -> list[GustformError]:
    try:
        made(wind, folder, until)
    except ErrorList as several:
        return list(several.errors)
    return []


def series(assembled: Assembled) -> Series:
    drive = assembled.system.inputs["wt.wind"]
    assert isinstance(drive, Series)
    return drive


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "w.csv").write_text("time,speed\n" + "".join(f"{t},{8 + t % 3}\n" for t in range(11)))
    (tmp_path / "slow.csv").write_text("time,speed\n" + "".join(f"{600 * t},{8 + t % 3}\n" for t in range(11)))
    (tmp_path / "w.hh").write_text("0 8 0 0 0 0 0 0\n4 8 0 0 0 0 0 0\n5 9 0 0 0 0 0 0\n20 9 0 0 0 0 0 0\n")
    (tmp_path / "odd.xyz").write_text("time,speed\n0,8\n9,8\n")
    turbsim(tmp_path / "w.bts", field())
    mann(tmp_path / "u.bin")
    return tmp_path


# ---- refused --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("wind", "code", "place", "part"),
    [
        ("{type: step, from: 8 m/s}", "GF2202", "9:7", "wind.wt.steps"),
        ("{type: step, from: 8 m/s, steps: []}", "GF2003", "9:40", "at least 1"),
        (
            "{type: step, from: 8 m/s, steps: [{at: 2 s, to: 9 m/s}, {at: 2 s, to: 8 m/s}]}",
            "GF2003", "9:40", "steps[1].at must be greater than 2 s",
        ),
        ("{type: step, from: 8 m/s, steps: [{at: 2 s, to: 9}]}", "GF2301", "9:55", "wind.wt.steps[0].to"),
        ("{type: ramp, from: 8 m/s, to: -1 m/s, at: 1 s, duration: 5 s}", "GF2003", "9:37", "wind.wt.to"),
        ("{type: ramp, from: 8 m/s, to: 9 m/s, at: 1 s, duration: 0 s}", "GF2003", "9:63", "wind.wt.duration"),
        ("{type: gust, shape: EOD, mean: 8 m/s, at: 1 s}", "GF2204", "9:27", "EOG or ECG"),
        ("{type: gust, shape: EOG, mean: 50 m/s, at: 1 s, turbine_class: III}", "GF2020", "5:7", "50 m/s"),
        ("{type: turbulence, mean: 8 m/s, model: man}", "GF2204", "9:46", "kaimal or mann"),
        ("{type: turbulence, mean: 8 m/s, duration: 5 s}", "GF2506", "9:49", "it ends at 5 s"),
        (
            "{type: turbulence, mean: 8 m/s, every: 0.5 s, three_p: {amplitude: 3 %, rotor_speed: 12 rpm}}",
            "GF2513", "9:7", "samples every 0.208 s",
        ),
        ("{type: file, path: none.csv}", "GF2501", "none.csv", "readable"),
        ("{type: file, path: odd.xyz}", "GF2202", "9:7", "format"),
        ("{type: file, path: w.csv, format: excel}", "GF2204", "9:41", "'excel'"),
        ("{type: file, path: w.csv, shape: [1, 2, 3]}", "GF2201", "9:40", "format csv takes no shape"),
        ("{type: file, path: w.hh, gaps: hold}", "GF2201", "9:38", "format uniform takes no gaps"),
        ("{type: file, path: w.csv, is: point_wind}", "GF2204", "9:37", "point"),
        ("{type: file, path: w.csv, columns: {speed: sped}}", "GF2503", "w.csv", "'sped'"),
        ("{type: file, path: w.csv, units: {speed: rpm}}", "GF2303", "9:7", "units.speed must be a unit of m/s"),
        ("{type: file, path: w.csv, units: {time: furlong}}", "GF2303", "9:7", "'furlong'"),
        ("{type: file, path: w.csv, time_zone: Europe/Pariss}", "GF2511", "9:44", "'Europe/Pariss'"),
        ("{type: file, path: w.csv, start: noon}", "GF2001", "9:40", "moment"),
        ("{type: file, path: w.csv, start: 5 m}", "GF2302", "9:40", "moment"),
        ("{type: file, path: w.csv, start: 2015-01-01T00:00}", "GF2511", "9:7", "the times of the file are numbers"),
        ("{type: file, path: w.csv, start: 5 s}", "GF2506", "w.csv", "it ends at 5 s"),
        ("{type: file, path: w.csv, start: 50 s}", "GF2506", "w.csv", "it ends at"),
        ("{type: file, path: w.csv, gaps: fill}", "GF2204", "9:39", "'fill'"),
        ("{type: file, path: w.bts}", "GF2506", "9:26", "it ends at 4 s"),
        ("{type: file, path: w.bts, start: 4 s}", "GF2506", "9:40", "within the file, 4 s"),
        ("{type: file, path: w.bts, is: point}", "GF2204", "9:37", "mean over the rotor"),
        ("{type: file, path: w.bts, columns: {time: t}}", "GF2201", "9:42", "takes no columns"),
        ("{type: file, path: w.csv, format: turbsim}", "GF2508", "w.csv", "begin with 7 or 8"),
        ("{type: file, path: w.csv, format: bladed}", "GF2508", "w.csv", "-99"),
        ("{type: file, path: w.csv, format: parquet}", "GF2508", "w.csv", "Parquet"),
        ("{type: file, path: w.csv, format: netcdf}", "GF2508", "w.csv", "netCDF-4"),
        ("{type: file, path: w.csv, format: uniform}", "GF2508", "w.csv:1", "8 numbers"),
        ("{type: file, path: w.bts, format: csv}", "GF2508", "w.bts", "text"),
        ("{type: file, path: u.bin, mean: 10 m/s, spacing: [2 m, 6 m, 5 m]}", "GF2202", "9:7", "wind.wt.shape"),
        (
            "{type: file, path: u.bin, mean: 10 m/s, spacing: [2 m, 6 m, 5 m], shape: [8, 4, 5]}",
            "GF2509", "u.bin", "640 bytes; the file has 1280",
        ),
        ("{type: file, path: u.bin, mean: 10 m/s, spacing: [2 m, 6 m]}", "GF2003", "9:56", "three lengths"),
        ("{type: file, path: u.bin, mean: 10 m/s, shape: [8, 4, 0]}", "GF2003", "9:54", "three whole numbers"),
    ],
)  # fmt: skip
def test_each_fault_has_its_code_and_place(folder: Path, wind: str, code: str, place: str, part: str) -> None:
    found = faults(wind, folder)
    matching = [error for error in found if error.code == code and part in error.message]
    assert matching, [str(error) for error in found]
    assert len(found) == 1, "nothing follows from it"
    error = matching[0]
    assert error.hint
    assert error.place is not None
    if place[0].isdigit():
        assert f"{error.place.line}:{error.place.column}" == place
        assert error.place.file == str(folder / "s.yaml")
    else:
        assert place in str(error.place)


def test_mann_without_hipersim_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hipersim", None)
    (error,) = faults("{type: turbulence, mean: 8 m/s, model: mann}")
    assert (error.code, "pip install gustform[mann]" in error.hint) == ("GF2512", True)
    assert error.place is not None
    assert (error.place.line, error.place.column) == (9, 46)


def test_turbulence_of_kaimal_never_asks_for_hipersim(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hipersim", None)
    assert faults("{type: turbulence, mean: 8 m/s}") == []


@pytest.mark.parametrize("on_end", ["error", "hold", "repeat"])
def test_turbulence_without_a_duration_has_no_end(on_end: str) -> None:
    """`on_end` says nothing then; the runtime would refuse to repeat what is endless."""
    endless = series(made(f"{{type: turbulence, mean: 8 m/s, on_end: {on_end}}}"))
    assert (endless.t_end, endless.on_end) == (math.inf, "error")
    ending = series(made(f"{{type: turbulence, mean: 8 m/s, duration: 20 s, on_end: {on_end}}}"))
    assert (ending.t_end, ending.on_end) == (20.0, on_end)


def test_mann_turbulence() -> None:
    pytest.importorskip("hipersim")
    wind = "{type: turbulence, mean: 10 m/s, model: mann, every: 0.25 s, duration: 100 s, on_end: repeat}"
    assembled = made(wind, until="300 s")
    (reader,) = assembled.readers.values()
    times, speeds = reader(0, 1000)
    # 100 s / 0.25 s = 400 planes, rounded up to 512; periodic.
    assert (times.size, times[-1], speeds[0]) == (513, 128.0, speeds[-1])
    assert series(assembled).t_end == 128.0
    assert speeds.mean() == pytest.approx(10.0, abs=1.0)
    assert 0.3 < speeds.std() < 1.834, "averaged over the rotor it moves less than a point does"
    assert np.array_equal(next(iter(made(wind, until="300 s").readers.values()))(7, 5)[1], speeds[7:12])
    (error,) = faults("{type: turbulence, mean: 10 m/s, model: mann}", until="2 h")
    assert (error.code, "at most 27.31 min" in error.message) == ("GF2003", True)


# ---- said -----------------------------------------------------------------------------------------------------------
def test_warnings(folder: Path) -> None:
    assert made("{type: file, path: w.csv, is: point}", folder).warnings == []
    (said,) = made("{type: file, path: w.csv}", folder).warnings
    assert "taken as rotor_effective; where it was measured at one point, say is: point" in said
    repeated = made("{type: file, path: w.csv, is: rotor_effective, on_end: repeat}", folder, "30 s")
    (said,) = repeated.warnings
    assert said.startswith("wind.wt: the wind file is repeated every 10 s, 3 times in this run: false periods at")
    assert "multiples of 0.1 Hz" in said
    assert (series(repeated).on_end, series(repeated).t_end) == ("repeat", 10.0)
    held = made("{type: file, path: w.csv, is: rotor_effective, on_end: hold}", folder, "30 s")
    assert held.warnings == ["wind.wt: the wind file ends at 10 s; its last value is held to the end of the run"]
    late = document.parse(
        text("{type: constant, speed: 8 m/s}") + "events: [{at: 9 s, set: {load.active: 1 MW}}]\n", "s.yaml"
    )
    assert assemble(late).warnings == ["events[0] at 9 s comes after the end of the run, 8 s: it does not happen"]


def test_interpolation_follows_the_spacing(folder: Path) -> None:
    assert series(made("{type: file, path: w.csv, is: point}", folder)).interpolation == "pchip", "1 s"
    fine = "{type: file, path: w.csv, is: point, units: {time: ms}, on_end: hold}"
    assert series(made(fine, folder)).interpolation == "linear"
    said = "{type: file, path: w.csv, is: point, interpolation: linear}"
    assert series(made(said, folder)).interpolation == "linear"
    assert series(made("{type: file, path: w.hh}", folder)).interpolation == "linear", "bends stand where they are"


def test_the_operating_point(folder: Path) -> None:
    def wind_speed(wind: str) -> float:
        return float(made(wind, folder).system.components["wt"].value("wind_speed"))

    # 8, 9, 10, 8, 9, 10, 8, 9, 10 at 0 ... 8 s: (4 + 9 + 10 + 8 + 9 + 10 + 8 + 9 + 5) / 8
    assert wind_speed("{type: file, path: w.csv, is: point}") == pytest.approx(9.0)
    assert wind_speed("{type: file, path: w.csv, is: point, mean: 11 m/s}") == 11.0
    assert wind_speed("{type: file, path: w.bts, on_end: hold}") == 8.0, "the header's"
    assert wind_speed("{type: gust, shape: ECG, mean: 7 m/s, at: 1 s}") == 7.0
    assert wind_speed("{type: step, from: 6 m/s, steps: [{at: 1 s, to: 9 m/s}]}") == 6.0


def test_a_file_is_gone_through_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    passes: list[Any] = []

    def counting(*arguments: Any) -> Survey:
        passes.append(arguments)
        return survey(*arguments)

    monkeypatch.setattr(files, "survey", counting)
    for _ in range(3):
        made("{type: file, path: w.csv, is: point}", folder)
    assert len(passes) == 1, "for the operating point, the series, and every other run of a campaign"
    (folder / "w.csv").write_text((folder / "w.csv").read_text() + "11,8\n")
    made("{type: file, path: w.csv, is: point}", folder)
    assert len(passes) == 2


def test_turbulence_by_level_and_intensity() -> None:
    def deviation(more: str) -> float:
        (reader,) = made("{type: turbulence, mean: 10 m/s, rotor_effective: false" + more + "}").readers.values()
        return float(getattr(reader, "spectrum").sigma)  # noqa: B009

    assert deviation("") == pytest.approx(1.834)
    assert deviation(", level: mean") == pytest.approx(0.14 * (7.5 + 3.8))
    assert deviation(", intensity: 10 %") == pytest.approx(1.0)


# ---- runs -----------------------------------------------------------------------------------------------------------
def simulated(tmp_path: Path, wind: str, until: str, every: str) -> tuple[xarray.Dataset, dict[str, Any], str]:
    scenario = tmp_path / "s.yaml"
    scenario.write_text(text(wind, until, every))
    run = CliRunner().invoke(app, ["simulate", str(scenario), "--out", str(tmp_path / "out"), "--no-figure"])
    assert run.exit_code == 0, run.stderr
    with xarray.open_dataset(tmp_path / "out" / "result.nc") as data:
        return data.load(), json.loads((tmp_path / "out" / "summary.json").read_text()), run.stderr


def test_a_step_is_a_jump_at_its_moment(tmp_path: Path) -> None:
    wind = "{type: step, from: 8 m/s, steps: [{at: 1.0005 s, to: 9 m/s}, {at: 2 s, to: 7 m/s}]}"
    data, summary, _ = simulated(tmp_path, wind, "3 s", "1 ms")
    speed = data["wt.wind"].values
    time = data["time"].values
    assert set(np.unique(speed)) == {7.0, 8.0, 9.0}, "nothing between"
    assert speed[time < 1.0005].max() == 8.0
    assert set(speed[(time > 1.0005) & (time < 1.9999)]) == {9.0}
    assert set(speed[time > 2.0001]) == {7.0}
    assert summary["events"] == 2


def test_a_gust_is_not_stepped_over(tmp_path: Path) -> None:
    data, _, _ = simulated(tmp_path, "{type: gust, shape: EOG, mean: 9 m/s, at: 400 s}", "800 s", "0.25 s")
    speed, rotor = data["wt.wind"], data["wt.omega_r"]
    assert speed.max() > 12.0
    assert abs(rotor - rotor.isel(time=0)).max() > 1e-3, "the rotor has felt it"


@pytest.mark.parametrize("name", ["w.csv", "w.hh"])
def test_a_gust_in_a_file_that_stands_still_is_not_stepped_over(tmp_path: Path, name: str) -> None:
    if name == "w.csv":
        rows = "".join(f"{t},{11 if 600 <= t < 606 else 9}\n" for t in range(1201))
        (tmp_path / name).write_text(f"time,speed\n{rows}")
    else:
        bends = {0: 9, 599: 9, 600: 11, 605: 11, 606: 9, 1200: 9}
        (tmp_path / name).write_text("".join(f"{t} {v} 0 0 0 0 0 0\n" for t, v in bends.items()))
    wind = f"{{type: file, path: {name}, is: rotor_effective, mean: 9 m/s}}"
    # The spacing of the rows; half of the 7 s from 599 to 606 s.
    assert made(wind, tmp_path, "1200 s").longest_step == {"w.csv": 1.0, "w.hh": 3.5}[name]
    data, _, _ = simulated(tmp_path, wind, "1200 s", "1 s")
    rotor = data["wt.omega_r"]
    assert abs(rotor - rotor.isel(time=0)).max() > 1e-3, "the rotor has felt it"


def test_moving_wind_limits_no_step(folder: Path) -> None:
    assert made("{type: file, path: w.csv, is: point}", folder).longest_step == np.inf
    assert made("{type: file, path: w.hh}", folder).longest_step == np.inf, "it never comes back"


def test_measured_wind_drives_a_run(tmp_path: Path) -> None:
    file = DATA / "lhb" / "la-haute-borne_R80711_2014-2015.csv.gz"
    wind = (
        f"{{type: file, path: {file}, columns: {{time: Date_time, speed: Ws_avg}}, is: point, start: 2014-02-07T12:00, "
        "gaps: interpolate}"
    )
    data, summary, said = simulated(tmp_path, wind, "6 h", "600 s")
    table = np.genfromtxt(str(file), delimiter=",", skip_header=1, usecols=[4])
    first = 37 * 144 + 11 * 6  # 37 days after 2014-01-01T01:00, and 11 hours
    measured = table[first : first + 37]
    assert np.isnan(measured).any(), "15:40 to 16:10 are missing"
    # A day's wind passes the rotor's filter (11 s) nearly unchanged: 600 s samples differ by its lag only.
    known = np.isfinite(measured)
    # The filter is solved for straight lines, so at a sample the output still rises or falls by its lag, 11 s of 600.
    lag = np.abs(np.diff(np.interp(np.arange(37), np.flatnonzero(known), measured[known]), prepend=measured[0])) * 0.03
    assert (np.abs(data["wt.wind"].values - measured)[known] <= lag[known] + 1e-3).all()
    assert any("1 gap" in line for line in summary["warnings"])
    assert "warning: wind.wt: 1 gap" in said
    assert json.loads(data.attrs["warnings"]) == summary["warnings"]


def test_uniform_wind_drives_a_run(tmp_path: Path) -> None:
    wind = f"{{type: file, path: {DATA / 'rosco' / 'NoShr_3-15_50s.wnd'}, start: 140 s}}"
    data, summary, _ = simulated(tmp_path, wind, "70 s", "50 ms")
    at = data["wt.wind"].interp(time=[0.0, 9.9, 10.05, 10.2, 59.9, 60.15]).values
    assert at == pytest.approx([7.0, 7.0, 7.5, 8.0, 8.0, 9.0], abs=1e-4)
    assert "warnings" not in summary


def test_a_turbulence_box_drives_a_run(tmp_path: Path) -> None:
    wind = f"{{type: file, path: {DATA / 'turbsim' / 'TurbSim_NoTwr.bts'}, on_end: repeat}}"
    data, summary, _ = simulated(tmp_path, wind, "12 s", "50 ms")
    speed = data["wt.wind"].values
    assert speed[100:200] == pytest.approx(speed[:100], abs=1e-3), "5 s, again and again"
    assert np.abs(np.diff(speed)).max() < 1.5, "a periodic box has no jump where it begins again"
    assert any("does not cover the rotor" in line for line in summary["warnings"])
    assert any("repeated every 5 s" in line for line in summary["warnings"])


def test_blades_pass_in_a_run(tmp_path: Path) -> None:
    (tmp_path / "w.csv").write_text("time,speed\n" + "".join(f"{0.05 * k:.2f},9\n" for k in range(500)))
    wind = "{type: file, path: w.csv, is: point, three_p: {amplitude: 4 %, rotor_speed: 12 rpm}}"
    data, _, _ = simulated(tmp_path, wind, "20 s", "50 ms")
    wave = 9.0 * 0.04 * np.sin(2.0 * np.pi * 0.6 * data["time"].values)
    assert data["wt.wind"].values == pytest.approx(9.0 + wave, abs=1e-3)


def test_check_reports_a_bad_file_before_the_run(folder: Path) -> None:
    (folder / "bad.csv").write_text("time,speed\n0,8\n1,\n2,8\n2,8\n9,8\n")
    (folder / "s.yaml").write_text(text("{type: file, path: bad.csv}"))
    run = CliRunner().invoke(app, ["check", str(folder / "s.yaml")])
    assert run.exit_code == 2
    assert f"{folder / 'bad.csv'}:3: error GF2505" in run.stderr
    assert "1 value missing or NaN in line 3 (1 s); 1 duplicate stamp, in line 5 (2 s)" in run.stderr
    (folder / "s.yaml").write_text(text("{type: file, path: bad.csv, gaps: hold, is: point}"))
    run = CliRunner().invoke(app, ["check", str(folder / "s.yaml"), "--json"])
    assert run.exit_code == 0, run.stderr
    assert "warning: wind.wt: 1 duplicate stamp, in line 5 (2 s): left out" in run.stderr
    assert len(json.loads(run.stdout)["scenario_warnings"]) == 2


# ---- documents ------------------------------------------------------------------------------------------------------
def test_documented_blocks_are_understood() -> None:
    page = (Path(__file__).parents[3] / "docs" / "wind.md").read_text()
    blocks = re.findall(r"^```yaml\n(wind:\n.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) == 4
    kinds = set()
    for block in blocks:
        plain = "\n".join(line for line in text("x").splitlines() if not line.startswith(("wind:", "  wt: x")))
        scenario, errors = validate(document.parse(f"{plain}\n{block}", "wind.md"))
        assert errors == []
        assert scenario is not None
        kinds |= {one.type for one in scenario.wind.values()}
    assert kinds == {"constant", "step", "ramp", "gust", "turbulence", "file"}
    for code in (f"GF{number}" for number in range(2501, 2514)):
        assert code in page


def test_every_key_of_a_block_is_documented() -> None:
    page = (Path(__file__).parents[3] / "docs" / "wind.md").read_text()
    for model in (StepWind, RampWind, GustWind, TurbulentWindBlock, FileWind):
        for name, key in model.model_fields.items():
            assert re.search(rf"\b{key.alias or name}\b", page), f"{model.__name__}.{name}"

"""The command as users call it: a process of its own, files on disk, exit codes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from tests.support.waiting import wait_for

LOAD_STEP = SCENARIOS / "load_step_8ms.yaml"
TURBULENT = SCENARIOS / "turbulent_10min.yaml"
FARM = SCENARIOS / "farm.yaml"

KEYS = {
    "status", "simulated_seconds", "wall_seconds", "real_time_factor", "build_seconds", "compiled_types", "unknowns",
    "steps", "residual_evaluations", "jacobian_evaluations", "factorisations", "error_test_failures", "frequency",
}  # fmt: skip


def environment(**changes: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path), **changes}


def gustform(*arguments: object, **changes: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gustform_cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        env=environment(**changes),
        check=False,
    )


def inside(*arguments: object) -> Result:
    """The same in this process, which is faster: for what neither signals nor the environment matter to."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


# ---- simulate -------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def load_step(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    out = tmp_path_factory.mktemp("load_step")
    return out, gustform("simulate", LOAD_STEP, "--out", out)


def test_the_demo_writes_what_it_says(load_step: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, process = load_step
    assert process.returncode == 0, process.stderr
    for name in ("result.nc", "summary.json", "figure.png"):
        assert str(out / name) in process.stdout
        assert (out / name).stat().st_size > 0
    assert {path.name for path in out.iterdir()} == {"result.nc", "summary.json", "figure.png"}
    assert "nadir 49.64" in process.stdout
    assert "settling 49.72" in process.stdout
    assert "x real time" in process.stdout


def test_the_summary_has_the_published_figures(load_step: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    summary = json.loads((load_step[0] / "summary.json").read_text())
    assert set(summary) >= KEYS
    assert summary["status"] == "completed"
    assert summary["simulated_seconds"] == 90.0
    assert summary["unknowns"] > 20
    # Lyu, Subotic, Gross 2022, VI: 49.644 Hz and 49.724 Hz; tolerances of the project's notes.
    assert summary["frequency"]["nadir_hz"] == pytest.approx(49.644, abs=0.005)
    assert summary["frequency"]["settle_hz"] == pytest.approx(49.724, abs=0.003)
    assert 40.0 < summary["frequency"]["nadir_time_s"] < 46.0
    assert -0.5 < summary["frequency"]["rocof_hz_per_s"] < 0.0


def test_the_result_describes_itself(load_step: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    with xarray.open_dataset(load_step[0] / "result.nc") as data:
        assert data.sizes["time"] == 4501
        frequency = data["sg.frequency"]
        assert frequency.attrs["units"] == "Hz"
        assert frequency.attrs["long_name"]
        before = frequency.where(data["time"] <= 30.0, drop=True)
        assert abs(before - 50.0).max() < 1e-4
        aliases = json.loads(data.attrs["aliases"])
        assert aliases["wt.pitch.servo.beta"] == ["wt.beta", 1]
        assert "active: 100 MW" in data.attrs["scenario"]
        assert "# ten identical turbines" in data.attrs["scenario"], "with its comments"
        versions = json.loads(data.attrs["versions"])
        assert set(versions) >= {"gustform", "casadi", "sundials", "python"}
        assert json.loads(data.attrs["statistics"])["steps"] > 100
        assert data.attrs["status"] == "completed"


def test_json_on_stdout(tmp_path: Path) -> None:
    process = inside(
        "simulate", LOAD_STEP, "--out", tmp_path, "--json", "--no-figure", "--set", "run.until=1 s",
        "--set", "output.channels=[wt.v_dc]",
    )  # fmt: skip
    assert process.exit_code == 0, process.stderr
    summary = json.loads(process.stdout)
    assert set(summary) >= KEYS
    assert summary["paths"] == {"result": str(tmp_path / "result.nc"), "summary": str(tmp_path / "summary.json")}
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert {*data.data_vars} == {"sg.frequency", "wt.v_dc"}, "the grid frequency is always there"
        assert "until: 1 s" in data.attrs["scenario"], "the scenario as it was run"


def test_the_first_seconds_do_not_depend_on_the_length(tmp_path: Path) -> None:
    winds = []
    for until in ("20 s", "60 s"):
        process = inside("simulate", TURBULENT, "--out", tmp_path, "--no-figure", "--set", f"run.until={until}")
        assert process.exit_code == 0, process.stderr
        with xarray.open_dataset(tmp_path / "result.nc") as data:
            winds.append(data["wt.wind"].sel(time=slice(0, 20)).load())
    assert winds[0].identical(winds[1])
    assert winds[0].std() > 0.1


def test_a_farm_grows_without_compiling(tmp_path: Path) -> None:
    for turbines in (2, 3):
        process = inside(
            "simulate", FARM, "--out", tmp_path, "--no-figure", "--set", f"turbines={turbines}",
            "--set", "run.until=1 s",
        )  # fmt: skip
        assert process.exit_code == 0, process.stderr
    assert json.loads((tmp_path / "summary.json").read_text())["compiled_types"] == 0
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert data["wt.wind"].sizes == {"time": 21, "wt": 3}
        assert len(set(data["wt.wind"].isel(time=0).values.tolist())) == 3


def test_a_wind_file_drives_the_run(tmp_path: Path) -> None:
    (tmp_path / "wind.csv").write_text("time,speed\n" + "".join(f"{t},{8 + 0.5 * (t % 3)}\n" for t in range(12)))
    scenario = tmp_path / "s.yaml"
    scenario.write_text(
        LOAD_STEP.read_text()
        .replace("wt: {type: constant, speed: 8 m/s}", "wt: {type: file, path: wind.csv}")
        .replace("aggregate: 10", "aggregate: 10\n    wind_speed: 8 m/s")
    )
    process = inside("simulate", scenario, "--out", tmp_path / "out", "--no-figure", "--set", "run.until=11 s")
    assert process.exit_code == 0, process.stderr
    with xarray.open_dataset(tmp_path / "out" / "result.nc") as data:
        # PCHIP from 1 s on: between 8.5 (slope 0.5) and 9 (a maximum, slope 0) it is 8.75 + (0.5 - 0) / 8 half-way.
        assert data["wt.wind"].sel(time=7.5, method="nearest").item() == pytest.approx(8.8125, abs=1e-5)


# ---- stopping -------------------------------------------------------------------------------------------------------
def start_long_run(out: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-m", "gustform_cli", "simulate", str(TURBULENT), "--out", str(out), "--no-figure", "--set",
         "run.until=1000 h", "--set", "output.every=1 s"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment(),
    )  # fmt: skip
    part = out / "result.nc.part"

    def has_rows() -> bool:
        assert process.poll() is None, process.communicate()
        return part.exists() and part.stat().st_size > 600_000  # two blocks of 17 x 4096 values, and more

    wait_for(has_rows, 60.0)
    return process


def test_ctrl_c_leaves_a_readable_result(tmp_path: Path) -> None:
    process = start_long_run(tmp_path)
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGINT)  # an impatient second one must not do harm
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "interrupted at" in out
    assert not (tmp_path / "result.nc.part").exists()
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "interrupted"
    assert 0.0 < summary["simulated_seconds"] < 3.6e6
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert data.attrs["status"] == "interrupted"
        assert data["time"].values[-1] == pytest.approx(summary["simulated_seconds"], abs=2.0)
        assert float(data["sg.frequency"].min()) > 45.0


def test_a_killed_run_can_be_plotted(tmp_path: Path) -> None:
    process = start_long_run(tmp_path)
    process.kill()
    process.communicate()
    plotted = gustform("plot", tmp_path / "result.nc.part", "--out", tmp_path / "part.png")
    assert plotted.returncode == 0, plotted.stderr
    assert (tmp_path / "part.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_is_not_disturbed_by_another_one_in_its_folder(tmp_path: Path) -> None:
    process = start_long_run(tmp_path)
    for arguments, code in (
        (["simulate", LOAD_STEP, "--out", tmp_path], "GF7001"),
        (["simulate", "--resume", tmp_path], "GF7008"),
    ):
        other = gustform(*arguments)
        assert other.returncode == 2, other.stderr
        assert code in other.stderr
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"result.nc", "result.nc.checkpoint", "result.nc.chunks.0", "summary.json"}
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert np.array_equal(data["time"].values[:-1], np.arange(data.sizes["time"] - 1))


def test_ctrl_c_before_the_run_touches_nothing(tmp_path: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "import gustform_cli.model as model\n"
        "from gustform_cli.main import main\n"
        "build = model.build\n"
        "def interrupted(*arguments):\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    return build(*arguments)\n"
        "model.build = interrupted\n"
        f"sys.argv = ['gustform', 'simulate', {str(LOAD_STEP)!r}, '--out', {str(tmp_path)!r}]\n"
        "main()\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment(), check=False, timeout=60
    )
    assert process.returncode == 130, process.stderr
    assert "interrupted" in process.stderr
    assert list(tmp_path.iterdir()) == []


# ---- bad input ------------------------------------------------------------------------------------------------------
def results_of_before(folder: Path) -> dict[str, bytes]:
    folder.mkdir(exist_ok=True)
    for name in ("result.nc", "summary.json", "figure.png"):
        (folder / name).write_bytes(b"of before")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("overrides", "code", "exit_code"),
    [
        (["load.active=5 m"], "GF2302", 2),
        (["load.activ=5 MW"], "GF2402", 2),
        (["nonsense"], "GF2105", 2),
        (["output.channels=[wt.omga]"], "GF2406", 2),
        (["load.at="], "GF3003", 1),
        (["load.active=900 MW"], "GF5001", 1),
    ],
)
def test_bad_input_overwrites_nothing(tmp_path: Path, overrides: list[str], code: str, exit_code: int) -> None:
    before = results_of_before(tmp_path)
    arguments = [argument for override in overrides for argument in ("--set", override)]
    process = inside("simulate", LOAD_STEP, "--out", tmp_path, *arguments)
    assert process.exit_code == exit_code, process.stderr
    assert f"error {code}:" in process.stderr
    assert "Traceback" not in process.stderr
    assert process.stdout == ""
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_place_in_the_file_is_printed(tmp_path: Path) -> None:
    scenario = tmp_path / "s.yaml"
    scenario.write_text(LOAD_STEP.read_text().replace("active: 100 MW", "active: 5 m"))
    process = inside("check", scenario)
    assert process.exit_code == 2
    line = next(n for n, text in enumerate(scenario.read_text().splitlines(), 1) if "active: 5 m" in text)
    assert process.stderr.startswith(f"{scenario}:{line}:13: error GF2302: load.active must ")
    assert " — try " in process.stderr


def test_a_folder_that_is_not_writable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    process = inside("simulate", LOAD_STEP, "--out", tmp_path / "file")
    assert process.exit_code == 2
    assert "error GF7001:" in process.stderr
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize("kind", ["missing", "failing"])
def test_a_compiler_that_does_not_work(tmp_path: Path, kind: str) -> None:
    compiler = tmp_path / "cc"
    if kind == "failing":
        compiler.write_text("#!/bin/sh\necho 'internal compiler error' >&2\nexit 4\n")
        compiler.chmod(0o755)
    before = results_of_before(tmp_path / "out")
    process = gustform(
        "simulate", LOAD_STEP, "--out", tmp_path / "out", CC=str(compiler), GUSTFORM_CACHE=str(tmp_path / "cache")
    )
    assert process.returncode == 1, process.stderr
    assert "error GF4" in process.stderr
    assert "Traceback" not in process.stderr
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_a_run_that_fails_keeps_its_rows(tmp_path: Path) -> None:
    # The load asks for more than generator and turbines can give; the frequency collapses after the step.
    process = inside(
        "simulate", LOAD_STEP, "--out", tmp_path, "--no-figure", "--set", "events[0].set={load.active: 5 GW}",
        "--set", "events[0].at=5 s", "--set", "load.V_min=0.01",
    )  # fmt: skip
    assert process.exit_code == 1, process.stdout
    assert "error GF6" in process.stderr
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert "GF6" in summary["message"]
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert data.attrs["status"] == "failed"
        assert data["time"].values[-1] >= 4.9


# ---- the other commands ---------------------------------------------------------------------------------------------
def test_check_reports_the_model() -> None:
    process = inside("check", LOAD_STEP)
    assert process.exit_code == 0, process.stderr
    for word in ("PmsgTurbine", "SynchronousGenerator", "unknowns", "structurally regular"):
        assert word in process.stdout
    report: dict[str, Any] = json.loads(inside("check", LOAD_STEP, "--json").stdout)
    assert report["unknowns"] == report["equations"]
    assert {entry["name"] for entry in report["types"]} >= {"Bus", "PmsgTurbine"}


def test_info_lists_components_and_parameters() -> None:
    process = inside("info")
    assert process.exit_code == 0
    assert "PmsgTurbine" in process.stdout
    assert "TGOV1" in process.stdout
    described = inside("info", "PmsgTurbine").stdout
    for word in ("curtailment", "0 ... 0.95", "rotor-effective wind speed", "TableRotor", "omega_r"):
        assert word in described
    unknown = inside("info", "PmsgTurbin")
    assert unknown.exit_code == 2
    assert "try PmsgTurbine" in unknown.stderr


def test_new_writes_a_scenario_once(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    process = inside("new", file)
    assert process.exit_code == 0
    assert str(file) in process.stdout
    assert inside("check", file).exit_code == 0
    text = file.read_text()
    schema = text.splitlines()[0].partition("$schema=")[2]
    assert Path(schema).is_file(), "editors find the schema from anywhere"
    again = inside("new", file)
    assert again.exit_code == 2
    assert "GF7003" in again.stderr
    assert file.read_text() == text


@pytest.mark.parametrize("content", [b"", b"not HDF5 at all", None])
def test_plot_refuses_what_is_no_result(tmp_path: Path, content: bytes | None) -> None:
    file = tmp_path / "x.nc"
    if content is not None:
        file.write_bytes(content)
    process = inside("plot", file)
    assert process.exit_code == 2
    assert "GF7002" in process.stderr
    assert "Traceback" not in process.stderr


def test_usage() -> None:
    assert inside("--help").exit_code == 0
    assert inside().exit_code == 2
    assert inside("simulate").exit_code == 2
    assert inside("simulate", LOAD_STEP, "--nonsense").exit_code == 2
    assert inside("--version").stdout.startswith("gustform ")


def test_help_loads_none_of_the_heavy_libraries() -> None:
    script = (
        "import sys\n"
        "from gustform_cli.main import main\n"
        "sys.argv = ['gustform', '--help']\n"
        "try:\n    main()\n"
        "except SystemExit:\n    pass\n"
        "print(sorted({'casadi', 'numpy', 'h5py', 'pint', 'matplotlib', 'xarray', 'pydantic'} & set(sys.modules)))\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment(), check=True, timeout=60
    )
    assert process.stdout.splitlines()[-1] == "[]"


def test_simulate_loads_no_plotting_without_a_figure() -> None:
    script = (
        "import sys\n"
        "from gustform_cli.main import main\n"
        f"sys.argv = ['gustform', 'check', {str(LOAD_STEP)!r}]\n"
        "try:\n    main()\n"
        "except SystemExit:\n    pass\n"
        "print(sorted({'matplotlib', 'xarray', 'pandas', 'h5netcdf'} & set(sys.modules)))\n"
    )
    process = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment(), check=True, timeout=60
    )
    assert process.stdout.splitlines()[-1] == "[]"

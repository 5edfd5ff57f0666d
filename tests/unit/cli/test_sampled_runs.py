"""`control: {sampled: ...}` on the command line: results, summary, model file, resuming, linearisation."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from gustform_cli.checkpoint import read
from gustform_cli.export import block_of_scenario
from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.run import Run
from gustform_cli.sampled import controller_warnings
from gustform_codegen.linear import linearise
from gustform_codegen.modes import modes
from gustform_runtime import SampledCount, gust_run_path
from tests.support.case import open_case

LOAD_STEP = SCENARIOS / "load_step_8ms.yaml"
SAMPLED = "wt.control.sampled=1 ms"
SHORT = ["run.until=2 s", "events=[{at: 1 s, set: {load.active: 120 MW}}]"]


def command(*words: object, changes: list[str]) -> Any:
    sets = [word for change in changes for word in ("--set", change)]
    return CliRunner().invoke(app, [*map(str, words), *sets])


def test_a_run_with_its_summary(tmp_path: Path) -> None:
    answer = command("simulate", LOAD_STEP, "--out", tmp_path, "--no-figure", changes=[SAMPLED, *SHORT])
    assert answer.exit_code == 0, answer.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["events"] == 2000  # a sample each millisecond, the last one not yet
    assert 0 < summary["restarts"] <= 2000
    assert "warnings" not in summary
    with xarray.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as result:
        assert {"wt.v_dc", "wt.control.V_gsc", "wt.pitch.beta_ref"} <= set(result.data_vars)
        assert not [name for name in result.data_vars if "speed_limiter" in str(name)]
        assert np.ptp(result["wt.v_dc"].values) > 1e-3


def test_error_signals_are_told(tmp_path: Path) -> None:
    """A pitch of the operating point below what is believed of a measurement: the controller takes no sample."""
    changes = [SAMPLED, *SHORT, "wt.pitch.beta_min=-20 deg", "wt.beta_del=-12 deg"]
    answer = command("simulate", LOAD_STEP, "--out", tmp_path, "--no-figure", changes=changes)
    assert answer.exit_code == 0, answer.output
    (warning,) = json.loads((tmp_path / "summary.json").read_text())["warnings"]
    assert warning.startswith("wt: the sampled controller raised its error signal in ")
    assert " 2000 of 2000 samples, first at 0 s (INPUT_RANGE in 2000: an input is out of its range" in warning


class _Many:
    def sampled_blocks(self) -> list[Any]:
        from types import SimpleNamespace

        return [SimpleNamespace(name=f"wt[{k}]") for k in range(1, 21)]

    def sampled_statistics(self, block: int) -> SampledCount:
        return SampledCount(10, 0 if block == 0 else 3, [1, 2, 0, 0, 0, 0, 0, 0], 0.5)


def test_a_farm_is_told_of_in_a_few_lines() -> None:
    many: Any = _Many()
    lines = controller_warnings(many)
    assert len(lines) == 9
    assert lines[0].startswith("wt[2]: ")
    assert "INPUT_NOT_FINITE in 1" in lines[0]
    assert lines[-1] == "and 11 more sampled controllers raised their error signals"


def test_gust_run_loads_the_same_controller(tmp_path: Path) -> None:
    model, rows = tmp_path / "model.gust", tmp_path / "rows.csv"
    changes = [SAMPLED, *SHORT, "output.channels=[sg.frequency, wt.omega_r]"]
    answer = command("check", LOAD_STEP, "--model", model, changes=changes)
    assert answer.exit_code == 0, answer.output
    process = subprocess.run(
        [gust_run_path(), model, "--until", "2", "--every", "0.1", "--rtol", "1e-6", "--out", rows],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    table = np.loadtxt(rows, delimiter=",", skiprows=1)
    _, channels, _ = open_case("load_step_8ms", *changes).run(("sg.frequency", "wt.omega_r"), 0.1, 2.0, rtol=1e-6)
    np.testing.assert_allclose(table[:, 1], channels["sg.frequency"], rtol=5.1e-7)  # seven digits of CSV


def test_linearise_and_export_take_the_continuous_control(tmp_path: Path) -> None:
    answer = command("linearise", LOAD_STEP, "--out", tmp_path, changes=[SAMPLED])
    assert answer.exit_code == 0, answer.output
    assert "sampled controls, linearised as continuous ones: wt" in " ".join(answer.output.split())
    found = json.loads((tmp_path / "modes.json").read_text())["eigenvalues"]
    whole = open_case("load_step_8ms")
    expected = modes(linearise(whole.model.built.linked, whole.table)).eigenvalues
    np.testing.assert_allclose(np.array(found) @ [1.0, 1.0j], expected, rtol=1e-9, atol=1e-9)
    one, other = (block_of_scenario("wt", LOAD_STEP, changes) for changes in ([], [SAMPLED]))
    for kind in ("inputs", "outputs", "states", "parameters"):
        pairs = [[(s.name, s.value) for s in getattr(block, kind)] for block in (one, other)]
        assert pairs[0] == pairs[1]


def test_a_farm_of_different_periods(tmp_path: Path) -> None:
    """Three turbines of one component, one of another period, one in the equations."""
    turbine = "type: PmsgTurbine, at: bus, aggregate: 2, curtailment: 10 %"
    changes = [
        f"components.wt={{{turbine}, count: 3, control: {{type: DualPort, sampled: 1 ms}}}}",
        f"components.slow={{{turbine}, control: {{type: DualPort, sampled: 2 ms, delay: 1}}}}",
        f"components.whole={{{turbine}, control: {{type: Droop}}}}",
        "wind.slow={type: constant, speed: 9 m/s}",
        "wind.whole={type: constant, speed: 8 m/s}",
        "output.channels=[wt.v_dc, slow.v_dc, whole.v_dc]",
        *SHORT,
    ]
    answer = command("simulate", LOAD_STEP, "--out", tmp_path, "--no-figure", changes=changes)
    assert answer.exit_code == 0, answer.output
    with xarray.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as result:
        v_dc = result["wt.v_dc"].values
        assert v_dc.shape[1] == 3
        before = result["time"].values < 0.99
        assert np.max(np.abs(v_dc[before] - 1.0)) < 1e-6
        assert np.max(np.abs(v_dc - v_dc[:, :1])) < 1e-5  # the same turbine three times
        assert np.ptp(result["slow.v_dc"].values) > 1e-3


@pytest.mark.parametrize("delay", [0, 1])
def test_a_run_that_was_stopped_goes_on_with_the_same_bits(delay: int, tmp_path: Path) -> None:
    changes = [SAMPLED, *SHORT, f"wt.control.delay={delay}", "run.checkpoint=300 ms", "output.every=1 ms"]
    case = open_case("load_step_8ms", *changes)
    table = case.table.with_channels(case.model.channels)

    running: list[Run] = []

    def stop(times: Any, _rows: Any) -> None:
        if times[-1] > 1.1:
            running[0].request_stop()

    results = []
    for watchers in ([], [stop]):
        out = tmp_path / str(len(watchers))
        out.mkdir()
        with Run(case.model, table, out / "result.nc", watchers) as run:
            running[:] = [run]
            ended = run.execute()
        if watchers:
            assert ended.summary.status == "interrupted"
            found = read(out)
            assert 0.0 < found.time < 1.5
            with Run(case.model, table, out / "result.nc", resume=found) as run:
                ended = run.execute()
        assert ended.summary.status == "completed", ended.error
        with xarray.open_dataset(out / "result.nc", engine="h5netcdf") as result:
            results.append({str(name): result[name].values for name in result.data_vars})
    assert results[0].keys() == results[1].keys()
    for name, values in results[0].items():
        assert np.array_equal(values, results[1][name]), name

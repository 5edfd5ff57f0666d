"""`gustform check --model` and `gust-run`: the same run without Python."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_runtime import gust_run_path
from tests.support.case import open_case


def _write(scenario: str, file: Path, *overrides: str) -> None:
    sets = [word for override in overrides for word in ("--set", override)]
    answer = CliRunner().invoke(app, ["check", str(SCENARIOS / f"{scenario}.yaml"), *sets, "--model", str(file)])
    assert answer.exit_code == 0, answer.output


@pytest.mark.parametrize(
    ("scenario", "until"),
    # Constant wind with a load step, and a turbulent series that is made while running otherwise.
    [("load_step_8ms", 60.0), ("turbulent_10min", 320.0)],
)
def test_gust_run_gives_the_rows_of_simulate(tmp_path: Path, scenario: str, until: float) -> None:
    model, rows = tmp_path / "model.gust", tmp_path / "rows.csv"
    overrides = (f"run.until={until} s", "output.channels=[sg.frequency, wt.omega_r]")
    _write(scenario, model, *overrides)
    run = subprocess.run(
        [gust_run_path(), model, "--until", f"{until}", "--every", "0.1", "--rtol", "1e-6", "--out", rows],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert rows.read_text().splitlines()[0] == '"time [s]","sg.frequency [Hz]","wt.omega_r [pu]"'
    table = np.loadtxt(rows, delimiter=",", skiprows=1)
    times, channels, _ = open_case(scenario, *overrides).run(("sg.frequency", "wt.omega_r"), 0.1, rtol=1e-6)
    np.testing.assert_allclose(table[:, 0], times, rtol=1e-6)
    # The same library on the same numbers; the CSV has seven digits, so half of the last is at most 5e-7.
    np.testing.assert_allclose(table[:, 1], channels["sg.frequency"], rtol=5.1e-7)
    np.testing.assert_allclose(table[:, 2], channels["wt.omega_r"], rtol=5.1e-7)


def test_a_model_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    file = tmp_path / "missing" / "model.gust"
    answer = CliRunner().invoke(app, ["check", str(SCENARIOS / "load_step_8ms.yaml"), "--model", str(file)])
    assert answer.exit_code == 2
    assert "GF7001" in answer.output

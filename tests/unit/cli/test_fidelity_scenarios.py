"""Every shipped scenario runs in every fidelity."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS

FILES = sorted(path.name for path in SCENARIOS.glob("*.yaml"))


@pytest.mark.parametrize("fidelity", ["lossless", "rms", "dq"])
@pytest.mark.parametrize("name", FILES)
def test_runs_in_every_fidelity(name: str, fidelity: str, tmp_path: Path) -> None:
    arguments = ["simulate", SCENARIOS / name, "--out", tmp_path, "--set", f"fidelity={fidelity}"]
    arguments += ["--no-figure", "--json"]
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    # no load step of these takes the frequency further than this, and with nothing at all it would not fall
    assert 49.0 < data["frequency"]["nadir_hz"] < 50.0, data

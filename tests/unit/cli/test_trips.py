"""Who tripped and when: in the summary, in the last line, in the figure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.trips import TripWatch


def test_first_row_with_a_trip_counts_across_blocks() -> None:
    watch = TripWatch(["bus.V", "a.tripped", "b.tripped", "c.tripped"])
    rows = np.zeros((3, 4), np.float32)
    rows[:, 0] = 1.0
    watch.add(np.array([0.0, 1.0, 2.0]), rows)
    assert watch.times == {}
    rows[1:, 2] = 1.0
    watch.add(np.array([3.0, 4.0, 5.0]), rows)
    rows[:, 1:3] = 1.0
    watch.add(np.array([6.0, 7.0, 8.0]), rows)
    watch.add(np.zeros(0), np.zeros((0, 4), np.float32))
    assert watch.times == {"b": 4.0, "a": 6.0}


@pytest.mark.parametrize(("control", "trips"), [("Droop", True), ("DualPort", False)])
def test_run_that_loses_a_turbine_completes_and_says_so(control: str, trips: bool, tmp_path: Path) -> None:
    scenario = SCENARIOS / "dc_collapse.yaml"
    arguments = [
        "simulate",
        scenario,
        "--out",
        tmp_path,
        "--set",
        f"wt.control.type={control}",
        "--set",
        "run.until=50s",
    ]
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "completed"
    assert ("trips" in summary) == trips
    assert ("wt tripped at" in done.output) == trips
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    if trips:
        assert list(summary["trips"]) == ["wt"]
        assert 45.0 < summary["trips"]["wt"] < 50.0

"""Campaigns as users run them."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import xarray

from gustform_cli.sweep.store import JOURNAL
from tests.unit.cli.sweep.campaigns import (
    BASE,
    CURTAILMENTS,
    SHORT,
    about,
    numbers,
    rows,
    start,
    sweep,
    wait_for_cases,
    write,
)

FAILING = """
axes:
  - type: list
    values:
      wt.curtailment: [5 %, 10 %]
      events: [[], [{at: 2 s, set: {load.active: 3000 MW}}]]    # ten times what the plants can give
keep: failed
"""


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign whose files are kept."""
    folder = tmp_path_factory.mktemp("swept")
    body = f"{CURTAILMENTS}      wind.wt.seed: [1, 2]\nkeep: all\ntransient_time: 2 s\n"
    body += 'scalars: ["*.mean", "*.std", "*.max"]\n'
    result = sweep(write(folder, body), folder / "out")
    assert result.exit_code == 0, result.output
    assert "4 cases, 4 run now" in result.stdout
    return folder / "out"


def test_the_table_has_axes_in_their_units_and_a_row_for_each_case(swept: Path) -> None:
    found = rows(swept)
    assert [(row["case"], row["wt.curtailment"], row["wind.wt.seed"]) for row in found] == [
        (1, 5.0, 1), (2, 5.0, 2), (3, 10.0, 1), (4, 10.0, 2),
    ]  # fmt: skip
    schema = pq.read_schema(swept / "scalars.parquet")
    assert schema.field("wt.curtailment").metadata == {b"unit": b"%"}
    assert schema.field("wt.P.mean").metadata == {b"unit": b"W"}
    assert schema.field("sg.frequency.max").metadata == {b"unit": b"Hz"}
    assert {row["status"] for row in found} == {"completed"}
    assert [name for name in schema.names if name.startswith("wt.P")] == ["wt.P.mean", "wt.P.std", "wt.P.max"]


def test_statistics_are_those_of_the_rows_after_the_transient(swept: Path) -> None:
    for row in rows(swept):
        with xarray.open_dataset(swept / row["result"]) as data:
            assert data.sizes["time"] == 51
            late = data.sel(time=slice(2.0 - 1e-9, None))
            assert late.sizes["time"] == 31
            for name in ("sg.frequency", "wt.P", "wt.wind"):
                values = late[name].values.astype(np.float64)
                assert row[f"{name}.mean"] == pytest.approx(values.mean(), rel=1e-12)
                assert row[f"{name}.std"] == pytest.approx(values.std(), rel=1e-9, abs=1e-9 * abs(values.mean()))
                assert row[f"{name}.max"] == values.max()


def test_provenance_is_in_the_table_and_in_each_result(swept: Path) -> None:
    found = about(swept)
    assert found["base"] == BASE.read_text()
    assert found["campaign"] == (swept / "campaign.yaml").read_text()
    assert found["axes"] == ["wt.curtailment", "wind.wt.seed"]
    assert found["cases"] == 4
    assert set(found["versions"]) >= {"gustform", "casadi", "sundials", "numpy"}
    row = rows(swept)[2]
    with xarray.open_dataset(swept / row["result"]) as data:
        assert "curtailment: 10 %" in data.attrs["scenario"]
        assert json.loads(data.attrs["versions"]) == found["versions"]


def test_a_case_is_what_simulate_gives(swept: Path, tmp_path: Path) -> None:
    """The same file, byte for byte in every channel."""
    from typer.testing import CliRunner

    from gustform_cli.main import app

    settings = [
        "run.until=5 s", "events=[]", "output.every=100 ms", "wt.wind_speed=10 m/s", "wt.curtailment=10 %",
        'output.channels=["sg.frequency", "wt.P", "wt.wind"]', "wind.wt.seed=2",
    ]  # fmt: skip
    sets = [word for setting in settings for word in ("--set", setting)]
    result = CliRunner().invoke(app, ["simulate", str(BASE), "--out", str(tmp_path), "--no-figure", *sets])
    assert result.exit_code == 0, result.output
    file = swept / rows(swept)[3]["result"]
    with xarray.open_dataset(file) as mine, xarray.open_dataset(tmp_path / "result.nc") as other:
        assert list(mine) == list(other)
        assert all(mine[name].values.tobytes() == other[name].values.tobytes() for name in mine)


def test_a_rerun_does_nothing_and_a_larger_campaign_only_what_is_new(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert sweep(write(tmp_path), out).exit_code == 0
    before = numbers(out)
    journal = (out / JOURNAL).read_bytes()
    again = sweep(write(tmp_path), out, "--json")
    assert json.loads(again.stdout) | {"ran": 0, "kept": 2} == json.loads(again.stdout)
    assert (out / JOURNAL).read_bytes() == journal
    assert numbers(out) == before
    larger = sweep(write(tmp_path, CURTAILMENTS.replace("[5 %", "[7 %, 5 %")), out, "--json")
    found = json.loads(larger.stdout)
    assert (found["cases"], found["ran"], found["kept"]) == (3, 1, 2)
    assert [(row["case"], row["wt.curtailment"]) for row in rows(out)] == [(1, 7.0), (2, 5.0), (3, 10.0)]


def test_a_file_that_is_gone_is_made_again(swept: Path, tmp_path: Path) -> None:
    missing = swept / rows(swept)[0]["result"]
    missing.unlink()
    result = sweep(swept / "campaign.yaml", swept, "--json")
    assert json.loads(result.stdout)["ran"] == 1, result.output
    assert missing.is_file()


def test_failures_are_listed_and_do_not_stop_the_rest(tmp_path: Path) -> None:
    out = tmp_path / "out"
    short = SHORT.replace("events: [], ", "")
    result = sweep(write(tmp_path, FAILING, short), out)
    assert result.exit_code == 1
    assert "2 cases, 2 run now, 1 failed" in result.stdout
    assert "case 2 (wt.curtailment = 10 %, events = " in result.stderr
    assert "): error GF6" in result.stderr
    good, bad = rows(out)
    assert (good["status"], bad["status"]) == ("completed", "failed")
    assert good["error"] is None
    assert bad["error_code"].startswith("GF6")
    assert "load" in bad["events"]
    # The file of the one that failed is kept, up to where it came.
    assert good["result"] is None
    with xarray.open_dataset(out / bad["result"]) as data:
        assert data.attrs["status"] == "failed"
        assert 0 < data.sizes["time"] < 51
    assert [file.name for file in (out / "runs").iterdir()] == [Path(bad["result"]).name]
    # It is tried again, the other is not.
    again = sweep(write(tmp_path, FAILING, short), out, "--json")
    assert again.exit_code == 1
    assert (json.loads(again.stdout)["ran"], json.loads(again.stdout)["kept"]) == (1, 1)


@pytest.mark.parametrize(
    ("axis", "code", "place", "words"),
    [
        ("{wt.curtailment: [5 %, 120 %]}", "GF2003", "4:52", ["case 2 (wt.curtailment = 120 %)", "at most 0.95"]),
        ("{wt.curtailment: [5 %, 3 m]}", "GF2302", "4:52", ["case 2", "3 m"]),
        ("{wt.curtailmant: [5 %]}", "GF2402", "4:47", ["case 1", "curtailment"]),
        ("{load.active: [100 MW, 900 MW, 90 MW]}", "GF5001", "4:52", ["case 2", "load.active = 900 MW"]),
        ("{wind.wt.mean: [8 m/s], wt.wind_speed: [8 m/s, 30 m/s]}", "GF2020", "4:76", ["case 2", "30 m/s"]),
    ],
)
def test_an_impossible_value_is_said_before_anything_runs(
    tmp_path: Path, axis: str, code: str, place: str, words: list[str]
) -> None:
    out = tmp_path / "out"
    body = f"axes: [{{type: grid, values: {axis}}}]"
    result = sweep(write(tmp_path, body, SHORT.replace(", wt.wind_speed: 10 m/s", "")), out)
    assert result.exit_code in (1, 2)
    assert f"campaign.yaml:{place}: error {code}" in result.stderr
    for word in words:
        assert word in result.stderr
    assert not (out / "scalars.parquet").exists()
    assert (out / JOURNAL).read_bytes() == b""


def test_a_scalar_that_no_case_has_is_refused_before(tmp_path: Path) -> None:
    result = sweep(write(tmp_path, f"{CURTAILMENTS}scalars: [wt.P.mean, wt.P.meen]"), tmp_path / "out")
    assert result.exit_code == 2
    assert "campaign.yaml:8:22: error GF2606" in result.stderr
    assert "try wt.P.mean" in result.stderr


def test_a_warning_is_said_once_and_before(tmp_path: Path) -> None:
    body = "axes: [{type: grid, values: {wind.wt.seed: [1, 2], wt.curtailment: [5 %, 6 %], wind.wt.on_end: [repeat]}}]"
    short = SHORT.replace("set: {", "set: {wind.wt.duration: 3 s, ")
    result = sweep(write(tmp_path, body, short), tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert result.stderr.count("warning: ") == 1
    assert "repeat" in result.stderr


def test_ctrl_c_keeps_what_has_ended(tmp_path: Path) -> None:
    values = ", ".join(f"{seed}" for seed in range(1, 201))
    body = f"axes: [{{type: grid, values: {{wind.wt.seed: [{values}]}}}}]\nkeep: all"
    file, out = write(tmp_path, body, SHORT.replace("5 s", "1 h")), tmp_path / "out"
    process = start(file, out, "--workers", 2)
    wait_for_cases(process, out, 3)
    os.kill(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    done = rows(out)
    assert 0 < len(done) < 200
    assert f"{200 - len(done)} not run" in stdout
    assert sorted(f"runs/{f.name}" for f in (out / "runs").iterdir()) == sorted(row["result"] for row in done)


def test_kill_9_keeps_what_has_ended(tmp_path: Path) -> None:
    values = ", ".join(f"{seed}" for seed in range(1, 31))
    body = f"axes: [{{type: grid, values: {{wind.wt.seed: [{values}]}}}}]"
    file, out = write(tmp_path, body, SHORT.replace("5 s", "5 min")), tmp_path / "out"
    process = start(file, out, "--workers", 2)
    wait_for_cases(process, out, 5)
    process.kill()
    process.communicate()
    result = sweep(file, out, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert found["kept"] >= 5
    assert found["ran"] + found["kept"] == 30
    whole = tmp_path / "whole"
    assert sweep(file, whole).exit_code == 0
    assert numbers(out) == numbers(whole)


def test_the_number_of_workers_changes_no_bit(tmp_path: Path) -> None:
    file = write(tmp_path, f"{CURTAILMENTS}      wind.wt.seed: [1, 2, 3]\n")
    for workers in (1, 3):
        assert sweep(file, tmp_path / str(workers), "--workers", workers).exit_code == 0
    assert numbers(tmp_path / "1") == numbers(tmp_path / "3")

"""`gustform study stability`: the theorem checked and the limits found, on both models."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from gustform_cli.main import app


def gustform(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], Result]:
    out = tmp_path_factory.mktemp("stability")
    result = gustform("study", "stability", "--out", out, "--json", "--seed", "3")
    assert result.exit_code == 0, result.stderr
    return out, json.loads(result.stdout), result


def test_the_theorem_holds(study: tuple[Path, dict[str, Any], Result]) -> None:
    theorem = study[1]["theorem"]
    assert theorem["sets"] == 20_000
    assert theorem["seed"] == 3
    assert theorem["counter_examples"] == 0
    assert theorem["largest_real_part"] < 0.0
    assert theorem["identity_error"] < 1e-12
    # the check is not blind: without a condition many of the same sets are unstable
    assert theorem["unstable_without_ratio_condition"] > 1000
    assert theorem["unstable_with_negative_slope"] > 1000


def test_the_published_pair_is_shown_to_be_unstable(study: tuple[Path, dict[str, Any], Result]) -> None:
    published = study[1]["published"]
    assert published["T_dc_limit"] == pytest.approx(0.0067 / 0.5)
    pair, used = published["published"], published["used"]
    assert pair["T_dc"] == 0.05
    assert pair["conditions"]["T_dc < K_d/K_theta"]["holds"] is False
    assert pair["rightmost_simplified"][0] > 1.0
    assert pair["rightmost_rms"][0] > 1.0
    assert used["conditions"]["T_dc < K_d/K_theta"]["holds"] is True
    assert used["rightmost_simplified"][0] < 0.0
    assert used["rightmost_rms"][0] < 0.0


def test_where_stability_ends(study: tuple[Path, dict[str, Any], Result]) -> None:
    limits = study[1]["limits"]
    (simple,) = limits["T_dc"]["simplified"]
    (full,) = limits["T_dc"]["rms"]
    assert simple == pytest.approx(0.0134, rel=1e-3)  # K_d/K_theta
    assert 0.0134 < full < 0.02  # project notes: on the full model
    # the theorem's ratio, 1, lies inside the stable range of every model
    values = study[1]["limits"]["K_d_ratio"]
    assert values["simplified"][0] > 1.0
    assert values["simplified_filtered"][0] < 1.0 < values["simplified_filtered"][1]
    assert values["rms"][0] < 1.0
    # without an active governor the condition K_wt >= 0 is sharp, on the full model too
    slopes = limits["K_wt"]
    assert slopes["simplified_no_governor"] == pytest.approx([0.0], abs=1e-6)
    assert slopes["rms_dead_band"] == pytest.approx([0.0], abs=1e-4)
    assert slopes["rms_dead_band_moved"] == pytest.approx([0.0], abs=0.01)  # interpolated between operating points
    # an active governor holds more
    assert slopes["simplified"][-1] < 0.0
    assert slopes["rms"][-1] < slopes["simplified"][-1]


def test_eigenvalues_are_there_for_comparison(study: tuple[Path, dict[str, Any], Result]) -> None:
    eigenvalues = study[1]["eigenvalues"]
    assert len(eigenvalues["simplified"]) == 6
    assert len(eigenvalues["simplified_filtered"]) == 7
    assert len(eigenvalues["rms"]) == len(eigenvalues["rms_dead_band"]) > 15
    assert all(pair[0] < 0.0 for pairs in eigenvalues.values() for pair in pairs)


def test_files(study: tuple[Path, dict[str, Any], Result]) -> None:
    out, summary, result = study
    assert {p.name for p in out.iterdir()} == {"stability.png", "sweeps.csv", "limits.csv", "summary.json"}
    assert json.loads((out / "summary.json").read_text()) == summary
    assert (out / "stability.png").read_bytes()[:4] == b"\x89PNG"
    with (out / "sweeps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["parameter"] for row in rows} == {"T_dc", "K_d_ratio", "K_wt"}
    for row in rows:
        assert (float(row["real_per_s"]) < 0.0) is (row["stable"] == "yes")
    with (out / "limits.csv").open() as file:
        ranges = [row for row in csv.DictReader(file) if row["parameter"] == "T_dc" and row["model"] == "rms"]
    assert [row["stable"] for row in ranges] == ["yes", "no"]
    assert ranges[0]["to"] == ranges[1]["from"]
    assert "theorem" in result.stderr, "progress"


def test_an_unwritable_folder_is_refused_first(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = gustform("study", "stability", "--out", tmp_path / "file" / "folder")
    assert result.exit_code == 2
    assert "GF7001" in result.stderr
    assert "random" not in result.stderr


def test_lines_for_people(tmp_path: Path) -> None:
    result = gustform("study", "stability", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "0 counter-examples" in result.stdout
    assert "T_dc < K_d/K_theta = 0.0134 s is broken" in result.stdout
    assert str(tmp_path / "stability.png") in result.stdout

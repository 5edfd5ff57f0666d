"""`gustform linearise`: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS

LOAD_STEP = SCENARIOS / "load_step_8ms.yaml"


def gustform(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("linear")
    return out, gustform("linearise", LOAD_STEP, "--out", out, "--json", "--input", "sg.governor.P_ref")


def test_json_has_the_modes(printed: tuple[Path, Result]) -> None:
    out, result = printed
    assert result.exit_code == 0, result.stderr
    data: dict[str, Any] = json.loads(result.stdout)
    assert data == json.loads((out / "modes.json").read_text())
    assert data["stable"] is True
    assert all(len(pair) == 2 for pair in data["eigenvalues"])
    assert len(data["eigenvalues"]) == len(data["states"])
    whole = sum(2 if mode["eigenvalue"][1] else 1 for mode in data["modes"])
    assert whole == len(data["eigenvalues"]), "each pair is one mode"
    for mode in data["modes"]:
        assert sum(mode["participation"].values()) == pytest.approx(1.0, abs=1e-4)
    (reference,) = [mode for mode in data["modes"] if mode["kind"] == "reference angle"]
    assert reference["eigenvalue"] == [0.0, 0.0]
    assert reference["participation"] == {"sg.delta": 1.0}
    assert reference["damping_ratio"] is None
    # the swing between generator and turbine
    swing = max((m for m in data["modes"] if 0.3 < m["frequency_hz"] < 2.0), key=lambda m: m["frequency_hz"])
    assert set(list(swing["participation"])[:2]) == {"wt.gsc.theta", "sg.omega"}
    assert swing["damping_ratio"] == pytest.approx(-swing["eigenvalue"][0] / np.hypot(*swing["eigenvalue"]), rel=1e-12)
    assert {name: Path(path).name for name, path in data["paths"].items()} == {
        "matrices": "linear.nc", "modes": "modes.json", "figure": "eigenvalues.png",
    }  # fmt: skip


def test_the_matrices_belong_to_the_modes(printed: tuple[Path, Result]) -> None:
    out, result = printed
    data = json.loads(result.stdout)
    with xarray.open_dataset(out / "linear.nc") as file:
        A = file["A"].values
        found = file["eigenvalue"].values
        values = found[:, 0] + 1j * found[:, 1]
        np.testing.assert_allclose(found, np.array(data["eigenvalues"]), rtol=1e-12)
        right = file["right"].values[..., 0] + 1j * file["right"].values[..., 1]
        left = file["left"].values[..., 0] + 1j * file["left"].values[..., 1]
        scale = np.maximum(np.abs(file["x0"].values), 1.0)[:, None]
        # eigenvectors to round-off of the fastest mode (500 /s) times the condition of the vectors (1e3)
        assert np.max(np.abs(A @ right - right * values) / scale) < 1e-8 * np.max(np.abs(values))
        np.testing.assert_allclose(left @ right, np.eye(A.shape[0]), atol=1e-9)
        assert file["state"].values.tolist() == [q["name"] for q in data["states"]]
        assert file["input"].values.tolist() == ["wt.wind", "load.active", "sg.governor.P_ref"]
        assert file["input_unit"].values.tolist() == ["m/s", "W", "pu"]
        assert file["u0"].values[:2].tolist() == [8.0, 100e6]
        # 1 W more load is 1 W more in the channel load.P at once
        assert float(file["D"].sel(output="load.P", input="load.active")) == pytest.approx(1.0, rel=1e-9)
        assert float(file["y0"].sel(output="sg.frequency")) == pytest.approx(50.0, abs=1e-6)
        assert float(file["C"].sel(output="sg.frequency", state="sg.omega")) == pytest.approx(50.0, rel=1e-12)
        assert "active: 100 MW" in file.attrs["scenario"]
    assert {path.name for path in out.iterdir()} == {"linear.nc", "modes.json", "eigenvalues.png"}
    assert (out / "eigenvalues.png").read_bytes()[:4] == b"\x89PNG"


def test_limiters_are_told(printed: tuple[Path, Result]) -> None:
    _, result = printed
    # project notes: inside the governor's dead band the frequency is neutral
    assert any("sg.omega has no influence in governor" in line for line in result.stderr.splitlines())
    data = json.loads(result.stdout)
    assert any(one["unknowns"] == ["sg.omega"] for one in data["on_a_flat_part"])


def test_the_table_names_what_grows(tmp_path: Path) -> None:
    result = gustform("linearise", LOAD_STEP, "--out", tmp_path, "--set", "wt.control.T_dc=50 ms")
    assert result.exit_code == 0, "an unstable operating point is a result"
    first = next(line for line in result.stdout.splitlines() if "unstable" in line)
    assert "wt.dc_link.v" in first
    assert "unstable: 1 mode grows" in result.stdout
    assert "reference angle" in result.stdout
    for name in ("linear.nc", "modes.json", "eigenvalues.png"):
        assert str(tmp_path / name) in result.stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--input", "sg.governor.P_reff"], "GF2008"),
        (["--input", "gs.governor.P_ref"], "GF2007"),
        (["--set", "wt.curtailmant=10 %"], "curtailmant"),
    ],
)
def test_what_is_wrong_is_said(arguments: list[str], said: str, tmp_path: Path) -> None:
    result = gustform("linearise", LOAD_STEP, "--out", tmp_path, *arguments)
    assert result.exit_code == 2
    assert said in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused_first(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    # the scenario does not even exist: the folder is looked at before
    result = gustform("linearise", tmp_path / "none.yaml", "--out", tmp_path / "file" / "folder")
    assert result.exit_code == 2
    assert "GF7001" in result.stderr
    assert "none.yaml" not in result.stderr


def test_no_steady_state_is_said_with_the_file(tmp_path: Path) -> None:
    result = gustform("linearise", LOAD_STEP, "--out", tmp_path, "--set", "load.active=2000 MW")
    assert result.exit_code == 1
    assert "GF5001" in result.stderr
    assert "load_step_8ms.yaml" in result.stderr

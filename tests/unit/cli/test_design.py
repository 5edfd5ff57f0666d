"""`gustform design` and `gustform study droop-map` as they are called."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS


def gustform(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def designed(*arguments: object) -> dict[str, Any]:
    result = gustform("design", *arguments, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)  # type: ignore[no-any-return]


# ---- design ---------------------------------------------------------------------------------------------------------
def test_report_has_the_published_numbers() -> None:
    result = gustform("design", "--wind", "10 m/s", "--eta", "90 %")
    assert result.exit_code == 0
    assert result.stderr == ""
    # Lyu, Subotic, Gross 2022, Table III (K_p to 1 %)
    for words in ("rated wind 11.23 m/s", "1.2000  pu", "2.983  deg", "K_wr 0.0822 pu", "K_beta 0.0200 pu/deg",
                  "K_msc         6.573 pu", "K_p           22.69 deg/pu", "droop m_p 14.16 %"):  # fmt: skip
        assert words in result.stdout
    assert result.stdout.count("binds") == 3


def test_json_has_everything() -> None:
    found = designed("--wind", "8 m/s")
    assert set(found) == {
        "operating_point", "slopes", "reserves", "limits", "gains", "m_p_percent", "warnings",
    }  # fmt: skip
    assert found["operating_point"]["omega_del"] == pytest.approx(1.16, abs=0.005)
    assert found["slopes"]["kind"] == "secant"
    assert [limit["gain"] for limit in found["limits"]] == ["K_gsc", "K_msc", "K_p"]
    assert set(found["gains"]) == {"K_gsc", "K_msc", "K_p", "K_d_gsc", "K_d_msc", "T_dc"}
    assert found["m_p_percent"] == pytest.approx(27.7, abs=0.05)
    assert found["warnings"] == []
    assert designed("--wind", "8 m/s", "--curtailment", "10 %") == found
    assert designed("--wind", "8 m/s", "--curtailment", "0")["m_p_percent"] is None
    assert designed("--wind", "12 m/s")["limits"][1]["bound"] is None


def test_options_reach_the_design() -> None:
    found = designed(
        "--wind", "36 km/h", "--frequency-reserve", "0.5 %", "--dc-reserve", "2 %", "--tangent", "--K-gsc", "0.3",
        "--K-msc", "5", "--K-p", "20 deg", "--K-d-gsc", "5 ms", "--K-d-msc", "80 ms", "--T-dc", "1 ms",
    )  # fmt: skip
    assert found["operating_point"]["wind"] == pytest.approx(10.0)
    assert found["reserves"]["frequency_pu"] == 0.005
    assert found["slopes"]["kind"] == "tangent"
    assert found["gains"] == {"K_gsc": 0.3, "K_msc": 5.0, "K_p": 20.0, "K_d_gsc": 0.005, "K_d_msc": 0.08, "T_dc": 0.001}
    assert len(found["warnings"]) == 1  # the ratio


def test_warnings_go_to_stderr() -> None:
    result = gustform("design", "--wind", "8 m/s", "--T-dc", "50 ms")
    assert result.exit_code == 0
    assert result.stderr.startswith("warning: T_dc = 0.05 s is not below K_d_gsc/K_gsc = 0.0134 s")
    assert "warning" not in result.stdout


def test_a_scenario_gives_rotor_ratings_and_defaults() -> None:
    file = SCENARIOS / "load_step_8ms.yaml"
    assert designed(file, "wt") == designed(file) == designed("--wind", "8 m/s")
    farm = designed(SCENARIOS / "farm.yaml", "wt")
    assert farm["operating_point"]["wind"] == 10.0
    assert designed(SCENARIOS / "farm.yaml", "wt[2]") == farm


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--wind", "5 m/s", "--eta", "0.2"], "GF2022", "highest tip speed ratio"),
        (["--wind", "2 m/s"], "GF2020", "cut-in at 3 m/s"),
        (["--wind", "8 m/s", "--K-gsc", "0.1"], "GF2044", "DC voltage limit"),
        (["--wind", "8 m/s", "--K-msc", "30"], "GF2045", "rotor speed limit"),
        (["--wind", "10 m/s", "--K-p", "30 deg"], "GF2046", "pitch angle limit"),
        (["--wind", "8"], "GF2301", "--wind must be written with its unit"),
        (["--wind", "8 kg"], "GF2302", "--wind"),
        (["--eta", "0.9", "--curtailment", "0.1"], "GF2047", "only one"),
        (["--eta", "1.2"], "GF2021", "curtailment must be at least 0"),
        ([SCENARIOS / "load_step_8ms.yaml", "sg"], "GF2047", "'sg' must be a PmsgTurbine"),
        ([SCENARIOS / "load_step_8ms.yaml", "wt2"], "GF2047", "try wt"),
        ([Path("no.yaml")], "GF", "no.yaml"),
        (["--table", "/no/folder/t.c"], "GF2043", "cannot be written"),
    ],
)
def test_what_cannot_be_is_refused(arguments: list[object], code: str, words: str) -> None:
    result = gustform("design", *arguments)
    assert result.exit_code == 2
    assert code in result.stderr
    assert words in result.stderr


def test_the_table_is_written_as_c(tmp_path: Path) -> None:
    file = tmp_path / "nrel.c"
    assert gustform("design", "--table", file).exit_code == 0
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None, "the tests need a C compiler"
    run = subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", str(file), "-o", "/dev/null"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert "nrel_omega_del" in file.read_text()


# ---- droop map ------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("droop")
    return out, gustform("study", "droop-map", "--out", out, "--json")


def test_study_writes_figure_tables_and_summary(studied: tuple[Path, Result]) -> None:
    out, result = studied
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in out.iterdir()} == {
        "droop_map.png", "droop_map.csv", "infeasible.csv", "summary.json",
    }  # fmt: skip
    summary = json.loads(result.stdout)
    assert json.loads((out / "summary.json").read_text()) == summary
    assert (out / "droop_map.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    eta, wind, m_p = summary["eta"], summary["wind"], summary["m_p_percent"]
    assert [len(row) for row in m_p] == [len(wind)] * len(eta)
    # half of the published 27.7 % and 14.2 %, which are for twice the deviation
    assert m_p[eta.index(0.9)][wind.index(8.0)] == pytest.approx(27.7 / 2, abs=0.025)
    assert m_p[eta.index(0.9)][wind.index(10.0)] == pytest.approx(14.2 / 2, abs=0.025)
    assert m_p[0][0] is None  # 30 % at 4 m/s
    nothing = sum(value is None for row in m_p for value in row)
    lines = (out / "infeasible.csv").read_text().splitlines()
    assert len(lines) - 1 == nothing == summary["infeasible"]
    assert lines[1].startswith("0.7,4,GF2022,")
    assert len((out / "droop_map.csv").read_text().splitlines()) == 1 + len(eta) * len(wind)


def test_study_shows_progress(studied: tuple[Path, Result]) -> None:
    lines = studied[1].stderr.splitlines()
    assert lines[0].endswith("eta 0.70, row 1 of 15")
    assert lines[-1].endswith("eta 0.98, row 15 of 15")


def test_study_prints_a_map_and_what_is_missing(tmp_path: Path) -> None:
    result = gustform("study", "droop-map", "--out", tmp_path)
    assert result.exit_code == 0
    assert "0.90           111    56.6    32.8    20.6    13.8    9.71    7.08" in result.stdout
    assert "128 of 1665 points are infeasible" in result.stdout
    assert "128 x GF2022" in result.stdout


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = gustform("study", "droop-map", "--out", tmp_path / "file" / "map")
    assert result.exit_code == 1 or result.exit_code == 2
    assert "GF7001" in result.stderr

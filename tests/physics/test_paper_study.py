"""`gustform study paper` as its users call it: nine real cases, the published numbers, the files, Ctrl-C, errors."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.study import paper_cases, published
from gustform_cli.study.paper_tables import compare

CONTROLS, WINDS = ("gfl", "gfm_mppt", "gfm_fr"), ("8", "10", "12")
FIGURES = ("paper_8ms.png", "paper_10ms.png", "paper_12ms.png", "droop_map.png", "eigenvalues.png")


def study(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["study", "paper", *map(str, arguments)])


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("paper") / "study"
    return out, study("--out", out)


@pytest.fixture(scope="module")
def summary(done: tuple[Path, Result]) -> dict[str, Any]:
    assert done[1].exit_code == 0, done[1].stderr
    found: dict[str, Any] = json.loads((done[0] / "summary.json").read_text())
    return found


def at(summary: dict[str, Any], path: str) -> Any:
    for name in path.split("."):
        summary = summary[name]
    return summary


# ---- "Published figures to reach" of the project notes, row by row: value and tolerance -----------------------------
@pytest.mark.parametrize(
    ("path", "value", "tolerance"),
    [
        ("frequency.gfl.8.nadir_hz", 49.397, 0.005),
        ("frequency.gfm_fr.8.nadir_hz", 49.644, 0.005),
        ("frequency.gfm_fr.10.nadir_hz", 49.613, 0.005),
        ("frequency.gfl.8.settle_hz", 49.709, 0.003),
        ("frequency.gfm_mppt.8.settle_hz", 49.709, 0.003),
        ("frequency.gfm_fr.8.settle_hz", 49.724, 0.003),
        # rounding: half of the last digit that the paper prints
        ("gains.8.omega_del_pu", 1.16, 0.005),
        ("gains.10.omega_del_pu", 1.2, 1e-12),
        ("gains.12.omega_del_pu", 1.2, 1e-12),
        ("gains.8.beta_del_deg", 0.0, 1e-12),
        ("gains.10.beta_del_deg", 3.0, 0.05),
        ("gains.12.beta_del_deg", 5.4, 0.05),
        ("gains.8.K_msc", 15.1, 0.05),
        ("gains.10.K_msc", 6.6, 0.05),
        ("gains.12.K_msc", 1.0, 1e-12),
        ("gains.8.K_p", 0.0, 1e-12),
        ("gains.10.K_p", 22.7, 0.227),
        ("gains.12.K_p", 270.0, 2.7),
        ("gains.8.K_wr", 0.119, 0.0005),
        ("gains.10.K_wr", 0.082, 0.0005),
        ("gains.12.K_wr", 0.0, 1e-12),
        ("gains.8.K_beta", 0.0, 1e-12),
        ("gains.10.K_beta", 0.02, 0.005),
        ("gains.8.m_p_percent", 27.7, 0.05),
        ("gains.10.m_p_percent", 14.2, 0.05),
        # not reachable, and not to be chased: what the surface of the reproduction gives instead
        ("gains.12.K_beta", 0.091, 0.0005),
        ("gains.12.m_p_percent", 2.05, 0.005),
        # the reference model of tests/reference, which has neither of these published
        ("frequency.gfm_fr.12.nadir_hz", 49.6919, 0.0005),
        ("frequency.gfm_fr.12.settle_hz", 49.7672, 0.0005),
        ("frequency.gfm_fr.8.rocof_hz_per_s", -0.259, 0.001),
        ("frequency.gfm_mppt.8.rocof_hz_per_s", -0.373, 0.001),
        # a constant power, the limit of ideal grid-following control, in the reference model
        ("frequency.gfl.8.rocof_hz_per_s", -0.398, 0.002),
    ],
)
def test_published_figures(summary: dict[str, Any], path: str, value: float, tolerance: float) -> None:
    assert at(summary, path) == pytest.approx(value, abs=tolerance)


def test_maximum_power_with_grid_forming_control_comes_out_above(summary: dict[str, Any]) -> None:
    # project notes: 15 to 26 mHz above grid-following control, by the inertia of the rotor
    above = at(summary, "frequency.gfm_mppt.8.nadir_hz") - at(summary, "frequency.gfl.8.nadir_hz")
    assert 0.015 < above < 0.026


def test_every_published_number_is_met_but_the_known_ones(done: tuple[Path, Result]) -> None:
    known = {"frequency.gfm_mppt.8.nadir_hz", "control.T_dc", "gains.12.K_beta", "gains.12.m_p_percent"}
    assert {p.key for p in published.ALL if p.beside} == known
    met = len(published.ALL) - len(known)
    report = (done[0] / "report.md").read_text()
    assert f"{met} of {len(published.ALL)} published numbers are met" in report
    assert f"{met} of {len(published.ALL)} published numbers met, all but:" in done[1].stdout
    assert report.count("**not met**") == 2 * len(known), "in the list of what is missed, and in its table"


def test_the_comparison_sees_a_miss() -> None:
    numbers = {p.key: p.value for p in published.ALL}
    assert all(row.met for row in compare(numbers))
    for p in published.ALL:
        off = {**numbers, p.key: p.value + 1.01 * p.tolerance + 1e-15}
        assert [row.published.key for row in compare(off) if not row.met] == [p.key]
        assert [row.published.key for row in compare({**numbers, p.key: float("nan")}) if not row.met] == [p.key]


# ---- what the summary holds -----------------------------------------------------------------------------------------
def test_keys_of_the_summary(summary: dict[str, Any]) -> None:
    assert set(summary) == {"frequency", "gains", "droop_map", "eigenvalues"}
    assert set(summary["frequency"]) == set(summary["eigenvalues"]) == set(CONTROLS)
    for control in CONTROLS:
        assert set(summary["frequency"][control]) == set(summary["eigenvalues"][control]) == set(WINDS)
        for figures in summary["frequency"][control].values():
            assert set(figures) == {
                "nadir_hz", "settle_hz", "rocof_hz_per_s", "v_dc_end_pu", "omega_r_end_pu", "beta_end_deg",
            }  # fmt: skip
            assert all(isinstance(value, float) for value in figures.values())
    assert set(summary["gains"]) == set(WINDS)
    for gains in summary["gains"].values():
        assert set(gains) == {"omega_del_pu", "beta_del_deg", "K_msc", "K_p", "K_wr", "K_beta", "m_p_percent"}
    assert set(summary["droop_map"]) == {"eta", "wind", "m_p_percent"}


def test_eigenvalues_are_stable_pairs(summary: dict[str, Any]) -> None:
    for by_wind in summary["eigenvalues"].values():
        for pairs in by_wind.values():
            values = np.array([complex(*pair) for pair in pairs])
            # one for the angle that all others are measured against; 1e-6 of a rad/s is round-off of 500 rad/s
            assert np.count_nonzero(np.abs(values) < 1e-6) == 1
            assert values[np.abs(values) >= 1e-6].real.max() < -0.01
            np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(values.conj()), atol=1e-9)


def test_the_end_of_each_case_is_in_proportion(summary: dict[str, Any]) -> None:
    """omega_r - omega_del = K_msc (v_dc - 1) and f/f0 - 1 = K_gsc (v_dc - 1) in a steady state; 60 s after the step it
    is one within 1e-4 of a pu."""
    for wind in WINDS:
        end, gains = summary["frequency"]["gfm_fr"][wind], summary["gains"][wind]
        deviation = end["v_dc_end_pu"] - 1.0
        assert end["settle_hz"] / 50.0 - 1.0 == pytest.approx(0.5 * deviation, abs=1e-4)
        assert end["omega_r_end_pu"] - gains["omega_del_pu"] == pytest.approx(gains["K_msc"] * deviation, abs=2e-3)
        assert summary["frequency"]["gfl"][wind]["v_dc_end_pu"] == pytest.approx(1.0, abs=1e-4)


def test_the_droop_map_covers_the_cases(summary: dict[str, Any]) -> None:
    eta, wind, m_p = (np.array(summary["droop_map"][key], dtype=float) for key in ("eta", "wind", "m_p_percent"))
    assert m_p.shape == (eta.size, wind.size)
    known = m_p[np.isfinite(m_p)]
    assert known.size > 0.5 * m_p.size
    assert known.min() > 0.0


# ---- files ----------------------------------------------------------------------------------------------------------
def test_files(done: tuple[Path, Result], summary: dict[str, Any]) -> None:
    out, result = done
    assert {path.name for path in out.iterdir()} == {"cases", "summary.json", "report.md", *FIGURES}
    assert {path.name for path in (out / "cases").iterdir()} == {f"{c}_{w}.nc" for c in CONTROLS for w in WINDS}
    for name in FIGURES:
        # the repository keeps copies of some, and nothing over 100 kB
        assert 5_000 < (out / name).stat().st_size < 100_000
        assert (out / name).read_bytes().startswith(b"\x89PNG")
        assert f"]({name})" in (out / "report.md").read_text()
    for name in ("report.md", "summary.json", *FIGURES):
        assert str(out / name) in result.stdout
    assert "9 of 9 cases run" in result.stderr


@pytest.mark.parametrize(("control", "kind"), [("gfl", "GridFollowing"), ("gfm_mppt", "DualPort")])
def test_a_case_is_a_whole_result(done: tuple[Path, Result], summary: dict[str, Any], control: str, kind: str) -> None:
    with xarray.open_dataset(done[0] / "cases" / f"{control}_12.nc") as data:
        assert data.attrs["status"] == "completed"
        assert f"type: {kind}" in data.attrs["scenario"]
        assert data["wt.wind"].values == pytest.approx(12.0)
        assert data["time"].values[-1] == 90.0
        frequency = data["sg.frequency"].where(data["time"] >= 30.0, drop=True)
        assert float(frequency.min()) == summary["frequency"][control]["12"]["nadir_hz"]
        assert np.abs(data["sg.frequency"].where(data["time"] < 30.0, drop=True) - 50.0).max() < 1e-4


def test_the_report_says_where_the_published_filter_fails(done: tuple[Path, Result]) -> None:
    report = (done[0] / "report.md").read_text()
    section = report[report.index("## Stability") : report.index("## Smallest")]
    rows = {cells[1].strip(): cells for line in section.splitlines() if len(cells := line.split("|")) == 6}
    # T_dc < K_d/K_theta = 0.0067 s/0.5
    assert "0.0134 s" in section
    assert "unstable" in rows["0.05"][4]
    assert float(rows["0.05"][2]) > 1.0
    assert rows["0.002"][4].strip() == "stable"
    for table in ("Table I,", "Table II,", "Table III,"):
        assert table in report


def test_the_page_shows_what_comes_out(root: Path, summary: dict[str, Any], done: tuple[Path, Result]) -> None:
    """Rows of docs/paper.md against those of the report, to the last digit that the page shows."""

    def rows(text: str) -> dict[str, list[str]]:
        cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
        return {row[0]: row[1:] for row in cells}

    page = (root / "docs" / "paper.md").read_text()
    shown, found = rows(page[page.index("## What is published") :]), rows((done[0] / "report.md").read_text())
    assert len(shown) > 20
    for name, (printed, reproduced) in shown.items():
        if set(name) == {"-"} or name == "quantity":
            continue
        digits = len(reproduced.partition(".")[2])
        assert float(printed) == float(found[name][0]), name
        # half of the last digit, and as much for solvers that differ
        assert float(reproduced) == pytest.approx(float(found[name][1]), abs=10.0**-digits), name


# ---- another fidelity, Ctrl-C, errors -------------------------------------------------------------------------------
def test_json_on_stdout_and_old_files_go(tmp_path: Path, summary: dict[str, Any]) -> None:
    (tmp_path / "cases").mkdir()
    (tmp_path / "cases" / "gfm_fr_8.nc.part").write_text("left by a killed run")
    result = study("--out", tmp_path, "--jobs", 1, "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found.pop("paths")["summary"] == str(tmp_path / "summary.json")
    assert found == summary, "also with one case at a time"
    assert not list((tmp_path / "cases").glob("*.part"))


@pytest.mark.parametrize("fidelity", ["dq", "lossless"])
def test_another_fidelity(tmp_path: Path, summary: dict[str, Any], fidelity: str) -> None:
    result = study("--out", tmp_path, "--fidelity", fidelity, "--json")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["gains"] == summary["gains"]
    report = (tmp_path / "report.md").read_text()
    assert f"Fidelity `{fidelity}`" in report
    assert "**unstable**" in report, "the published T_dc, at rms where lossless has no filter"
    for wind in WINDS:
        rms = at(summary, f"frequency.gfm_fr.{wind}.nadir_hz")
        # 5 mHz is the bound for rms and dq; another governor and machine make 11 to 30 mHz at lossless
        assert at(found, f"frequency.gfm_fr.{wind}.nadir_hz") == pytest.approx(
            rms, abs=5e-3 if fidelity == "dq" else 0.1
        )


def test_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C after the first of the cases: it is whole, the one that ran has its rows, the others never began."""
    slow = tmp_path / "slow.yaml"
    text = (SCENARIOS / "load_step_8ms.yaml").read_text()
    slow.write_text(text.replace("  rtol: 1e-6", "  rtol: 1e-6\n  max_step: 0.2 ms"))
    monkeypatch.setattr(paper_cases, "SCENARIO", slow)
    out = tmp_path / "out"
    out.mkdir()
    (out / "summary.json").write_text("{}")  # of an earlier study: would not belong to these cases

    def interrupt() -> None:
        for _ in range(600):
            if (out / "cases" / "gfl_8.nc").exists():
                time.sleep(0.2)  # of some seconds that a case takes here: into the next one
                os.kill(os.getpid(), signal.SIGINT)
                return
            time.sleep(0.05)

    watcher = threading.Thread(target=interrupt)
    watcher.start()
    result = study("--out", out, "--jobs", 1)
    watcher.join()
    assert result.exit_code == 130, result.stderr
    assert "gfl_8.nc" in result.stderr
    assert {path.name for path in out.iterdir()} == {"cases"}
    with xarray.open_dataset(out / "cases" / "gfl_8.nc") as data:
        assert data.attrs["status"] == "completed"
        assert data["time"].values[-1] == 90.0
        rows = data.sizes["time"]
    with xarray.open_dataset(out / "cases" / "gfm_mppt_8.nc") as data:
        assert data.attrs["status"] == "interrupted"
        assert data.sizes["time"] < rows  # none if the machine was so busy that it had hardly begun
    assert not (out / "cases" / "gfm_fr_12.nc").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--out", "/proc/study"], "GF7001"),
        (["--fidelity", "finest"], "lossless"),
        (["--jobs", "0"], "--jobs"),
    ],
)
def test_what_is_refused(arguments: list[str], said: str) -> None:
    begin = time.perf_counter()
    result = study(*arguments)
    assert result.exit_code == 2
    assert said in result.stderr
    assert "cases built" not in result.stderr, f"refused before anything is done; took {time.perf_counter() - begin} s"


def test_a_case_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The load asks for more than generator and turbines can give: after the step the frequency collapses."""
    heavy = tmp_path / "heavy.yaml"
    text = (SCENARIOS / "load_step_8ms.yaml").read_text()
    heavy.write_text(
        text.replace("load.active: 120 MW", "load.active: 5 GW").replace("5 Mvar", "5 Mvar\n    V_min: 0.01")
    )
    monkeypatch.setattr(paper_cases, "SCENARIO", heavy)
    result = study("--out", tmp_path / "out")
    assert result.exit_code == 1, result.stderr
    assert "error GF6" in result.stderr
    assert "case gfm_fr_8:" in result.stderr
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out" / "summary.json").exists()
    with xarray.open_dataset(tmp_path / "out" / "cases" / "gfm_fr_8.nc") as data:
        assert data.attrs["status"] == "failed"
        assert data["time"].values[-1] >= 30.0

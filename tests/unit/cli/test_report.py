"""The page of a run: one file that loads nothing, holds the numbers, and takes whatever a run has left."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.report.report import write_report
from tests.support.html_page import Page
from tests.support.run_folders import SCENARIO, write_result, write_summary

EVIL = """<script>alert(1)</script><img src=x onerror=alert(2)>"'&amp;"""


def gustform(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def page_of(folder: Path) -> Page:
    return Page(write_report(folder).read_text(encoding="utf-8"))


def assert_harmless(page: Page) -> None:
    """One script, ours, and nothing that is fetched from anywhere."""
    assert page.count("script") == 1
    assert "alert" not in "".join(page.scripts)
    assert page.handlers() == []
    assert {tag for tag, _ in page.elements} <= {
        "html", "head", "meta", "title", "style", "body", "header", "p", "h1", "h2", "h3", "span", "nav", "a", "main",
        "section", "div", "small", "figure", "figcaption", "b", "i", "svg", "path", "rect", "circle", "text", "table",
        "thead", "tbody", "tr", "th", "td", "code", "ul", "li", "dl", "dt", "dd", "details", "summary", "pre", "footer",
        "script", "wbr",
    }  # fmt: skip
    assert all(address.startswith("#") for address in page.addresses())


@pytest.fixture(scope="module")
def load_step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("load_step")
    assert gustform("simulate", SCENARIOS / "load_step_8ms.yaml", "--out", out, "--no-figure").exit_code == 0
    return out


def test_the_command_prints_where_the_page_is(load_step: Path, tmp_path: Path) -> None:
    there = gustform("report", load_step)
    assert there.exit_code == 0, there.output
    assert there.stdout.strip() == str(load_step / "report.html")
    elsewhere = gustform("report", load_step, "--out", tmp_path / "page.html", "--open", "never")
    assert elsewhere.stdout.strip() == str(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_bytes() == (load_step / "report.html").read_bytes()


def test_the_page_of_a_run_holds_its_numbers(load_step: Path) -> None:
    page = page_of(load_step)
    assert_harmless(page)
    summary = json.loads((load_step / "summary.json").read_text())
    frequency = summary["frequency"]
    assert f"{frequency['nadir_hz']:.3f}" in page.text
    assert f"{frequency['settle_hz']:.3f}" in page.text
    assert f"{frequency['rocof_hz_per_s']:.3f}" in page.text
    # Every counter of the summary is in a table with its value.
    counters = {k: v for k, v in summary.items() if isinstance(v, int | float) and k != "real_time_factor"}
    assert len(counters) > 10
    for name, value in counters.items():
        assert any(number == pytest.approx(value, rel=1e-8) for number in page.numbers), name
    for text in ("20 MW load step at 8 m/s", "completed", "PmsgTurbine", "governor.droop", "63 m", "sundials", "pu"):
        assert text in page.text
    # Six panels as drawings that say what they show.
    drawings = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(drawings) == 6
    assert all(drawing["role"] == "img" and len(drawing["aria-label"] or "") > 20 for drawing in drawings)


def test_the_scenario_is_there_as_it_was_run(load_step: Path) -> None:
    with h5py.File(load_step / "result.nc") as result:
        scenario = str(result.attrs["scenario"])
    assert scenario in page_of(load_step).texts


def test_means_and_extremes_are_those_of_the_rows(load_step: Path) -> None:
    page = page_of(load_step)
    with h5py.File(load_step / "result.nc") as result:
        for name in ("sg.frequency", "wt.v_dc", "wt.P", "wt.control.gsc.xi"):
            values = np.asarray(result[name], np.float64)
            for wanted in (values.mean(), values.std(), values.min(), values.max()):
                # nine digits are written
                assert any(number == pytest.approx(wanted, rel=2e-8, abs=1e-12) for number in page.numbers), name


def test_a_page_is_small(load_step: Path) -> None:
    # 2 MB are asked for; one with 95 channels has a tenth of it.
    assert write_report(load_step).stat().st_size < 250_000


def test_the_policy_in_the_head_allows_nothing_but_our_script(load_step: Path) -> None:
    policy = next(a["content"] for t, a in page_of(load_step).elements if a.get("http-equiv"))
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert re.search(r"script-src 'sha256-[A-Za-z0-9+/]{43}='$", policy)
    assert "http" not in policy


# ---- names and texts from files -------------------------------------------------------------------------------------
def test_no_text_of_a_file_becomes_markup(tmp_path: Path) -> None:
    time = np.linspace(0.0, 10.0, 101)
    tree = {"name": EVIL, "components": {EVIL: {"type": EVIL, "at": EVIL, EVIL: EVIL}}, "wind": {EVIL: {"type": EVIL}},
            "run": {EVIL: EVIL}, "frame": EVIL}  # fmt: skip
    name = EVIL.replace("/", "|")  # a slash makes a group in HDF5
    write_result(
        tmp_path / "result.nc",
        time,
        {f"{name}.v_dc": (EVIL, np.sin(time)), f"{name}.P_gsc": ("pu", np.cos(time)), f"{name}.wind": ("m/s", time)},
        {"title": EVIL, "description": EVIL, "scenario": json.dumps(tree), "scenario_file": EVIL,
         "events": json.dumps([{"at": 1.0, "set": {EVIL: EVIL}}]), "versions": json.dumps({EVIL: EVIL}),
         "warnings": json.dumps([EVIL]), "frequency_channel": EVIL},
    )  # fmt: skip
    write_summary(tmp_path, status=EVIL, message=EVIL, trips={EVIL: 2.0}, warnings=[EVIL], **{EVIL: 3.0})
    page = page_of(tmp_path)
    assert_harmless(page)
    # What is evil in it is there, to be read: in the title, the tables and the scenario.
    assert page.text.count(EVIL) > 10


def test_characters_that_no_page_may_have_are_replaced(tmp_path: Path) -> None:
    write_summary(tmp_path, message="a\x00b\x1b[31m\ud800", status="failed")
    text = write_report(tmp_path).read_text(encoding="utf-8")
    assert "a\ufffdb\ufffd[31m\ufffd" in text


# ---- what a run may have left ---------------------------------------------------------------------------------------
def rows(n: int = 101) -> dict[str, tuple[str, Any]]:
    return {"wt.v_dc": ("pu", np.linspace(1.0, 0.9, n)), "wt.wind": ("m/s", np.full(n, 8.0))}


def test_a_killed_run_gives_a_page(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc.part", np.linspace(0, 10, 101), rows(), {"status": "running"})
    page = page_of(tmp_path)
    assert "unfinished" in page.text
    assert "or was killed" in page.text
    assert page.count("svg") == 1  # still wind has no panel


@pytest.mark.parametrize("n", [0, 1])
def test_a_run_that_failed_at_once_gives_a_page(tmp_path: Path, n: int) -> None:
    write_result(tmp_path / "result.nc", np.zeros(n), rows(n), {"status": "failed"})
    write_summary(tmp_path, status="failed", message="error GF6301: the step became too small", steps=0)
    page = page_of(tmp_path)
    assert "The run failed. error GF6301: the step became too small" in page.text
    assert "There are no curves" in page.text


def test_an_interrupted_run_says_where(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc", np.linspace(0, 4, 41), rows(41), {"status": "interrupted"})
    write_summary(tmp_path, status="interrupted", simulated_seconds=4.0)
    assert "interrupted at 4.00 s" in page_of(tmp_path).text


def test_a_damaged_result_leaves_the_numbers(tmp_path: Path) -> None:
    (tmp_path / "result.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    write_summary(tmp_path)
    page = page_of(tmp_path)
    assert "result.nc cannot be opened" in page.text
    assert 1154.0 in page.numbers


def test_a_damaged_summary_leaves_the_curves(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc", np.linspace(0, 10, 101), rows(), {"status": "completed"})
    (tmp_path / "summary.json").write_text("{")
    page = page_of(tmp_path)
    assert page.count("svg") == 1  # still wind has no panel
    assert "completed" in page.text


def test_values_that_are_no_numbers_are_left_out(tmp_path: Path) -> None:
    values = np.linspace(1.0, 2.0, 101)
    values[50] = np.nan
    channels = {"wt.v_dc": ("pu", values), "wt.beta": ("deg", np.full(101, np.nan))}
    write_result(tmp_path / "result.nc", np.linspace(0, 10, 101), channels)
    text = write_report(tmp_path).read_text()
    Page(text)
    assert "nan" not in re.sub(r"[A-Za-z]+nan[A-Za-z]*", "", text)


def test_instances_are_a_band_with_its_mean(tmp_path: Path) -> None:
    time = np.linspace(0, 10, 101)
    values = np.outer(time, np.arange(1.0, 6.0))
    write_result(tmp_path / "result.nc", time, {"wt.v_dc": ("pu", values)})
    page = page_of(tmp_path)
    assert "mean and range of 5" in page.text
    assert any(a.get("class") == "band c1" for _, a in page.elements)
    assert "5 instances" in page.text
    assert any(number == pytest.approx(15.0) for number in page.numbers)  # mean: 5 s times 3


def test_long_runs_are_over_hours(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc", np.linspace(0, 86400, 1001), rows(1001))
    page = page_of(tmp_path)
    assert "time, h" in page.text
    assert "time, s" not in page.text


# ---- neither run nor campaign ---------------------------------------------------------------------------------------
def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for folder, reason in (
        (tmp_path, "neither"),
        (tmp_path / "missing", "does not exist"),
        (tmp_path / "file", "it is a file"),
    ):
        refused = gustform("report", folder)
        assert refused.exit_code == 2
        assert "GF7002" in refused.stderr
        assert reason in refused.stderr
        assert "gustform simulate" in refused.stderr
    assert not (tmp_path / "report.html").exists()


def test_a_page_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    write_summary(tmp_path)
    refused = gustform("report", tmp_path, "--out", tmp_path / "missing" / "page.html")
    assert refused.exit_code == 2
    assert "GF7001" in refused.stderr


def test_the_scenario_of_the_fixture_is_shown(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc", np.linspace(0, 10, 101), rows())
    page = page_of(tmp_path)
    assert SCENARIO in page.texts
    assert "control.K_p" in page.text
    assert "PmsgTurbine, aggregate 10" in page.text
    assert "1e-6" in page.text


# ---- what a run computed while it went on ---------------------------------------------------------------------------
def test_statistics_of_the_run_are_shown(tmp_path: Path) -> None:
    write_result(tmp_path / "result.nc", np.linspace(0, 10, 101), {**rows(), "wt.P": ("W", np.full(101, 1e6))})
    moments = {"unit": "W", "mean": 2.5e7, "std": 1.5e6, "min": 2e7, "max": 3e7, "min_time_s": 3.0, "max_time_s": 9.5,
               "samples": 2001, "damage_equivalent_load": {"4": 7.25e6, "10": 9.5e6}, "cycles": 12.5}  # fmt: skip
    write_summary(
        tmp_path,
        statistics={"wt.P": moments, "wt.control.gsc.xi": {"unit": "pu", "mean": None, "not_finite": 3}},
        energy={"wt": {"energy_mwh": 0.0694, "mean_power_mw": 25.0, "capacity_factor": 0.5, "reserve_least_mw": -1.5}},
        limits={"wt": {"P_max": {"seconds": 2.5, "share": 0.25, "when": "power above 0.999 pu"},
                       "omega_max": {"seconds": 0.0, "share": 0.0, "when": "speed above 1.199 pu"}}},
        grid_events=[{"at_s": 3.0, "set": {"load.active": "120 MW"}, "nadir_hz": 49.7125, "nadir_time_s": 4.5,
                      "rocof_hz_per_s": None, "settle_hz": 49.875, "settling_time_s": 5.25}],
    )  # fmt: skip
    page = page_of(tmp_path)
    assert_harmless(page)
    # Energy by the run, not 1 MW from the rows.
    assert "0.0694" in page.text
    assert "25 MW in the mean" in page.text
    for value in (2.5e7, 1.5e6, 7.25e6, 9.5e6, 2001.0, -1.5, 2.5, 0.25, 49.7125, 49.875, 5.25, 9.5):
        assert value in page.numbers
    for text in ("DEL, m = 10", "25 %", "never", "power above 0.999 pu", "3 samples were no numbers"):
        assert text in page.text


def test_a_spectrum_of_the_run_goes_before_one_of_its_rows(tmp_path: Path) -> None:
    time = np.linspace(0.0, 100.0, 2001)
    noise = np.random.default_rng(1).standard_normal(2001)
    file = write_result(tmp_path / "result.nc", time, {"wt.wind": ("m/s", 10.0 + noise)})
    of_rows = page_of(tmp_path)
    with h5py.File(file, "a") as result:
        group = result.create_group("statistics")
        group.create_dataset("channel", data=np.array(["wt.wind"], dtype=object), dtype=h5py.string_dtype())
        group["frequency"] = np.linspace(0.0, 1.0, 65)
        group["psd"] = np.full((1, 65), 12345.0)
    of_run = page_of(tmp_path)
    (drawn,) = [
        a["aria-label"] or "" for t, a in of_run.elements if t == "svg" and "frequency, Hz" in (a["aria-label"] or "")
    ]
    assert drawn.endswith("from 12345 to 12345")
    assert len(of_rows.elements) > 0
    assert "12345" not in of_rows.text

"""The page of a campaign, from a table of cases: what was varied, what failed, statistics, charts."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.stats

from gustform.language.errors import GustformError
from gustform_cli.new import SCENARIOS
from gustform_cli.report.campaign_charts import _rank_correlation
from gustform_cli.report.report import write_report
from tests.support.html_page import Page
from tests.unit.cli.test_report import EVIL, assert_harmless, gustform

Row = dict[str, Any]


def write_table(folder: Path, rows: Sequence[Row], about: Mapping[str, Any], campaign: str = "") -> Path:
    table = pa.Table.from_pylist(list(rows)).replace_schema_metadata({"gustform": json.dumps(about)})
    pq.write_table(table, folder / "scalars.parquet")
    if campaign:
        (folder / "campaign.yaml").write_text(campaign)
    return folder


def grid(winds: Sequence[float] = (6.0, 8.0, 10.0), shares: Sequence[float] = (0.0, 10.0), seeds: int = 1) -> list[Row]:
    """Nadir grows with both; the case numbers count from 1."""
    points = [(wind, share, seed) for wind in winds for share in shares for seed in range(1, seeds + 1)]
    return [
        {
            "case": k, "wind.wt.speed": wind, "wt.curtailment": share, "wind.wt.seed": seed,
            "nadir_hz": 49.0 + 0.01 * wind + 0.02 * share + 0.001 * seed, "energy": 1e6 * wind, "steps": 1000 + k,
            "simulated_seconds": 90.0, "wall_seconds": 0.1, "status": "completed", "error": None,
        }
        for k, (wind, share, seed) in enumerate(points, 1)
    ]  # fmt: skip


ABOUT = {
    "title": "Nadir over wind and curtailment", "description": "A load step.",
    "axes": ["wind.wt.speed", "wt.curtailment"],
    "units": {"wind.wt.speed": "m/s", "wt.curtailment": "%", "energy": "W"}, "versions": {"gustform": "0.1.0"},
}  # fmt: skip


def page_of(folder: Path) -> Page:
    return Page(write_report(folder).read_text(encoding="utf-8"))


def labels(page: Page) -> list[str]:
    return [attributes["aria-label"] or "" for tag, attributes in page.elements if tag == "svg"]


def test_the_page_says_what_was_varied_and_what_came_out(tmp_path: Path) -> None:
    write_table(tmp_path, grid(), ABOUT, "name: x\naxes: {}\n")
    done = gustform("report", tmp_path)
    assert done.exit_code == 0, done.output
    assert done.stdout.strip() == str(tmp_path / "report.html")
    page = page_of(tmp_path)
    assert_harmless(page)
    for text in ("Nadir over wind and curtailment", "A load step.", "all cases done", "6, 8, 10", "gustform 0.1.0"):
        assert text in page.text
    # 49 + 0.01 wind + 0.02 curtailment + 0.001: mean, lowest and highest case
    for value in (49.181, 49.061, 49.301):
        assert any(number == pytest.approx(value, abs=1e-9) for number in page.numbers)
    assert "MW" in page.text  # 6e6 to 10e6 W
    assert "name: x\naxes: {}\n" in page.texts
    # Both scalars as a map over the two axes, and as lines; effort is no result.
    assert (
        sum("over wind.wt.speed, m/s and" in label or "over wind.wt.speed and" in label for label in labels(page)) == 2
    )
    assert not any("steps" in label for label in labels(page))


def test_a_real_sweep_gives_its_page(tmp_path: Path) -> None:
    campaign = tmp_path / "campaign.yaml"
    campaign.write_text(
        f"name: Reserve\nbase: {SCENARIOS / 'load_step_8ms.yaml'}\nset: {{run.until: 32 s}}\n"
        "axes:\n  - {type: grid, values: {wt.curtailment: [5 %, 10 %], wt.control.type: [DualPort, Droop]}}\n"
    )
    out = tmp_path / "results"
    swept = gustform("sweep", campaign, "--out", out, "--workers", 1)
    assert swept.exit_code == 0, swept.output
    page = page_of(out)
    assert_harmless(page)
    table = pq.read_table(out / "scalars.parquet")
    for nadir in table["frequency.nadir_hz"].to_pylist():
        assert any(number == pytest.approx(nadir, rel=1e-8) for number in page.numbers)
    assert "all cases done" in page.text
    assert "5, 10" in page.text
    assert "DualPort, Droop" in page.text
    assert any("frequency.nadir_hz over wt.curtailment and wt.control.type" in label for label in labels(page))
    assert campaign.read_text() in page.texts


def test_failures_are_grouped_by_reason(tmp_path: Path) -> None:
    rows = grid()
    for row, error in ((rows[1], "error GF6301: at 3.25 s the step became too small"),
                       (rows[3], "error GF6301: at 71 s the step became too small"),
                       (rows[4], "error GF5001: no steady state")):  # fmt: skip
        row.update(status="failed", error=error, nadir_hz=None, energy=None, steps=None)
    write_table(tmp_path, rows, ABOUT)
    page = page_of(tmp_path)
    assert "3 of 6 cases failed" in page.text
    assert "at 3.25 s" in page.text
    assert "at 71 s" not in page.text  # the same reason at another time
    assert "GF5001" in page.text
    # Links lead to rows of the table of cases.
    ids = {attributes.get("id") for _, attributes in page.elements}
    for address in page.addresses():
        assert address.removeprefix("#") in ids
    assert {"#case-1", "#case-3", "#case-4"} <= set(page.addresses())


def test_statistics_leave_failed_cases_out(tmp_path: Path) -> None:
    rows = grid()
    rows[0].update(status="failed", error="x", nadir_hz=20.0)  # whatever it had reached
    write_table(tmp_path, rows, ABOUT)
    page = page_of(tmp_path)
    wanted = np.array([row["nadir_hz"] for row in rows[1:]])
    for value in (wanted.mean(), wanted.std(), np.median(wanted), np.percentile(wanted, 5)):
        assert any(number == pytest.approx(value, rel=1e-8) for number in page.numbers)


def test_seeds_are_repetitions(tmp_path: Path) -> None:
    axes = {**ABOUT, "axes": ["wind.wt.speed", "wind.wt.seed"]}
    write_table(tmp_path, grid(shares=(10.0,), seeds=4), axes)
    page = page_of(tmp_path)
    assert "Seeds are repetitions" in page.text
    assert all("over wind.wt.speed, 12 cases" in label for label in labels(page))
    assert any(attributes.get("class") == "trend" for _, attributes in page.elements)
    # 49.261 to 49.304; the mean over the seeds is not one of the cases
    assert sum(tag == "circle" for tag, _ in page.elements) == 2 * 12


def test_many_axes_give_rank_correlations(tmp_path: Path) -> None:
    draw = np.random.default_rng(1)
    values = draw.uniform(0.0, 1.0, (60, 4))
    rows = [
        {"case": k, "a": a, "b": b, "c": c, "d": d, "nadir_hz": a**3 + 0.01 * b, "status": "completed"}
        for k, (a, b, c, d) in enumerate(values.tolist())
    ]
    write_table(tmp_path, rows, {"axes": ["a", "b", "c", "d"]})
    (ranks, *clouds) = labels(page_of(tmp_path))
    nadir = values[:, 0] ** 3 + 0.01 * values[:, 1]
    for k, name in enumerate("abcd"):
        assert f"nadir_hz with {name} {scipy.stats.spearmanr(values[:, k], nadir).statistic:+.2f}" in ranks
    assert clouds[0].startswith("nadir_hz over a, 60 cases")


def test_rank_correlation_is_spearman_s() -> None:
    draw = np.random.default_rng(2)
    x, y = np.round(draw.uniform(0, 5, 50)), draw.uniform(0, 1, 50)  # with ties
    assert _rank_correlation(x, y) == pytest.approx(scipy.stats.spearmanr(x, y).statistic)


def test_axes_may_be_texts_or_quantities(tmp_path: Path) -> None:
    rows = [
        {"case": f"{control}-{wind}", "wt.control.type": control, "wind": f"{wind} m/s", "nadir_hz": 49.0 + n + wind,
         "status": "completed"}
        for n, control in enumerate(("Droop", "DualPort", "Matching")) for wind in (8, 10, 12.5)
    ]  # fmt: skip
    write_table(tmp_path, rows, {"axes": ["wt.control.type", "wind"]})
    page = page_of(tmp_path)
    assert "Droop, DualPort, Matching" in page.text
    assert any("nadir_hz over" in label for label in labels(page))
    assert "Matching" in page.texts  # in the map


def test_a_table_without_metadata_gives_its_statistics(tmp_path: Path) -> None:
    write_table(tmp_path, grid(), {}, "name: From YAML\n")
    page = page_of(tmp_path)
    assert "From YAML" in page.text
    assert "What was varied" not in page.text
    assert any(number == pytest.approx(49.181) for number in page.numbers)


def test_axes_of_a_list_are_one(tmp_path: Path) -> None:
    rows = [
        {"case": k, "a": 2.0 * k, "b": f"b{k}", "weight": 0.1 * k, "seed_number": 1, "nadir_hz": 49.0 + k,
         "status": "completed"}
        for k in (1, 2, 3) for _ in range(2)
    ]  # fmt: skip
    write_table(tmp_path, rows, {"axes": ["a", "b", "weight", "seed_number"]})
    page = page_of(tmp_path)
    assert labels(page) == ["nadir_hz over a, 6 cases, from 50 to 52, rank correlation 1"]
    # 50, 51, 52 with weights 1, 2, 3: 308/6
    assert any(number == pytest.approx(308.0 / 6.0) for number in page.numbers)
    assert "1 axis" in page.text


def test_what_is_inside_and_what_it_cost_is_folded_away(tmp_path: Path) -> None:
    rows = [
        {"case": k, "a": float(k), "frequency.nadir_hz": 49.0 + k, "wt.P.mean": 1e6 * k,
         "wt.control.gsc.xi.mean": 1.0 * k,
         "wt.omega_del.mean": 1.0 + k, "steps": 100.0 + k, "solve_seconds": 0.1, "simulated_seconds": 90.0,
         "status": "completed"}
        for k in range(1, 4)
    ]  # fmt: skip
    write_table(tmp_path, rows, {"axes": ["a"], "units": {"wt.P.mean": "W", "steps": "1"}})
    page = page_of(tmp_path)
    # The nadir first; a reference speed is no damage-equivalent load; neither steps nor inner channels are drawn.
    assert [label.split(" over")[0] for label in labels(page)] == [
        "frequency.nadir_hz",
        "wt.P.mean",
        "wt.omega_del.mean",
    ]
    assert "Channels inside of components, and what the computation cost" in page.text
    assert "wt.control.gsc.xi.mean" in page.text
    assert "Frequency nadir" in page.text
    assert "270 s" in page.text or "4.5 min" in page.text
    assert any(number == pytest.approx(102.0) for number in page.numbers)


def test_errors_have_their_codes_and_kept_runs_are_counted(tmp_path: Path) -> None:
    rows = grid()
    for row in rows:
        row.update(error_code=None, result=None)
    rows[2].update(status="failed", error_code="GF6301", error="the step became too small", result="runs/ab.nc")
    write_table(tmp_path, rows, {**ABOUT, "hash": "abc123", "campaign": "name: c", "base": "name: b"})
    page = page_of(tmp_path)
    assert "GF6301: the step became too small" in page.text
    assert "runs/ab.nc" not in page.text
    assert "runs kept" in page.text
    assert {"abc123", "name: c", "name: b"} <= set(page.texts)


def test_a_sweep_that_was_cut_off_before_its_table_is_told_how_to_go_on(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").write_text("")
    refused = gustform("report", tmp_path)
    assert refused.exit_code == 2
    assert "GF7002" in refused.stderr
    assert "gustform sweep again" in refused.stderr


def test_a_campaign_that_goes_on_says_how_far_it_is(tmp_path: Path) -> None:
    write_table(tmp_path, grid(), {**ABOUT, "cases": 40})
    assert "6 of 40 cases so far" in page_of(tmp_path).text


@pytest.mark.parametrize("rows", [
    [{"case": 1, "nadir_hz": 49.0, "status": "completed"}],
    [{"case": 1, "nadir_hz": None, "status": "failed", "error": "x"}] * 3,
    [{"x": "only text"}],
])  # fmt: skip
def test_a_small_or_failed_campaign_gives_a_page(tmp_path: Path, rows: list[Row]) -> None:
    write_table(tmp_path, rows, {"axes": ["a"]})
    assert_harmless(page_of(tmp_path))


def test_no_text_of_a_table_becomes_markup(tmp_path: Path) -> None:
    rows = [
        {"case": EVIL + str(k), EVIL: EVIL + str(k % 2), "a" + EVIL: float(k), "b" + EVIL: float(k * k),
         "status": EVIL if k == 3 else "completed", "error": EVIL}
        for k in range(6)
    ]  # fmt: skip
    about = {"title": EVIL, "description": EVIL, "axes": [EVIL, "a" + EVIL], "units": {"a" + EVIL: EVIL},
             "descriptions": {EVIL: EVIL}, "versions": {EVIL: EVIL}}  # fmt: skip
    write_table(tmp_path, rows, about, f"name: '{EVIL.replace(chr(39), '')}'\n")
    page = page_of(tmp_path)
    assert_harmless(page)
    assert page.text.count(EVIL) > 10


def test_a_large_campaign_gives_a_page_of_moderate_size(tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    rows = [
        {"case": k, "a": a, "b": b, "c": c, **{f"scalar_{n}": a * n + b for n in range(20)}, "status": "completed"}
        for k, (a, b, c) in enumerate(draw.uniform(0, 1, (10_000, 3)).tolist())
    ]
    write_table(tmp_path, rows, {"axes": ["a", "b", "c"]})
    page = write_report(tmp_path)
    assert page.stat().st_size < 2_000_000
    assert "all are in scalars.parquet" in page.read_text()


def test_a_table_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scalars.parquet").write_text("no table")
    with pytest.raises(GustformError, match="GF7002"):
        write_report(tmp_path)
    assert gustform("report", tmp_path).exit_code == 2

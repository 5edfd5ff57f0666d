from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from gustform_cli.sweep.plan import Case, Plan, plan
from gustform_cli.sweep.wind_axis import wind_seed
from tests.unit.cli.sweep.campaigns import write
from tests.unit.cli.sweep.test_axes import refused

NO_EVENTS = "set: {events: []}"


def planned(tmp_path: Path, wind: str) -> Plan:
    return plan(write(tmp_path, f"wind: {wind}", NO_EVENTS))


def values(case: Case) -> dict[str, Any]:
    return {change.path: change.value for change in case.changes}


def test_speeds_times_seeds_with_the_names_of_weis(tmp_path: Path) -> None:
    found = planned(
        tmp_path,
        "{wind_speed: [8 m/s, 10 m/s], n_seeds: 3, analysis_time: 600 s, transient_time: 120 s, turbulence_class: A}",
    )
    assert [(c.labels["wind_speed"], c.labels["seed_number"]) for c in found.cases] == [
        ("8 m/s", 1), ("8 m/s", 2), ("8 m/s", 3), ("10 m/s", 1), ("10 m/s", 2), ("10 m/s", 3),
    ]  # fmt: skip
    assert values(found.cases[3]) == {
        "events": [],
        "run.until": "720.0 s",
        "wind.wt.mean": "10.0 m/s",
        "wind.wt.class": "A",
        "wind.wt.seed": wind_seed(1, "wt", 10.0, 1),
    }
    assert found.campaign.transient == 120.0
    assert len({c.labels["wind.wt.seed"] for c in found.cases}) == 6


def test_speeds_from_to_in_bins(tmp_path: Path) -> None:
    found = planned(tmp_path, "{wind_speed: {from: 4 m/s, to: 13 m/s}, ws_bin_size: 3 m/s}")
    assert [c.labels["wind_speed"] for c in found.cases] == ["4 m/s", "7 m/s", "10 m/s", "13 m/s"]


def test_a_larger_campaign_keeps_its_winds(tmp_path: Path) -> None:
    small = planned(tmp_path, "{wind_speed: [8 m/s], n_seeds: 2}").cases
    large = planned(tmp_path, "{wind_speed: [6 m/s, 8 m/s], n_seeds: 3}").cases
    assert {c.key for c in small} < {c.key for c in large}
    other = planned(tmp_path, "{wind_speed: [8 m/s], n_seeds: 2, seed: 2}").cases
    assert not {c.key for c in small} & {c.key for c in other}


def test_each_turbine_has_its_own_wind() -> None:
    assert len({wind_seed(1, name, 8.0, 1) for name in ("a", "b", "wt")}) == 3


def test_constant_wind_becomes_turbulent(tmp_path: Path) -> None:
    from gustform_cli.new import SCENARIOS

    file = tmp_path / "c.yaml"
    file.write_text(f"name: a\nbase: {SCENARIOS / 'load_step_8ms.yaml'}\nwind: {{wind_speed: [9 m/s]}}\n")
    (case,) = plan(file).cases
    assert values(case)["wind.wt"] == {
        "type": "turbulence", "mean": "9.0 m/s", "seed": wind_seed(1, "wt", 9.0, 1),
    }  # fmt: skip


def test_dlc_1_2_has_six_winds_from_cut_in_to_cut_out(tmp_path: Path) -> None:
    for written in ('"1.2"', "1.2"):
        found = planned(tmp_path, f"{{DLC: {written}, cut_in: 4 m/s, cut_out: 12 m/s}}")
        assert Counter(c.labels["wind_speed"] for c in found.cases) == dict.fromkeys(
            ["4 m/s", "6 m/s", "8 m/s", "10 m/s", "12 m/s"], 6
        )


def test_dlc_1_1_has_fifteen_from_two_below_rated_on(tmp_path: Path) -> None:
    found = planned(tmp_path, '{DLC: "1.1", cut_in: 6 m/s, cut_out: 14 m/s, rated_speed: 12 m/s}')
    assert Counter(c.labels["wind_speed"] for c in found.cases) == {
        "6 m/s": 6, "8 m/s": 6, "10 m/s": 15, "12 m/s": 15, "14 m/s": 15,
    }  # fmt: skip


def test_weights_are_shares_of_the_time(tmp_path: Path) -> None:
    found = planned(tmp_path, "{wind_speed: {from: 1 m/s, to: 41 m/s}, n_seeds: 2, turbine_class: II}")
    # All speeds from 0 to 42 m/s, 2.5 times 17 m/s: 1 - exp(-pi (42 / 17)^2) = 1 - 5e-9
    assert sum(c.labels["weight"] for c in found.cases) == pytest.approx(1.0, abs=1e-8)
    below_two = 1.0 - math.exp(-math.pi * (2.0 / 17.0) ** 2)  # V_ave = 8.5 m/s
    assert found.cases[0].labels["weight"] == pytest.approx(below_two / 2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("wind", "column", "word"),
    [
        ("{n_seeds: 2}", 1, "wind_speed or a DLC"),
        ("{wind_speed: [8 m/s], turbines: [wd]}", 40, "'wd'"),
        ("{wind_speed: {from: 8 m/s, to: 6 m/s}}", 38, "at least 8 m/s"),
        ("{DLC: 1.1, cut_in: 8 m/s, cut_out: 6 m/s}", 42, "wind.cut_out"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, wind: str, column: int, word: str) -> None:
    error = refused(tmp_path, f"wind: {wind}", NO_EVENTS)
    assert error.code == "GF2604"
    assert word in str(error)
    assert error.place is not None
    assert (error.place.line, error.place.column) == (4, column)


def test_a_scenario_without_wind_takes_none(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("name: a\ncomponents: {}\nrun: {until: 1 s}\n")
    (tmp_path / "c.yaml").write_text("name: a\nbase: base.yaml\nwind: {wind_speed: [9 m/s]}\n")
    with pytest.raises(Exception, match=r"GF2604.*has no wind"):
        plan(tmp_path / "c.yaml")

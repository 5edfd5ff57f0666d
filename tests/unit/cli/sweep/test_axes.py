from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gustform.language.errors import GustformError
from gustform_cli.errors import ErrorList
from gustform_cli.quantity import split_quantity
from gustform_cli.sweep.plan import plan
from tests.unit.cli.sweep.campaigns import SHORT, write


def cases(tmp_path: Path, body: str, short: str = SHORT) -> list[dict[str, Any]]:
    return [dict(case.labels) for case in plan(write(tmp_path, body, short)).cases]


def refused(tmp_path: Path, body: str, short: str = SHORT) -> GustformError:
    with pytest.raises((GustformError, ErrorList)) as caught:
        plan(write(tmp_path, body, short))
    error = caught.value
    if isinstance(error, GustformError):
        return error
    assert isinstance(error, ErrorList)
    return error.errors[0]


def test_a_grid_is_every_combination_the_last_changing_fastest(tmp_path: Path) -> None:
    found = cases(tmp_path, "axes: [{type: grid, values: {wt.curtailment: [5 %, 10 %], wind.wt.seed: [1, 2, 3]}}]")
    assert [(c["wt.curtailment"], c["wind.wt.seed"]) for c in found] == [
        ("5 %", 1), ("5 %", 2), ("5 %", 3), ("10 %", 1), ("10 %", 2), ("10 %", 3),
    ]  # fmt: skip


def test_a_list_goes_row_by_row_in_both_forms(tmp_path: Path) -> None:
    columns = cases(
        tmp_path, "axes: [{type: list, values: {wt.control.type: [DualPort, Droop], wt.curtailment: [5 %, 10 %]}}]"
    )
    rows = cases(
        tmp_path,
        "axes: [{type: list, rows: [{wt.control.type: DualPort, wt.curtailment: 5 %}, "
        "{wt.curtailment: 10 %, wt.control.type: Droop}]}]",
    )
    assert columns == rows == [
        {"wt.control.type": "DualPort", "wt.curtailment": "5 %"},
        {"wt.control.type": "Droop", "wt.curtailment": "10 %"},
    ]  # fmt: skip


def test_axes_multiply(tmp_path: Path) -> None:
    found = cases(
        tmp_path,
        "axes:\n"
        "  - {type: list, values: {wt.curtailment: [5 %, 10 %]}}\n"
        "  - {type: grid, values: {load.active: [90 MW, 100 MW]}}\n"
        "wind: {wind_speed: [8 m/s, 9 m/s, 10 m/s], n_seeds: 2}\n",
        "set: {events: []}",
    )
    assert len(found) == 2 * 2 * 3 * 2


def test_a_latin_hypercube_has_one_point_in_each_part_of_every_range(tmp_path: Path) -> None:
    body = (
        "axes: [{type: latin_hypercube, n: 16, seed: %d, ranges: {wt.curtailment: {from: 0 %%, to: 16 %%}, "
        "wt.control.T_dc: {from: 0.1 ms, to: 10 ms, scale: log}}}]"
    )
    found = cases(tmp_path, body % 3)
    values = [split_quantity(case["wt.curtailment"]) for case in found]
    assert sorted(math.floor(value[0]) for value in values if value) == list(range(16))
    assert {value[1] for value in values if value} == {"%"}
    times = [value[0] for case in found if (value := split_quantity(case["wt.control.T_dc"]))]
    decades = np.log10(np.array(times) / 0.1) / 2.0  # two decades
    assert sorted(np.floor(16 * decades).astype(int)) == list(range(16))
    assert cases(tmp_path, body % 3) == found
    assert cases(tmp_path, body % 4) != found


def test_ends_of_a_range_may_be_in_different_units(tmp_path: Path) -> None:
    ranges = "{run.until: {from: 500 ms, to: 2 s}}"
    found = cases(tmp_path, f"axes: [{{type: latin_hypercube, n: 50, ranges: {ranges}}}]", "set: {events: []}")
    times = [value[0] for case in found if (value := split_quantity(case["run.until"]))]
    assert min(times) >= 500.0
    assert 1900.0 < max(times) <= 2000.0  # ms


@pytest.mark.parametrize(
    ("body", "code", "column", "word"),
    [
        ("axes: [{type: list, values: {a: [1], b: [1, 2]}}]", "GF2601", 33, "equally many"),
        ("axes: [{type: list}]", "GF2601", 8, "values or rows; it has none"),
        ("axes: [{type: list, values: {a: [1]}, rows: [{a: 1}]}]", "GF2601", 8, "it has both"),
        ("axes: [{type: list, rows: [{wt.curtailment: 1 %}, {wt.control.type: Droop}]}]", "GF2601", 51, "first row"),
        ("axes: [{type: grid, values: {load.active: [1 MW]}}, {type: grid, values: {load.active: [2 MW]}}]",
         "GF2602", 89, "one place"),
        ("axes: [{type: grid, values: {run.until: [1 s]}}]", "GF2602", 42, "one place"),
        ("axes: [{type: latin_hypercube, n: 2, ranges: {a: {from: 5 %, to: 3 m}}}]", "GF2603", 66, "same kind"),
        ("axes: [{type: latin_hypercube, n: 2, ranges: {a: {from: 5, to: 3}}}]", "GF2603", 64, "greater than from"),
        ("axes: [{type: latin_hypercube, n: 2, ranges: {a: {from: 0, to: 3, scale: log}}}]", "GF2603", 57, "log"),
        ("axes: [{type: latin_hypercube, n: 2, ranges: {a: {from: low, to: 3}}}]", "GF2603", 57, "'low'"),
        ("axes: [{type: grid, values: {load.active.x: [1]}}]", "GF2105", 46, "single value"),
        ("axes: [{type: grid, values: {windd.wt.mean: [1 m/s]}}]", "GF2105", 46, "windd"),
        ("axes: [{type: lst, values: {a: [1]}}]", "GF2204", 15, "'lst'"),
        ("axes: [{values: {a: [1]}}]", "GF2202", 8, "type"),
        ("axes: [{type: grid, values: {a: []}}]", "GF2003", 33, "at least 1"),
        ("axis: []", "GF2201", 1, "axes"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_place(tmp_path: Path, body: str, code: str, column: int, word: str) -> None:
    error = refused(tmp_path, body)
    assert error.code == code, error
    assert word in str(error)
    assert error.place is not None
    assert (Path(error.place.file).name, error.place.line, error.place.column) == ("campaign.yaml", 4, column)


def test_more_cases_than_anybody_runs_are_refused(tmp_path: Path) -> None:
    values = ", ".join(f"x.a{k}: [{', '.join(map(str, range(10)))}]" for k in range(4))
    body = f"axes: [{{type: list, values: {{load.active: [{', '.join(['1 MW'] * 1001)}]}}}}, "
    body += f"{{type: list, values: {{load.reactive: [{', '.join(['1 Mvar'] * 1000)}]}}}}]"
    assert values
    assert "1001000" in str(refused(tmp_path, body))


def test_a_missing_base_is_said_in_the_campaign(tmp_path: Path) -> None:
    file = tmp_path / "campaign.yaml"
    file.write_text("name: a\nbase: nowhere.yaml\n")
    with pytest.raises(GustformError) as caught:
        plan(file)
    assert caught.value.code == "GF2101"
    assert str(caught.value.place).endswith("campaign.yaml:2:7")


def test_an_error_in_the_base_keeps_its_own_place(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("name: [\n")
    file = tmp_path / "campaign.yaml"
    file.write_text("name: a\nbase: base.yaml\n")
    with pytest.raises(GustformError) as caught:
        plan(file)
    assert caught.value.code == "GF2102"
    assert "base.yaml" in str(caught.value.place)

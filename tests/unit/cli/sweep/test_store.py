from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from gustform.language.errors import GustformError, Place
from gustform_cli.sweep.case import Fault, Outcome
from gustform_cli.sweep.store import JOURNAL, Store

GOOD = Outcome(1, "completed", None, {"x.mean": 0.1 + 0.2, "trip": math.nan}, {"x.mean": "W"}, 0.5, 0.25)
BAD = Outcome(2, "failed", Fault("GF6301", "too small", "a look", Place("a.yaml", 3, 4)), {}, {}, 0.5, 0.0)


def filled(folder: Path) -> bytes:
    with Store(folder) as store:
        store.add("one", GOOD)
        store.add("two", BAD)
    return (folder / JOURNAL).read_bytes()


def test_what_was_noted_is_there_again_to_the_last_bit(tmp_path: Path) -> None:
    filled(tmp_path)
    with Store(tmp_path) as store:
        assert store.units == {"x.mean": "W"}
        assert store.records["one"].scalars["x.mean"] == 0.1 + 0.2  # 0.30000000000000004
        assert math.isnan(store.records["one"].scalars["trip"])
        assert store.records["two"].fault == BAD.fault
        assert (store.records["two"].status, store.records["two"].wall_seconds) == ("failed", 0.5)


def test_the_last_word_on_a_case_counts(tmp_path: Path) -> None:
    filled(tmp_path)
    with Store(tmp_path) as store:
        store.add("two", GOOD)
    with Store(tmp_path) as store:
        assert store.records["two"].status == "completed"


def test_a_journal_cut_off_anywhere_loses_the_torn_line_only(tmp_path: Path) -> None:
    whole = filled(tmp_path)
    ends = [k + 1 for k, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(0, len(whole), 7):
        (tmp_path / JOURNAL).write_bytes(whole[:cut])
        lines = sum(end <= cut for end in ends)
        with Store(tmp_path) as store:
            assert len(store.records) == max(0, lines - 1)  # the first line is the units
            store.add("three", GOOD)
        with Store(tmp_path) as store:
            assert "three" in store.records
        for line in (tmp_path / JOURNAL).read_text().splitlines():
            json.loads(line)


def test_two_sweeps_cannot_write_into_one_folder(tmp_path: Path) -> None:
    with Store(tmp_path), pytest.raises(GustformError) as caught:
        Store(tmp_path)
    assert caught.value.code == "GF7004"
    with Store(tmp_path):
        pass


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(GustformError) as caught:
        Store(tmp_path / "file" / "out")
    assert caught.value.code == "GF7001"

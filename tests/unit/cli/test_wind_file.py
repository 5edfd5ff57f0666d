"""Wind files: everything that can be wrong with one, and reading in blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gustform.language.errors import GustformError
from gustform_cli.wind.csv_file import CsvColumns, CsvWind, scan


def columns(path: Path, **changes: float) -> CsvColumns:
    return CsvColumns(path, "time", "speed", **changes)


def write(folder: Path, text: str) -> Path:
    file = folder / "wind.csv"
    file.write_text(text, encoding="utf-8")
    return file


def test_reads_what_was_written_in_any_pieces(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.1, 2.0, 30_000)) - 0.2
    times[0] = 0.0
    speeds = rng.uniform(3.0, 20.0, times.size)
    text = "time,other,speed\n" + "".join(
        f"{t!r},x,{v!r}\n" for t, v in zip(times.tolist(), speeds.tolist(), strict=True)
    )
    file = write(tmp_path, text)
    assert scan(columns(file), 100.0, hold=False) > 100.0
    reader = CsvWind(columns(file))
    for piece in (30_000, 1, 4096, 12_345):
        first = 0
        while first < times.size:
            got_times, got_speeds = reader(first, piece)
            assert np.array_equal(got_times, times[first : first + piece])
            assert np.array_equal(got_speeds, speeds[first : first + piece])
            first += piece if piece > 1 else 5000
    assert reader(29_999, 10)[0].size == 1
    assert reader(40_000, 10)[0].size == 0
    assert np.array_equal(reader(17, 3)[0], times[17:20]), "going back starts the file anew"


def test_units_comments_and_other_delimiters(tmp_path: Path) -> None:
    file = write(tmp_path, '# mast 3\n\n"time" ; speed\n0; 36\n# calm\n1;72\n\n')
    read = columns(file, time_factor=3600.0, speed_factor=1.0 / 3.6)
    assert scan(read, 3600.0, hold=False) == 3600.0
    times, speeds = CsvWind(read)(0, 10)
    assert times.tolist() == [0.0, 3600.0]
    assert speeds.tolist() == pytest.approx([10.0, 20.0])


@pytest.mark.parametrize(
    ("text", "code", "line", "part"),
    [
        ("", "GF2502", 0, "empty"),
        ("\n# nothing\n", "GF2502", 0, "empty"),
        ("time,speed\n", "GF2502", 0, "header only"),
        ("time,v\n0,8\n", "GF2503", 1, "'speed'"),
        ("0,8\n1,8\n", "GF2503", 1, "'time'"),
        ("time,speed\n0,8\n2,8\n1,8\n1,8\n3,8\n", "GF2504", 4, "2 do not, at lines 4, 5"),
        ("time,speed\n0,8\n0,8\n9,8\n", "GF2504", 3, "1 does not, at line 3"),
        (
            "time,speed\n0,8\n1,nan\n2,\n3,NA\n4,inf\n9,8\n",
            "GF2505",
            3,
            "4 values missing or NaN in lines 3, 4, 5, ...",
        ),
        ("time,speed\n0,8\n1\n9,8\n", "GF2505", 3, "1 value missing"),
        ("time,speed\n0,8\n1,8 m/s\n9,8\n", "GF2505", 3, "'8 m/s'"),
        ("time,speed\n0,8\n5,8\n", "GF2506", 0, "it ends at 5 s"),
        ("time,speed\n1,8\n9,8\n", "GF2506", 0, "it starts at 1 s"),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, code: str, line: int, part: str) -> None:
    file = write(tmp_path, text)
    with pytest.raises(GustformError) as caught:
        scan(columns(file), 8.0, hold=False)
    assert caught.value.code == code
    assert part in caught.value.message
    assert caught.value.place is not None
    assert (caught.value.place.file, caught.value.place.line) == (str(file), line)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="GF2501"):
        scan(columns(tmp_path / "missing.csv"), 8.0, hold=False)
    with pytest.raises(GustformError, match="GF2501"):
        scan(columns(tmp_path), 8.0, hold=False)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"time,speed\n0,8\n\xff\xfe\x00\x01")
    with pytest.raises(GustformError, match="GF2505"):
        scan(columns(binary), 8.0, hold=False)


def test_hold_allows_a_short_file(tmp_path: Path) -> None:
    assert scan(columns(write(tmp_path, "time,speed\n0,8\n5,9\n")), 8.0, hold=True) == 5.0

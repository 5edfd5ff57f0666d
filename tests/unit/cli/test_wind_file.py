"""Wind from text files: columns, units and times, everything that can be wrong, and reading in blocks from any sample
on."""

from __future__ import annotations

import gzip
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gustform.language.errors import GustformError
from gustform_cli.wind.clean import Policy
from gustform_cli.wind.csv_file import Columns, CsvFile
from gustform_cli.wind.stamps import Clock
from gustform_cli.wind.survey import Survey, TableWind, survey
from tests.unit.cli.wind_data import whole


def write(folder: Path, text: str, name: str = "wind.csv") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def look(
    file: Path, until: float = 8.0, *, columns: Columns | None = None, clock: Clock | None = None, **policy: Any
) -> Survey:
    return survey(CsvFile(file, columns or Columns(), clock or Clock()), Policy(**policy), until)


def samples(found: Survey) -> list[tuple[float, float]]:
    return list(zip(*(part.tolist() for part in TableWind(found)(0, 1000)), strict=True))


# ---- reading --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("packed", [False, True])
def test_reads_what_was_written_in_any_pieces(tmp_path: Path, packed: bool) -> None:
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.1, 2.0, 150_000)) - 0.2
    times[0] = 0.0
    speeds = rng.uniform(3.0, 20.0, times.size)
    text = "time,other,speed\n" + "".join(
        f"{t!r},x,{v!r}\n" for t, v in zip(times.tolist(), speeds.tolist(), strict=True)
    )
    file = tmp_path / ("wind.csv.gz" if packed else "wind.csv")
    file.write_bytes(gzip.compress(text.encode(), 1) if packed else text.encode())
    found = look(file, 1e9)
    assert len(found.index) > 3, "several blocks"
    assert (found.samples, found.last) == (times.size, times[-1])
    reader = TableWind(found)
    for piece in (150_000, 1, 4096, 12_345):
        first = 0
        while first < times.size:
            got_times, got_speeds = reader(first, piece)
            assert np.array_equal(got_times, times[first : first + piece])
            assert np.array_equal(got_speeds, speeds[first : first + piece])
            first += piece if piece > 1 else 30_000
    assert reader(149_999, 10)[0].size == 1
    assert reader(400_000, 10)[0].size == 0
    for first in (17, 140_000, 60_001, 60_000, 149_000):  # back and forth, by the index
        fresh = TableWind(found)
        assert np.array_equal(fresh(first, 3)[1], speeds[first : first + 3])
        assert np.array_equal(reader(first, 3)[0], times[first : first + 3])


def test_going_on_late_in_a_file_does_not_read_it_from_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write(tmp_path, "time,speed\n" + "".join(f"{t},8.{t % 10}\n" for t in range(600_000)))
    found = look(file, 1e9)
    passed: list[int] = []
    parse = CsvFile._parse

    def counting(self: CsvFile, text: bytes, line: int) -> Any:
        passed.append(len(text))
        return parse(self, text, line)

    monkeypatch.setattr(CsvFile, "_parse", counting)
    times, _ = TableWind(found)(590_000, 10)
    assert times[0] == 590_000.0
    assert sum(passed) <= 2 << 20, "two blocks of 1 MiB at most, of the 7 MB there are"


def test_units_comments_and_other_delimiters(tmp_path: Path) -> None:
    file = write(tmp_path, '# mast 3\n\n"time" ; speed\r\n0; 36\r\n# calm\r\n1;72\r\n\r\n')
    found = look(file, 3600.0, columns=Columns(speed_factor=1.0 / 3.6), clock=Clock(3600.0))
    times, speeds = TableWind(found)(0, 10)
    assert times.tolist() == [0.0, 3600.0]
    assert speeds.tolist() == pytest.approx([10.0, 20.0])


def test_columns_by_number_and_headers_of_several_lines(tmp_path: Path) -> None:
    file = write(tmp_path, "variable,wind,wind\nheight,10,80\n0,5,7\n9,6,8\n")
    assert samples(look(file, columns=Columns(1, 3, header_rows=2))) == [(0.0, 7.0), (9.0, 8.0)]
    named = Columns("variable height", "wind 80", header_rows=2)
    assert samples(look(file, columns=named)) == [(0.0, 7.0), (9.0, 8.0)]
    bare = write(tmp_path, "0,5\n9,6\n", "bare.csv")
    assert samples(look(bare, columns=Columns(1, 2, header_rows=0))) == [(0.0, 5.0), (9.0, 6.0)]


def test_numbers_that_stand_for_nothing(tmp_path: Path) -> None:
    file = write(tmp_path, "time,speed\n0,8\n1,-999\n2,9999\n3,9\n9,9\n")
    with pytest.raises(GustformError, match=r"GF2507.*2 are not, the first -999 m/s"):
        look(file)
    found = look(file, columns=Columns(missing=(-999.0, 9999.0)), gaps="interpolate")
    assert samples(found) == [(0.0, 8.0), (3.0, 9.0), (9.0, 9.0)]
    assert found.findings.missing.count == 2


# ---- times ----------------------------------------------------------------------------------------------------------
STAMPED = "time,speed\n2015-04-01 00:00,8\n2015-04-01 00:10,9\n2015-04-01 00:20,10\n"


def test_calendar_and_start(tmp_path: Path) -> None:
    file = write(tmp_path, STAMPED)
    assert samples(look(file, 600.0)) == [(0.0, 8.0), (600.0, 9.0)], "from the first stamp, as far as the run goes"
    later = look(file, 100.0, clock=Clock(start=datetime(2015, 4, 1, 0, 5)))
    assert samples(later) == [(-300.0, 8.0), (300.0, 9.0)], "the row before the start belongs to it"
    numbered = look(file, 100.0, clock=Clock(start=700.0))
    assert samples(numbered) == [(-100.0, 9.0), (500.0, 10.0)]
    with pytest.raises(GustformError, match=r"GF2506.*2015-04-01 00:20:00"):
        look(file, clock=Clock(start=datetime(2015, 5, 1)))
    with pytest.raises(GustformError, match=r"GF2506.*2015-03-01 00:00:00; its first valid row is at 2015-04-01"):
        look(file, clock=Clock(start=datetime(2015, 3, 1)))
    with pytest.raises(GustformError, match="GF2511"):
        look(file, clock=Clock(start=datetime(2015, 4, 1, tzinfo=UTC)))


def test_offsets_of_the_stamps(tmp_path: Path) -> None:
    file = write(tmp_path, "time,speed\n2014-03-30T01:50:00+01:00,8\n2014-03-30T03:00:00+02:00,9\n")
    assert samples(look(file, 600.0)) == [(0.0, 8.0), (600.0, 9.0)], "ten minutes, whatever the clocks say"
    at = look(file, 100.0, clock=Clock(start=datetime(2014, 3, 30, 1, 55)))
    assert samples(at) == [(-300.0, 8.0), (300.0, 9.0)], "a start without an offset has that of the first stamp"
    utc = look(file, 100.0, clock=Clock(start=datetime(2014, 3, 30, 0, 55, tzinfo=UTC)))
    assert samples(utc) == samples(at)
    mixed = write(tmp_path, "time,speed\n2014-03-30T01:50:00+01:00,8\n2014-03-30T03:00:00,9\n", "mixed.csv")
    with pytest.raises(GustformError, match=r"mixed.csv:3: error GF2505: the stamps .* all have an offset"):
        look(mixed)


def test_the_hour_that_a_clock_shows_twice(tmp_path: Path) -> None:
    stamps = ["01:50", *(f"02:{m:02}" for m in range(0, 60, 10)), *(f"02:{m:02}" for m in range(0, 60, 10)), "03:00"]
    rows = "".join(f"2014-10-26 {stamp},{8 + k % 3}\n" for k, stamp in enumerate(stamps))
    file = write(tmp_path, "time,speed\n" + rows)
    found = look(file, 1e4, clock=Clock(zone="Europe/Paris"))
    assert [t for t, _ in samples(found)] == [600.0 * k for k in range(14)]
    spring = write(tmp_path, "time,speed\n2014-03-30 01:50,8\n2014-03-30 03:00,9\n", "spring.csv")
    assert samples(look(spring, clock=Clock(zone="Europe/Paris")))[1] == (600.0, 9.0)
    with pytest.raises(GustformError, match="GF2504"):
        look(file, 1e4)  # without a zone the stamps go back


def test_stamps_of_another_form(tmp_path: Path) -> None:
    file = write(tmp_path, "time;speed\n01.04.2015 00:00;8\n01.04.2015 00:10;9\n")
    with pytest.raises(GustformError, match=r"wind.csv:2: error GF2505: .*'01.04.2015 00:00'.*time_format"):
        look(file)
    assert samples(look(file, 600.0, clock=Clock(form="%d.%m.%Y %H:%M"))) == [(0.0, 8.0), (600.0, 9.0)]


def test_years_of_milliseconds_are_exact(tmp_path: Path) -> None:
    file = write(tmp_path, "time,speed\n2010-01-01T00:00:00,8\n2040-01-01T00:00:00.050,9\n")
    assert samples(look(file, 1e12))[1][0] == 946684800.05  # 30 years with 7 leap days and 50 ms


# ---- gaps -----------------------------------------------------------------------------------------------------------
# Every 10 s: rows 20 and 30 without a speed, rows 60, 70 and 80 not there, the stamp 100 twice, and one that goes back.
GAPPY = "time,speed\n0,8\n10,9\n20,\n30,NaN\n40,10\n50,11\n90,12\n100,13\n100,99\n95,99\n110,14\n" + "".join(
    f"{t},14\n" for t in range(120, 400, 10)
)


def test_gaps_are_reported(tmp_path: Path) -> None:
    with pytest.raises(GustformError) as caught:
        look(write(tmp_path, GAPPY), 300.0)
    error = caught.value
    assert error.code == "GF2505"
    assert str(error.place).endswith("wind.csv:4")
    assert "2 values missing or NaN in lines 4 (20 s), 5 (30 s)" in error.message
    assert "1 stamp earlier than one before, in line 11 (95 s)" in error.message
    assert "1 duplicate stamp, in line 10 (100 s)" in error.message
    holes = GAPPY.replace("20,\n30,NaN\n", "20,9\n30,9\n").replace("100,99\n95,99\n", "")
    with pytest.raises(GustformError, match=r"wind.csv:8: error GF2510: .* 1 gap, the longest 40 s, before line 8"):
        look(write(tmp_path, holes), 300.0)
    assert look(write(tmp_path, GAPPY), 10.0).samples == 2, "what comes after the run is no concern of it"


def test_interpolate(tmp_path: Path) -> None:
    found = look(write(tmp_path, GAPPY), 110.0, gaps="interpolate", longest_gap=40.0)
    assert samples(found) == [
        (0.0, 8.0), (10.0, 9.0), (40.0, 10.0), (50.0, 11.0), (90.0, 12.0), (100.0, 13.0), (110.0, 14.0)
    ]  # fmt: skip
    text = " ".join(found.warnings)
    assert "2 gaps, the longest 40 s, before lines 6 (40 s), 8 (90 s) (2 values missing or NaN): interpolated" in text
    assert "1 duplicate stamp, in line 10 (100 s): left out" in text
    with pytest.raises(GustformError, match=r"GF2510.*longest_gap, 35 s; 1 gap is, the longest 40 s, before line 8"):
        look(write(tmp_path, GAPPY), 110.0, gaps="interpolate", longest_gap=35.0)


def test_hold(tmp_path: Path) -> None:
    found = look(write(tmp_path, GAPPY), 100.0, gaps="hold")
    assert samples(found) == [
        (0.0, 8.0), (10.0, 9.0), (20.0, 9.0), (30.0, 9.0), (40.0, 10.0), (50.0, 11.0), (80.0, 11.0), (90.0, 12.0),
        (100.0, 13.0),
    ]  # fmt: skip


def test_skip(tmp_path: Path) -> None:
    found = look(write(tmp_path, GAPPY), 60.0, gaps="skip")
    # 10 -> 40 s is closed up by 20 s, 50 -> 90 s by 30 s.
    assert samples(found) == [
        (0.0, 8.0),
        (10.0, 9.0),
        (20.0, 10.0),
        (30.0, 11.0),
        (40.0, 12.0),
        (50.0, 13.0),
        (60.0, 14.0),
    ]
    assert "50 s in all: the calendar no longer fits" in found.warnings[0]
    irregular = write(tmp_path, "time,speed\n0,8\n1,\n3,9\n10,9\n11,9\n", "irregular.csv")
    with pytest.raises(GustformError, match=r"GF2510.*equal distances.*every:"):
        look(irregular, gaps="skip")
    assert samples(look(irregular, 1.0, gaps="skip", spacing=1.0)) == [(0.0, 8.0), (1.0, 9.0)]


def test_a_file_that_is_all_gap(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="GF2502"):
        look(write(tmp_path, "time,speed\n0,\n1,\n"), gaps="hold")
    with pytest.raises(GustformError, match=r"GF2506.*first valid row is at 2 s"):
        look(write(tmp_path, "time,speed\n0,\n1,\n2,8\n9,8\n"), gaps="interpolate")


@pytest.mark.parametrize("gaps", ["hold", "interpolate", "skip"])
def test_gaps_across_the_blocks_of_a_file(tmp_path: Path, gaps: str) -> None:
    rng = np.random.default_rng(2)
    count = 300_000
    times, speeds = 2.0 * np.arange(count), rng.uniform(3.0, 20.0, count).round(3)
    empty, away = rng.random(count) < 0.3, rng.random(count) < 0.3
    empty[[0, 1, 2, -1]] = away[[0, 1, 2, -1]] = False
    empty[70_000:76_000] = True
    text = "".join(
        f"{t},{'' if e else v}\n"
        for t, v, e, a in zip(times.tolist(), speeds.tolist(), empty.tolist(), away.tolist(), strict=True)
        if not a
    )
    found = look(write(tmp_path, "time,speed\n" + text), 1e9, gaps=gaps, spacing=2.0)
    got_times: Any
    got_times, got_speeds = whole(TableWind(found))
    assert len(found.index) > 2
    valid = ~empty & ~away
    expected: tuple[Any, Any]
    if gaps == "interpolate":
        expected = times[valid], speeds[valid]
    elif gaps == "skip":
        expected = 2.0 * np.arange(valid.sum()), speeds[valid]
    else:
        # By the definition: a valid speed holds to one spacing before the next valid row.
        held = np.repeat(speeds[valid][:-1], np.diff(np.flatnonzero(valid)))
        expected = times, np.append(held, speeds[valid][-1])
        got_times, got_speeds = times, np.interp(times, got_times, got_speeds)
    assert np.array_equal(got_times, expected[0])
    assert np.array_equal(got_speeds, expected[1])


# ---- what is wrong --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "code", "line", "part"),
    [
        ("", "GF2502", 0, "empty"),
        ("\n# nothing\n", "GF2502", 0, "empty"),
        ("time,speed\n", "GF2502", 0, "header only"),
        ("time,v\n0,8\n", "GF2503", 1, "'speed'"),
        ("time,wind_speed\n0,8\n", "GF2503", 1, "'speed'"),
        ("0,8\n1,8\n", "GF2503", 1, "'time'"),
        ("time,speed,speed\n0,8,8\n", "GF2503", 1, "2 of them"),
        ("time,speed\n0,8\n2,8\n1,8\n1.5,8\n3,8\n9,8\n", "GF2504", 4, "2 stamps earlier than one before, in lines 4"),
        ("time,speed\n0,8\n0,8\n9,8\n", "GF2504", 3, "1 duplicate stamp, in line 3"),
        ("time,speed\n0,8\n1,nan\n2,\n3,NA\n4,inf\n9,8\n", "GF2505", 3, "4 values missing or NaN in lines 3 (1 s), 4"),
        ("time,speed\n0,8\n1\n9,8\n", "GF2505", 3, "1 value missing"),
        ("time,speed\n0,8\n,8\n9,8\n", "GF2505", 3, "1 value missing or NaN in line 3"),
        ("time,speed\n0,8\n1,8 m/s\n9,8\n", "GF2505", 3, "'8 m/s'"),
        ('time,speed\n0,8\n1,"8,5"\n9,8\n', "GF2505", 3, "'8,5'"),
        ("time,speed\n0,8\n1,-0.1\n9,8\n", "GF2507", 3, "-0.1 m/s"),
        ("time,speed\n0,8\n1,101\n9,8\n", "GF2507", 3, "0 ... 100 m/s"),
        ("time,speed\n1,8\n9,8\n", "GF2506", 0, "from its start, 0 s; its first valid row is at 1 s"),
        ("time,speed\n2015-13-01,8\n", "GF2505", 2, "'2015-13-01'"),
        ("time,speed\n2015-01-01,8\nsoon,8\n", "GF2505", 3, "'soon'"),
        ("time,spe\0ed\n0,8\n", "GF2508", 1, "text"),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, code: str, line: int, part: str) -> None:
    file = write(tmp_path, text)
    with pytest.raises(GustformError) as caught:
        look(file)
    assert caught.value.code == code, str(caught.value)
    assert part in caught.value.message
    assert caught.value.hint
    assert caught.value.place is not None
    assert (caught.value.place.file, caught.value.place.line) == (str(file), line)


def test_near_names_are_suggested(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="try Ws_avg"):
        look(write(tmp_path, "time,Ws_avg,P_avg\n0,8,1\n"), columns=Columns("time", "ws_avg"))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="GF2501"):
        look(tmp_path / "missing.csv")
    with pytest.raises(GustformError, match="GF2501"):
        look(tmp_path)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"time,speed\n0,8\n\xff\xfe\x00\x01")
    with pytest.raises(GustformError, match=r"binary.csv:3: error GF2505"):
        look(binary)
    packed = gzip.compress(("time,speed\n" + "".join(f"{t},{8 + t % 7}\n" for t in range(100_000))).encode())
    broken = tmp_path / "broken.csv.gz"
    broken.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(GustformError, match=r"GF2508.*whole .gz"):
        look(broken, 1e9)
    broken.write_bytes(b"time,speed\n0,8\n")
    with pytest.raises(GustformError, match="GF2508"):
        look(broken)
    endless = tmp_path / "endless.csv"
    endless.write_bytes(b"time,speed\n" + b"8" * (17 << 20))
    with pytest.raises(GustformError, match=r"GF2508.*16 MiB"):
        look(endless)


def test_mean_and_deviation_over_time(tmp_path: Path) -> None:
    # A line from 0 to 4 m/s... over 2 s, then 6 s at 8: by hand (2 * 6 + 6 * 8) / 8 = 7.5, second moment
    # (2 * (16 + 32 + 64) / 3 + 6 * 64) / 8 = 57.3333.
    found = look(write(tmp_path, "time,speed\n0,4\n2,8\n8,8\n"))
    assert found.mean == pytest.approx(7.5, rel=1e-14)
    assert found.deviation == pytest.approx((57.0 + 1.0 / 3.0 - 7.5**2) ** 0.5, rel=1e-12)


def test_calm_is_raised(tmp_path: Path) -> None:
    found = look(write(tmp_path, "time,speed\n0,8\n4,0\n8,8\n"))
    assert samples(found)[1] == (4.0, 0.5)
    assert found.warnings == ("1 speed below 0.5 m/s: raised to it",)

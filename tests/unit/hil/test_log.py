"""Logs by python-can's own writers, and what reads them back."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from gustform.language.errors import GustformError
from gustform_hil.log import Log, read_log

T0 = 1_790_000_000.0


def message(k: int, *, fd: bool, received: bool) -> can.Message:
    return can.Message(
        arbitration_id=0x100 if fd else 0x10,
        data=bytes((k + j) % 256 for j in range(48 if fd else 8)),
        is_fd=fd,
        bitrate_switch=fd,
        is_extended_id=False,
        is_rx=received,
        timestamp=T0 + k * 1e-3,
        channel="vcan0",
    )


MESSAGES = [message(k, fd=k % 2 == 0, received=k % 3 == 0) for k in range(40)]


@pytest.mark.parametrize("name", ["bus.log", "bus.mf4"])
def test_what_is_written_is_read_back(tmp_path: Path, name: str) -> None:
    with Log(tmp_path / name) as log:
        for one in MESSAGES:
            log(one)
    found = list(read_log(tmp_path / name))
    assert len(found) == log.frames == len(MESSAGES)
    for given, back in zip(MESSAGES, found, strict=True):
        assert (back.arbitration_id, bytes(back.data), back.is_fd) == (
            given.arbitration_id,
            bytes(given.data),
            given.is_fd,
        )
        # candump writes microseconds; MF4 keeps seconds from the start of the file in a double.
        assert back.timestamp == pytest.approx(given.timestamp, abs=1e-6)
        assert back.is_rx == given.is_rx


def test_a_text_log_is_what_candump_writes(tmp_path: Path) -> None:
    with Log(tmp_path / "bus.log") as log:
        log(message(0, fd=False, received=True))
    assert (tmp_path / "bus.log").read_text().startswith("(1790000000.000000) vcan0 010#0001020304050607")


def test_a_log_of_candump_is_read(tmp_path: Path) -> None:
    file = tmp_path / "candump.log"
    file.write_text("(1700000000.000001) can0 100##1" + "00" * 48 + "\n(1700000000.000100) can0 080#00112233\n")
    assert [(m.arbitration_id, len(m.data), m.is_fd) for m in read_log(file)] == [(0x100, 48, True), (0x80, 4, False)]


@pytest.mark.parametrize("name", ["bus.txt", "bus", "bus.LOG.gz"])
def test_another_ending_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(GustformError, match="GF8074"):
        Log(tmp_path / name)
    with pytest.raises(GustformError, match="GF8075"):
        list(read_log(tmp_path / name))


def test_a_file_that_cannot_be_written_or_read(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="GF8074"):
        Log(tmp_path / "no_such_folder" / "bus.log")
    with pytest.raises(GustformError, match="GF8075"):
        list(read_log(tmp_path / "missing.log"))
    for name, content in (("a.log", b"(now) vcan0\n"), ("a.mf4", b"MDF?")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(GustformError, match="GF8075"):
            list(read_log(tmp_path / name))

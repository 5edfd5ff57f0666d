"""The commands of the bench where there is no bus: what is refused, in which words, before anything is written."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gustform.language.errors import GustformError
from gustform_cli.hil.plant import message_set, sampled
from gustform_cli.hil.rigs import SCENARIO
from gustform_cli.main import app
from gustform_hil.database import shipped, shipped_files
from gustform_hil.plant import split
from gustform_hil.process import Bridge
from gustform_hil.rig_files import read_rig

DATABASE, MAPPING = shipped_files("fd")


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["plant", str(SCENARIO), "--interface", "nocan9"], "GF8071"),
        (["plant", str(SCENARIO), "--interface", "lo", "--bus", "classic"], "GF8071"),
        (["plant", str(SCENARIO), "--dbc", str(DATABASE)], "GF8083"),
        (["compare", "bus.txt", "{result}"], "GF7002"),
        (["faults", "--rig", "{folder}"], "GF8085"),
        (["soak", "--rig", "{folder}"], "GF8085"),
    ],
)
def test_what_is_wrong_is_told_with_the_exit_code_2(tmp_path: Path, words: list[str], code: str) -> None:
    given = [word.format(folder=tmp_path, result=tmp_path / "result.nc") for word in words]
    if words[0] == "plant":
        given += ["--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, ["hil", *given])
    assert done.exit_code == 2
    assert code in done.stderr
    assert not (tmp_path / "out").exists()


def test_frames_of_a_soak_have_a_least_number() -> None:
    assert CliRunner().invoke(app, ["hil", "soak", "--frames", "0"]).exit_code == 2


def test_a_database_of_ones_own() -> None:
    assert message_set("fd", DATABASE, MAPPING).fingerprint == shipped("fd").fingerprint
    with pytest.raises(GustformError, match="GF8083"):
        message_set("fd", None, MAPPING)


def test_a_control_that_is_not_sampled_becomes_so() -> None:
    """The period of the database, one sample late."""
    assert sampled(SCENARIO, [], shipped("fd"), None) == ("wt", ["wt.control.sampled=0.001s", "wt.control.delay=1"])
    assert sampled(SCENARIO, [], shipped("classic"), "wt")[1][0] == "wt.control.sampled=0.002s"
    kept = ["wt.control.sampled=1ms"]
    assert sampled(SCENARIO, kept, shipped("fd"), None) == ("wt", kept)
    with pytest.raises(GustformError, match=r"GF8084.*0\.001 s"):
        sampled(SCENARIO, ["wt.control.sampled=5ms"], shipped("fd"), None)


def test_what_a_controller_reads_comes_as_measurements_or_as_set_points() -> None:
    measured, points = split(shipped("fd"), ["v_dc", "omega_del", "omega_r"], ["omega_gsc"])
    assert measured == ["v_dc", "omega_r"]
    assert points == ["omega_del"]
    with pytest.raises(GustformError, match=r"GF8082.*torque, phase"):
        split(shipped("fd"), ["v_dc", "torque"], ["omega_gsc", "phase"])


def test_a_rig_that_is_none(tmp_path: Path) -> None:
    for text in ("", "[]", '{"prefix": "../x"}', '{"prefix": "dual_port"}', "[" * 10_000):
        (tmp_path / "rig.json").write_text(text)
        with pytest.raises(GustformError, match="GF8085"):
            read_rig(tmp_path)


def test_a_program_that_ends_at_once_is_told_of_with_its_words(tmp_path: Path) -> None:
    program = tmp_path / "gust-bridge"
    program.write_text("#!/bin/sh\necho 'GF8060: no such interface' >&2\nsleep 0.2\nexit 1\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    with pytest.raises(GustformError, match=r"GF8076.*exit code 1.*GF8060"):
        _run_until_it_ends(program)
    with pytest.raises(GustformError, match="GF8076"):
        Bridge(tmp_path / "missing", "vcan0")


def test_events_and_the_end_of_a_program(tmp_path: Path) -> None:
    program = tmp_path / "gust-bridge"
    lines = [json.dumps({"event": name}) for name in ("start", "end")]
    program.write_text(
        "#!/usr/bin/env python3\n"
        "import signal, sys, time\n"
        f"signal.signal(signal.SIGTERM, lambda *_: (print({lines[1]!r}, flush=True), sys.exit(0)))\n"
        f"print({lines[0]!r}, flush=True)\n"
        "time.sleep(60)\n"
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    with Bridge(program, "vcan7") as bridge:
        assert bridge.events == [{"event": "start"}]
        assert bridge.stop() == 0
    assert bridge.events[-1] == {"event": "end"}


def _run_until_it_ends(program: Path) -> None:
    with Bridge(program, "vcan7") as bridge:
        while True:
            bridge.check()

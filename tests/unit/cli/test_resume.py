"""A run that was killed, or whose disk was full, goes on and ends with the same bits as one that was left alone."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from gustform.language.errors import GustformError
from gustform_cli.checkpoint import decode, interval
from gustform_cli.new import SCENARIOS

TURBULENT = SCENARIOS / "turbulent_10min.yaml"
# Three hours in some seconds; blocks of 1080 rows that no checkpoint coincides with; two events; all kinds of
# statistics, some of channels that are not stored.
CHANGES = [
    "run.until=3 h", "run.checkpoint=3 min", "output.every=500 ms", "output.channels=[wt.wind, wt.omega_r, wt.P]",
    "output.statistics={every: 100 ms, channels: [wt.P, wt.v_dc, sg.frequency], of: [histogram, psd, rainflow]}",
    "events=[{at: 1000 s, set: {load.active: 120 MW}}, {at: 5400 s, set: {load.active: 100 MW}}]",
]  # fmt: skip
OF_TIME = {"wall_seconds", "real_time_factor", "build_seconds", "compiled_types"}


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "gustform_cli", "simulate", "--no-figure", *map(str, arguments)]


def start(out: Path, *changes: str) -> list[str]:
    return command(TURBULENT, "--out", out, *(word for change in [*CHANGES, *changes] for word in ("--set", change)))


def run(words: list[str], **more: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, timeout=300, env=environment(), check=False, **more)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    """The run without a break, and how long it took, s."""
    out = tmp_path_factory.mktemp("whole")
    begin = time.monotonic()
    process = run(start(out))
    assert process.returncode == 0, process.stderr
    assert {path.name for path in out.iterdir()} == {"result.nc", "summary.json"}, "nothing is left of checkpoints"
    return out, time.monotonic() - begin


def assert_same(out: Path, whole: Path) -> None:
    for group in (None, "statistics"):
        with (
            xarray.open_dataset(out / "result.nc", group=group) as mine,
            xarray.open_dataset(whole / "result.nc", group=group) as theirs,
        ):
            assert set(mine.variables) == set(theirs.variables)
            for name in theirs.variables:
                a, b = mine[name].values, theirs[name].values
                if a.dtype.kind == "f":  # bits, not values: a NaN is one too
                    a, b = a.view(np.uint8), b.view(np.uint8)
                assert a.dtype == b.dtype
                assert np.array_equal(a, b), (group, name)
            if group is None:
                assert mine.sizes["time"] == 21601
                assert mine.attrs["status"] == "completed"
    mine_, theirs_ = (json.loads((folder / "summary.json").read_text()) for folder in (out, whole))
    assert {k: v for k, v in mine_.items() if k not in OF_TIME} == {
        k: v for k, v in theirs_.items() if k not in OF_TIME
    }
    assert {path.name for path in out.iterdir()} == {"result.nc", "summary.json"}


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_killed_at_random_moments(tmp_path: Path, whole: tuple[Path, float], seed: int) -> None:
    """Killed three times, while starting, computing, writing or copying, and resumed after each."""
    chance = random.Random(seed)
    words, killed = start(tmp_path), 0
    for _ in range(40):
        process = subprocess.Popen(
            words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment()
        )
        # The third time it may run to the end.
        wait = chance.uniform(0.1, 1.0) * whole[1] if killed < 3 else 300.0
        try:
            _, said = process.communicate(timeout=wait)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            killed += 1
        else:
            assert process.returncode == 0, said
            break
        if list(tmp_path.glob("*.checkpoint")):
            words = command("--resume", tmp_path)
    else:
        pytest.fail("forty starts, and none of them came to the end")
    assert_same(tmp_path, whole[0])


def test_killed_after_the_last_row(tmp_path: Path) -> None:
    """The result was whole; summary and figure were not. A complete run may be resumed as often as one likes."""
    scenario, out = SCENARIOS / "load_step_8ms.yaml", tmp_path / "out"
    process = run(command(scenario, "--out", out, "--set", "run.checkpoint=20 s"))
    assert process.returncode == 0, process.stderr
    whole = {path.name: path.read_bytes() for path in out.iterdir()}
    assert set(whole) == {"result.nc", "summary.json"}
    for left in (b"", whole["summary.json"][:100], None):
        summary = out / "summary.json"
        summary.unlink()
        if left is not None:
            summary.write_bytes(left)
        process = run(command("--resume", out))
        assert process.returncode == 0, process.stderr
        assert "the run is complete, up to 90 s" in process.stderr
        assert {path.name: path.read_bytes() for path in out.iterdir()} == whole
    drawn = run([word for word in command("--resume", out) if word != "--no-figure"])
    assert drawn.returncode == 0, drawn.stderr
    assert (out / "figure.png").read_bytes().startswith(b"\x89PNG")
    # Another run has begun in the same folder: that one is not complete, and had no checkpoint.
    (out / "result.nc.part").write_bytes(b"")
    process = run(command("--resume", out))
    assert process.returncode == 2
    assert "GF7006" in process.stderr


def stop(out: Path, sent: signal.Signals, moment: Callable[[], bool], *changes: str) -> tuple[int, str]:
    """Starts a run and sends it a signal at some moment of it; how it ended. Again, if it came to its end before."""
    for _ in range(5):
        process = subprocess.Popen(
            start(out, *changes), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment()
        )
        deadline = time.monotonic() + 120.0
        while process.poll() is None and not moment():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        process.send_signal(sent)
        _, said = process.communicate(timeout=60)
        if process.returncode != 0:
            return process.returncode, said
    pytest.fail("five runs, and all of them were over before anybody looked")


def kill_in_the_middle(out: Path, *changes: str) -> None:
    """Leaves a run that was killed after its first hour."""
    file = out / "result.nc.checkpoint"

    def an_hour() -> bool:
        try:
            return decode(file.read_bytes(), file).time > 3600.0
        except (OSError, GustformError):
            return False

    stop(out, signal.SIGKILL, an_hour, *changes)
    assert an_hour()


def test_the_directory_of_a_torn_file_is_not_needed(tmp_path: Path, whole: tuple[Path, float]) -> None:
    """HDF5's own structures may be half written when a process dies; the worst is a file without its beginning."""
    kill_in_the_middle(tmp_path)
    part = tmp_path / "result.nc.part"
    with part.open("r+b") as file:
        file.write(bytes(512))  # superblock and root group
    process = run(command("--resume", tmp_path))
    assert process.returncode == 0, process.stderr
    assert "resuming at" in process.stderr
    assert_same(tmp_path, whole[0])


def test_ctrl_c_can_be_taken_back(tmp_path: Path, whole: tuple[Path, float]) -> None:
    part = tmp_path / "result.nc.part"
    code, said = stop(tmp_path, signal.SIGINT, lambda: part.exists() and part.stat().st_size > 60_000)
    assert code == 130, said
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert data.attrs["status"] == "interrupted"
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert {"result.nc", "result.nc.checkpoint", "result.nc.chunks.0", "summary.json"} == set(before)
    # A disk that is full when the rows are copied: nothing of what there is may be lost.
    full = run(
        command("--resume", tmp_path),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300 << 10, 300 << 10)),
    )
    assert full.returncode == 2, full.stderr
    assert "GF7001" in full.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    process_2 = run(command("--resume", tmp_path))
    assert process_2.returncode == 0, process_2.stderr
    assert_same(tmp_path, whole[0])


@pytest.mark.parametrize("kilobytes", [450, 650])
def test_a_full_disk(tmp_path: Path, whole: tuple[Path, float], kilobytes: int) -> None:
    """No file may grow beyond a limit: the result hits it, and can be read. With room again the run goes on."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes << 10, kilobytes << 10))

    process = run(start(tmp_path), preexec_fn=limit)
    assert process.returncode == 1, process.stderr
    assert "GF7001" in process.stderr
    assert "Traceback" not in process.stderr
    with xarray.open_dataset(tmp_path / "result.nc") as data:
        assert data.attrs["status"] == "failed"
        assert 3000 < data.sizes["time"] < 20_000
        assert data["time"].values[-1] == 0.5 * (data.sizes["time"] - 1)
    process = run(command("--resume", tmp_path))
    assert process.returncode == 0, process.stderr
    assert_same(tmp_path, whole[0])


def test_what_has_changed_is_told(tmp_path: Path) -> None:
    kill_in_the_middle(tmp_path)
    file = tmp_path / "result.nc.checkpoint"
    data = file.read_bytes()
    # Another version, with a sound checksum.
    import dataclasses

    found = decode(data, file)
    file.write_bytes(dataclasses.replace(found, versions={**found.versions, "sundials": "0.1"}).encode())
    process = run(command("--resume", tmp_path))
    assert process.returncode == 2
    assert "GF7007" in process.stderr
    assert "version of sundials must be the same; it was 0.1" in process.stderr
    # Another model: a parameter of it in the scenario.
    changed = found.scenario.replace("droop: 5 %", "droop: 4 %")
    assert changed != found.scenario
    file.write_bytes(dataclasses.replace(found, scenario=changed).encode())
    process = run(command("--resume", tmp_path))
    assert process.returncode != 0
    assert "GF7007" in process.stderr
    # Bytes that were lost.
    for broken in (data[:-1], data[: len(data) // 2], b"", data[:100] + b"\x00" + data[101:]):
        file.write_bytes(broken)
        process = run(command("--resume", tmp_path))
        assert process.returncode == 2
        assert "GF7008" in process.stderr
    # The rows.
    file.write_bytes(data)
    (tmp_path / "result.nc.part").unlink()
    process = run(command("--resume", tmp_path))
    assert process.returncode != 0
    assert "GF7008" in process.stderr
    file.unlink()
    process = run(command("--resume", tmp_path))
    assert process.returncode == 2
    assert "GF7006" in process.stderr


def test_a_wind_file_that_changed_is_told(tmp_path: Path) -> None:
    (tmp_path / "wind.csv").write_text("time,speed\n" + "".join(f"{600 * k},{8 + 0.5 * (k % 3)}\n" for k in range(40)))
    scenario = tmp_path / "s.yaml"
    scenario.write_text(
        (SCENARIOS / "load_step_8ms.yaml").read_text()
        .replace("wt: {type: constant, speed: 8 m/s}", "wt: {type: file, path: wind.csv}")
        .replace("aggregate: 10", "aggregate: 10\n    wind_speed: 8 m/s")
    )  # fmt: skip
    out = tmp_path / "out"
    process = run(
        command(scenario, "--out", out, "--set", "run.until=4 h", "--set", "output.every=1 s", "--set",
                "run.checkpoint=1 min"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (3000 << 10, 3000 << 10)),
    )  # fmt: skip
    assert "GF7001" in process.stderr
    text = (tmp_path / "wind.csv").read_text()
    (tmp_path / "wind.csv").write_text(text.replace("8.5", "8.6"))
    process = run(command("--resume", out))
    assert process.returncode == 2
    assert "GF7007" in process.stderr
    assert "wind file of wt" in process.stderr
    (tmp_path / "wind.csv").write_text(text)
    process = run(command("--resume", out), cwd=out)  # from another folder
    assert process.returncode == 0, process.stderr


def test_usage(tmp_path: Path) -> None:
    for words in (command(), command(TURBULENT, "--resume", tmp_path), command("--resume", tmp_path, "--set", "a=1")):
        process = run(words)
        assert process.returncode == 2
        assert "--resume" in process.stderr


def test_how_often() -> None:
    assert interval(90.0, None) == float("inf")
    assert interval(3600.0, None) == 600.0
    assert interval(86400.0, None) == 1728.0
    assert interval(86400.0, 600.0) == 600.0


_DIES = """
import os, sys
import gustform_cli.checkpoint as files
import gustform_cli.run
import gustform_cli.simulate
from gustform_cli.result import ResultWriter
from gustform_cli.main import main
def die(*a, **k): os._exit(9)
where = sys.argv.pop(1)
if where == "adopt":
    ResultWriter.sync = die
elif where == "places":
    files.write = die
elif where == "rename":
    ResultWriter.rename = die
elif where == "names":
    files.keep_names = die
elif where == "discard":
    gustform_cli.run.discard = die
elif where == "summary":
    gustform_cli.simulate.write_summary = die
sys.argv[0] = "gustform"
main()
"""


@pytest.mark.parametrize("where", ["adopt", "places", "rename", "names", "discard", "summary"])
def test_dying_in_between(tmp_path: Path, whole: tuple[Path, float], where: str) -> None:
    """Between any two of the steps in which a resumed run makes the old rows its own, and of those that end it."""
    kill_in_the_middle(tmp_path)
    words = command("--resume", tmp_path)
    process = run([sys.executable, "-c", _DIES, where, *words[3:]])
    assert process.returncode == 9, process.stderr
    process = run(words)
    assert process.returncode == 0, process.stderr
    assert_same(tmp_path, whole[0])

"""Campaigns for the tests: short runs of the shipped turbulent scenario."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from typer.testing import CliRunner, Result

from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.sweep.store import JOURNAL
from tests.support.waiting import wait_for

BASE = SCENARIOS / "turbulent_10min.yaml"
# 5 s, with few rows and channels: what a run costs besides is the same.
SHORT = (
    'set: {run.until: 5 s, events: [], output.every: 100 ms, output.channels: ["sg.frequency", "wt.P", "wt.wind"], '
    "wt.wind_speed: 10 m/s}"
)
CURTAILMENTS = "axes:\n  - type: grid\n    values:\n      wt.curtailment: [5 %, 10 %]\n"


def write(folder: Path, body: str = CURTAILMENTS, short: str = SHORT, name: str = "campaign.yaml") -> Path:
    """A campaign file over the shipped scenario."""
    file = folder / name
    file.write_text(f"name: A test\nbase: {BASE}\n{short}\n{body}", encoding="utf-8")
    return file


def arguments(file: Path, out: Path, *more: object) -> list[str]:
    return [str(argument) for argument in ("sweep", file, "--out", out, *more)]


def sweep(file: Path, out: Path, *more: object) -> Result:
    """In this process, with one worker process unless said otherwise."""
    workers = () if "--workers" in more else ("--workers", 1)
    return CliRunner().invoke(app, arguments(file, out, *workers, *more))


def start(file: Path, out: Path, *more: object) -> subprocess.Popen[str]:
    """In a process of its own, for signals."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "gustform_cli", *arguments(file, out, *more)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def wait_for_cases(process: subprocess.Popen[str], out: Path, more_than: int, seconds: float = 60.0) -> None:
    """Until more cases than that have ended; the sweep has not come to its end before."""

    def have_ended() -> bool:
        if (out / JOURNAL).is_file() and (out / JOURNAL).read_bytes().count(b"\n") > more_than:
            return True
        assert process.poll() is None, process.communicate()
        return False

    wait_for(have_ended, seconds)


def rows(out: Path) -> list[dict[str, Any]]:
    """The table of a sweep."""
    found: list[dict[str, Any]] = pq.read_table(out / "scalars.parquet").to_pylist()
    return found


def about(out: Path) -> dict[str, Any]:
    """The provenance in the table's metadata."""
    found: dict[str, Any] = json.loads(pq.read_schema(out / "scalars.parquet").metadata[b"gustform"])
    return found


def numbers(out: Path) -> dict[str, bytes]:
    """The bytes of every column that a run's numbers stand in: all but times of this machine."""
    table = pq.read_table(out / "scalars.parquet")
    timing = ("wall_seconds", "solve_seconds")
    return {
        name: table.column(name).to_numpy(zero_copy_only=False).tobytes()
        for name in table.column_names
        if name not in timing and str(table.schema.field(name).type) in ("double", "int32", "int64")
    }

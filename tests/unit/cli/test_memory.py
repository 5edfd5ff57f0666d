"""Memory does not grow with simulated time: a day of the turbulent scenario against its ten minutes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import gustform_cli

_SCENARIO = Path(gustform_cli.__file__).parent / "scenarios" / "turbulent_10min.yaml"

# Peak resident memory in kB of the command as a process, figure included.
_MEASURE = """
import resource, subprocess, sys
run = subprocess.run([sys.executable, "-m", "gustform_cli", *sys.argv[1:]], stdout=subprocess.DEVNULL)
assert run.returncode == 0, run.returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def _peak(until: str, out: Path) -> int:
    command = [
        sys.executable,
        "-c",
        _MEASURE,
        "simulate",
        str(_SCENARIO),
        "--set",
        f"run.until={until}",
        "--out",
        str(out),
    ]
    # The package as these tests see it, installed or not.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return int(run.stdout)


def test_a_day_needs_no_more_memory_than_ten_minutes(tmp_path: Path) -> None:
    ten_minutes, day = _peak("600 s", tmp_path / "short"), _peak("86400 s", tmp_path / "long")
    # The bound. Ten minutes take about 145 MB, most of it CasADi and matplotlib.
    assert day <= 1.10 * ten_minutes, f"{day / 1024:.0f} MB against {ten_minutes / 1024:.0f} MB"

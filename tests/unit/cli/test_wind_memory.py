"""Files of hundreds of megabytes take no more memory than small ones, to be gone through and to be read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.unit.cli.test_wind_formats import field, turbsim

# Peak resident memory in kB after the pass and after reading samples all through the file, and how many there are.
_MEASURE = """
import sys
from pathlib import Path
from gustform_cli.wind.blocks import FileWind
from gustform_cli.wind.files import file_source
from gustform_cli.wind.source import Site
from gustform.language.errors import Place
block = FileWind.model_validate({"type": "file", "path": sys.argv[1], "is": sys.argv[2], "reduce": sys.argv[3]}
                                if sys.argv[3] else {"type": "file", "path": sys.argv[1], "is": sys.argv[2]})
site = Site("wt", ["wt"], Path(), float(sys.argv[4]), 9.0, lambda: 63.0, lambda *keys: Place("s.yaml"))
reader, first = file_source(block, site).reader, 0
while (got := reader(first, 4096)[0].size) > 0:
    first += got
# Of this program alone: ru_maxrss would begin with what the process that started it had.
status = Path("/proc/self/status").read_text()
print(status.split("VmHWM:")[1].split()[0], first)
"""


def peak(file: Path, rows: int, *, how: str = "point", reduce: str = "", dt: float = 1.0) -> int:
    command = [sys.executable, "-c", _MEASURE, str(file), how, reduce, str((rows - 1.5) * dt)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert run.returncode == 0, run.stderr
    memory, samples = map(int, run.stdout.split())
    assert samples == rows
    return memory


def csv(file: Path, rows: int) -> Path:
    """Rows of 32 bytes, without formatting each."""
    digits = np.char.zfill(np.arange(rows).astype("S8"), 8)
    speeds = np.array([b"7.250", b"8.500", b"9.125", b"8.000"])[np.arange(rows) % 4]
    line = np.empty(rows, dtype="S32")
    line[:] = b"00000000,8.000,abcdefghijklmnop\n"
    view = line.view("S1").reshape(rows, 32)
    view[:, :8] = digits.view("S1").reshape(rows, 8)
    view[:, 9:14] = speeds.view("S1").reshape(rows, 5)
    with file.open("wb") as stream:
        stream.write(b"time,speed,note\n")
        line.tofile(stream)
    return file


def parquet(file: Path, rows: int) -> Path:
    with pq.ParquetWriter(
        file, pa.schema([("time", pa.float64()), ("speed", pa.float64())]), compression="NONE"
    ) as out:
        for first in range(0, rows, 2_000_000):
            times = np.arange(first, min(first + 2_000_000, rows), dtype=np.float64)
            speeds = 9.0 + np.sin(times)
            out.write_table(pa.table({"time": times, "speed": speeds}), row_group_size=2_000_000)
    return file


MIB = 1024  # kB


@pytest.mark.timeout(600)
def test_csv(tmp_path: Path) -> None:
    small, large = 20_000, 6_000_000  # 0.6 MB and 192 MB
    low = peak(csv(tmp_path / "small.csv", small), small)
    high = peak(csv(tmp_path / "large.csv", large), large)
    assert high - low < 30 * MIB, f"{high / MIB:.0f} MB against {low / MIB:.0f} MB"


@pytest.mark.timeout(600)
def test_parquet(tmp_path: Path) -> None:
    small, large = 20_000, 12_000_000  # 0.3 MB and 190 MB, row groups of 32 MB
    low = peak(parquet(tmp_path / "small.parquet", small), small, how="rotor_effective")
    high = peak(parquet(tmp_path / "large.parquet", large), large, how="rotor_effective")
    assert high - low < 40 * MIB, f"{high / MIB:.0f} MB against {low / MIB:.0f} MB"


def test_boxes(tmp_path: Path) -> None:
    small, large = tmp_path / "small.bts", tmp_path / "large.bts"
    turbsim(small, field(), kind=7)
    turbsim(large, field(), kind=7)
    planes, width = 4_000_000, 2 * 3 * (5 * 4 + 2)  # 500 MB, a sparse file of zeros: (0 + 10000) / 1000 = 10 m/s
    head = bytearray(large.read_bytes())
    head[14:18] = planes.to_bytes(4, "little")
    large.write_bytes(head)
    os.truncate(large, 70 + 9 + planes * width)
    low = peak(small, 40, reduce="hub", dt=0.1)
    high = peak(large, planes, reduce="hub", dt=0.1)
    assert high - low < 30 * MIB, f"{high / MIB:.0f} MB against {low / MIB:.0f} MB"

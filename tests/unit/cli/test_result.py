"""The result file: opens in xarray with units and sentences, is whole after every block, touches nothing it may not."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray

from gustform.language.errors import GustformError
from gustform_cli.journalled_file import complete
from gustform_cli.result import PARTIAL, RESULT, Quantity, ResultWriter, prepare_folder

QUANTITIES = [
    Quantity("sg.frequency", "Hz", "grid frequency"),
    *[Quantity(f"wt[{n}].omega", "pu", "rotor speed") for n in (1, 2, 3)],
    Quantity("wt[2].beta", "deg", "pitch angle"),
]


def rows(first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(first, first + count) * 0.02
    return times, np.stack([times + column for column in range(len(QUANTITIES))], axis=1).astype(np.float32)


def test_opens_in_xarray(tmp_path: Path) -> None:
    writer = ResultWriter(tmp_path, QUANTITIES, {"wt": 3}, 10_000, 1000, {"title": "case", "scenario": "x" * 200_000})
    for first in range(0, 5000, 1000):
        writer.append(*rows(first, 1000))
    assert (tmp_path / PARTIAL).exists()
    assert not (tmp_path / RESULT).exists()
    assert writer.finish("completed", {"steps": 7}) == tmp_path / RESULT
    assert not (tmp_path / PARTIAL).exists()
    with xarray.open_dataset(tmp_path / RESULT) as data:
        assert dict(data.sizes) == {"time": 5000, "wt": 3}
        assert data["time"].attrs["units"] == "s"
        assert data["sg.frequency"].dtype == np.float32
        assert data["sg.frequency"].attrs == {"units": "Hz", "long_name": "grid frequency"}
        assert data["wt.omega"].sel(wt=2).values == pytest.approx(np.arange(5000) * 0.02 + 2.0, abs=1e-4)
        assert "wt[2].beta" in data, "a channel of one instance keeps its own name"
        assert data.attrs["status"] == "completed"
        assert json.loads(data.attrs["statistics"]) == {"steps": 7}
        assert len(data.attrs["scenario"]) == 200_000


@pytest.mark.parametrize("blocks", [3, 20, 40, 90])
def test_a_killed_run_leaves_a_readable_file(tmp_path: Path, blocks: int) -> None:
    script = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_result import QUANTITIES, rows
from gustform_cli.result import ResultWriter
from pathlib import Path
writer = ResultWriter(Path({str(tmp_path)!r}), QUANTITIES, {{"wt": 3}}, 1_000_000, 1000, {{}})
for first in range(0, 1_000_000, 1000):
    writer.append(*rows(first, 1000))
    print(first + 1000, flush=True)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        written = 0
        for _ in range(blocks):
            written = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
    complete(tmp_path / PARTIAL)
    with xarray.open_dataset(tmp_path / PARTIAL, engine="h5netcdf") as data:
        assert data.sizes["time"] >= written
        assert data.attrs["status"] == "running"
        assert np.array_equal(data["sg.frequency"].values, data["time"].values.astype(np.float32))


@pytest.mark.parametrize("kind", ["a file in the way", "no permission"])
def test_a_folder_that_is_not_writable(tmp_path: Path, kind: str) -> None:
    if kind == "no permission":
        # Root may write anywhere but into the kernel's own folders.
        folder = Path("/proc/gustform-result") if os.geteuid() == 0 else tmp_path / "closed"
        if os.geteuid() != 0:
            folder.mkdir(mode=0o500)
    else:
        (tmp_path / "file").write_text("mine")
        folder = tmp_path / "file" / "results"
    with pytest.raises(GustformError) as caught:
        prepare_folder(folder)
    assert caught.value.code == "GF7001"
    assert str(folder) in caught.value.message
    assert kind == "no permission" or (tmp_path / "file").read_text() == "mine"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_an_error_of_ours(tmp_path: Path) -> None:
    (tmp_path / PARTIAL).symlink_to("/dev/full")
    with pytest.raises(GustformError) as caught:
        ResultWriter(tmp_path, QUANTITIES, {"wt": 3}, 1000, 1000, {})
    assert caught.value.code == "GF7001"


def test_the_file_of_another_writer_is_left_alone(tmp_path: Path) -> None:
    writer = ResultWriter(tmp_path, QUANTITIES, {"wt": 3}, 10_000, 1000, {})
    writer.append(*rows(0, 1000))
    with pytest.raises(GustformError, match="another process has it open") as caught:
        ResultWriter(tmp_path, QUANTITIES, {"wt": 3}, 10_000, 1000, {})
    assert caught.value.code == "GF7001"
    writer.append(*rows(1000, 1000))
    with xarray.open_dataset(writer.finish("completed", {})) as data:
        assert np.array_equal(data["sg.frequency"].values, data["time"].values.astype(np.float32))
        assert data.sizes["time"] == 2000

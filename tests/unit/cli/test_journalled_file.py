"""A file of which a killed process leaves one whole state: what it reads back, and what is left wherever it ends."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from gustform_cli import journalled_file
from gustform_cli.journalled_file import JournalledFile, complete, lock


def put(file: JournalledFile, place: int, data: bytes) -> None:
    file.seek(place)
    assert file.write(memoryview(data)) == len(data)


@pytest.mark.parametrize("seed", range(20))
def test_it_reads_what_was_written(tmp_path: Path, seed: int) -> None:
    """Random writes, reads, changes of length and commits, against the same on an array."""
    chance = random.Random(seed)
    file, model = JournalledFile(tmp_path / "file"), bytearray()
    for _ in range(400):
        place, count = chance.randrange(30_000), chance.choice([1, 7, 500, 4096, 9000])
        match chance.choice(["write", "write", "read", "truncate", "commit"]):
            case "write":
                data = chance.randbytes(count)
                put(file, place, data)
                model += bytes(max(0, place - len(model)))
                model[place : place + count] = data
            case "read":
                file.seek(place)
                assert file.read(count) == model[place : place + count]
            case "truncate" if place > len(model):  # HDF5 asks for the length that its directory has
                file.truncate(place)
                model += bytes(place - len(model))
            case "commit":
                file.commit()
                assert file.path.read_bytes() == model
                assert file.seek(0, os.SEEK_END) == len(model)
                assert list(tmp_path.iterdir()) == [tmp_path / "file"]
    file.close()


class KilledError(Exception):
    """As SIGKILL would: nothing more is done."""


def test_wherever_a_commit_ends_there_is_one_whole_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before each of its writes, and in the middle of one."""
    before, after = b"a" * 50_000, b"b" * 60_000
    real, steps, states = journalled_file._put, 0, []

    def killed_at(step: int, part: bool) -> None:
        nonlocal steps
        steps = 0

        def counted(handle: int, data: memoryview, at: int) -> None:
            nonlocal steps
            steps += 1
            if steps == step:
                real(handle, data[: len(data) // 2 if part else 0], at)
                raise KilledError
            real(handle, data, at)

        monkeypatch.setattr(journalled_file, "_put", counted)

    def changed(step: int, part: bool) -> bytes:
        path = tmp_path / f"{step}{part}"
        monkeypatch.setattr(journalled_file, "_put", real)
        file = JournalledFile(path)
        put(file, 0, before)
        file.commit()
        killed_at(step, part)
        try:
            put(file, 0, after)
            file.commit()
        except KilledError:
            pass
        file.close()  # a killed process holds no locks
        complete(path)
        assert not path.with_name(f"{path.name}.redo").exists()
        return path.read_bytes()

    for step in range(1, 20):
        for part in (False, True):
            found = changed(step, part)
            # What lies behind the last whole state does not belong to it.
            states.append(found if found == after else found[: len(before)])
        if steps < step:
            break
    assert steps > 10, "it has that many pages"
    assert set(states) == {before, after}
    assert states[0] == before
    assert states[-1] == after


def test_a_journal_that_is_not_whole_counts_for_nothing(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"whole")
    for left in (b"", b"short", bytes(10_000)):
        (tmp_path / "file.redo").write_bytes(left)
        complete(path)
        assert path.read_bytes() == b"whole"
        assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def test_a_file_in_use_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "file"
    file = JournalledFile(path)
    put(file, 0, b"mine")
    file.commit()
    (tmp_path / "file.redo").write_bytes(b"under way")
    complete(path)
    assert (tmp_path / "file.redo").exists()
    with pytest.raises(BlockingIOError, match="another process has it open"):
        JournalledFile(path)
    assert path.read_bytes() == b"mine"
    with pytest.raises(OSError, match="lock"):
        h5py.File(path, "w")  # HDF5 knows this lock
    file.close()
    JournalledFile(path).close()
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def test_readers_do_not_keep_readers_out(tmp_path: Path) -> None:
    """A result that is open in a notebook can be gone on with; one that is being written cannot."""
    path = tmp_path / "file.h5"
    h5py.File(path, "w").close()
    with h5py.File(path, "r"), path.open("rb") as stream:
        lock(stream, shared=True)
    file = JournalledFile(path)
    with path.open("rb") as stream, pytest.raises(BlockingIOError):
        lock(stream, shared=True)
    file.close()


WRITER = """
import sys
from pathlib import Path
import h5py, numpy as np
from gustform_cli.journalled_file import JournalledFile
disk = JournalledFile(Path(sys.argv[1]))
file = h5py.File(disk, "w")
data = [file.create_dataset(f"x{k}", (0,), maxshape=(None,), chunks=(10,), dtype="i8") for k in range(20)]
for block in range(100_000):
    for one in data:
        one.resize((10 * block + 10,))
        one[10 * block :] = np.arange(10 * block, 10 * block + 10)
    file.flush()
    disk.commit()
    if block == 0:
        print("begun", flush=True)
"""


@pytest.mark.parametrize("seed", range(12))
def test_hdf5_is_whole_after_a_kill(tmp_path: Path, seed: int) -> None:
    """A process that does nothing but write, killed at a random moment. Without the journal one in 25 was not whole."""
    path = tmp_path / "file.h5"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"begun\n"
        time.sleep(random.Random(seed).uniform(0.0, 0.1))
        process.send_signal(signal.SIGKILL)
    complete(path)
    with h5py.File(path) as file:
        rows = file["x0"].shape[0]
        assert rows >= 10
        for k in range(20):
            assert np.array_equal(file[f"x{k}"][()], np.arange(rows))

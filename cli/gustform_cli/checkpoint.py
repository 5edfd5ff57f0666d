"""Checkpoints of a run: one file from which another process can go on, bit for bit.

    result.nc.part          rows in whole blocks, which nothing changes once they are written
    result.nc.chunks.G      where each block of each variable lies in that file; appended to
    result.nc.checkpoint    everything else: solver and statistics, rows of the block that is not full, watches

The file is replaced in one go after the other two have reached the disk. It says how much of them counts: what came
later is cut off when the run goes on. HDF5's own directory of a file that was open when the power failed need not be
whole; the copy of the places in `chunks` is, so the rows are found without it. G counts how often the run was resumed.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.rows import Rows, Times

SUFFIX = ".checkpoint"
_MAGIC = b"GUSTRUN1"
_DIGEST = hashlib.sha256().digest_size
_BLOBS = ("solver", "times", "rows")  # behind the header, in this order

_FROM = 3600.0  # s; shorter runs have no checkpoints unless the scenario asks for them
_SHARE = 50  # of the run between two checkpoints
_LEAST = 600.0  # s between two
LEAST_WAIT = 10.0  # s of waiting between two files, unless the scenario says how often

Places = NDArray[np.uint64]  # (blocks, variables, 2): offset and size in bytes


def interval(until: float, wanted: float | None) -> float:
    """Simulated time between two checkpoints, s; infinite for none."""
    if wanted is not None:
        return wanted
    return max(until / _SHARE, _LEAST) if until >= _FROM else float("inf")


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run at the time `time`, s. `blocks` whole blocks of rows are in the result; `wall` is how long the
    run has taken, s; `watches` what the Python side has seen."""

    time: float
    number: int  # of the checkpoint, counted from 0 at the start
    scenario: str
    scenario_file: str  # absolute
    wind: dict[str, str]  # what the wind files were
    versions: dict[str, str]
    result: str  # name of the result file
    generation: int
    blocks: int
    block_rows: int
    variables: int
    wall: float
    watches: dict[str, Any]
    solver: bytes = field(repr=False)
    times: Times = field(repr=False)
    rows: Rows = field(repr=False)

    def encode(self) -> bytes:
        """The file's bytes."""
        header = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in _BLOBS}
        blobs = [self.solver, self.times.tobytes(), self.rows.tobytes()]
        header["sizes"] = [len(blob) for blob in blobs]
        header["type"], header["columns"] = str(self.rows.dtype), int(self.rows.shape[1])
        text = json.dumps(header).encode()
        body = b"".join([_MAGIC, len(text).to_bytes(8, "little"), text, *blobs])
        return body + hashlib.sha256(body).digest()


def decode(data: bytes, path: Path) -> Checkpoint:
    """The checkpoint in a file's bytes; GF7008 if they are not whole."""
    body, digest = data[:-_DIGEST], data[-_DIGEST:]
    if data[: len(_MAGIC)] != _MAGIC or hashlib.sha256(body).digest() != digest:
        raise damaged(path, "it is not whole")
    start = len(_MAGIC) + 8
    end = start + int.from_bytes(data[len(_MAGIC) : start], "little")
    header = json.loads(body[start:end])
    sizes, kind, columns = header.pop("sizes"), header.pop("type"), header.pop("columns")
    blobs = []
    for size in sizes:
        blobs.append(body[end : end + size])
        end += size
    times = np.frombuffer(blobs[1], np.float64)
    return Checkpoint(
        **header, solver=blobs[0], times=times, rows=np.frombuffer(blobs[2], kind).reshape(times.size, columns)
    )


def damaged(path: Path, reason: str) -> GustformError:
    """GF7008 for a checkpoint or a result that cannot be gone on with."""
    return GustformError(
        "GF7008", f"the run cannot go on from {str(path)!r}: {reason}", hint="gustform simulate with the scenario, anew"
    )


# ---- files ----------------------------------------------------------------------------------------------------------
def checkpoint_file(result: Path) -> Path:
    """The checkpoint of a run into `result`."""
    return result.with_name(result.name + SUFFIX)


def chunks_file(result: Path, generation: int) -> Path:
    """The directory of blocks of a run into `result`."""
    return result.with_name(f"{result.name}.chunks.{generation}")


def read(folder: Path) -> Checkpoint:
    """The checkpoint of the run in a folder. GF7006 if there is none, GF7008 if it is damaged."""
    found = sorted(folder.glob(f"*{SUFFIX}"))
    if not found:
        raise GustformError(
            "GF7006",
            f"there is no checkpoint in {str(folder)!r}: the run had none, or did not begin",
            hint="run.checkpoint: 10 min in the scenario, or a folder with a file *.checkpoint",
        )
    try:
        data = found[0].read_bytes()
    except OSError as error:
        raise damaged(found[0], error.strerror or str(error)) from None
    return decode(data, found[0])


def write(path: Path, data: bytes) -> None:
    """Replace a file in one go: it holds what it held or all of `data`, and the disk has it. Raises OSError."""
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    keep_names(path.parent)


def keep_names(folder: Path) -> None:
    """See to it that the names in a folder last: it is a file of names."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def append_places(path: Path, before: int, places: Places) -> None:
    """Append where blocks lie behind the `before` that are known already, and see it to the disk. Raises OSError."""
    with path.open("r+b" if path.exists() else "w+b") as file:
        file.truncate(before * places.shape[1] * 16)  # a crash may have left more
        file.seek(0, os.SEEK_END)
        file.write(np.ascontiguousarray(places, "<u8").tobytes())
        file.flush()
        os.fsync(file.fileno())


def read_places(path: Path, variables: int, first: int, blocks: int) -> Places:
    """Where blocks lie, `blocks` of them from `first` on; fewer where the file ends."""
    count = blocks * variables * 2
    with path.open("rb") as file:
        file.seek(first * variables * 16)
        numbers = np.fromfile(file, "<u8", count)
    whole = numbers.size // (variables * 2)
    return numbers[: whole * variables * 2].reshape(whole, variables, 2)


def discard(result: Path) -> None:
    """Remove the checkpoint of an earlier run into `result`."""
    checkpoint_file(result).unlink(missing_ok=True)
    for left in [*result.parent.glob(f"{result.name}.chunks.*"), *result.parent.glob(f"{result.name}.part.*")]:
        left.unlink(missing_ok=True)

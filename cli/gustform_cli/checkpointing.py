"""Checkpoints as a run takes them, and taken up by another one."""

from __future__ import annotations

import hashlib
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gustform.language.errors import GustformError
from gustform_cli import checkpoint as files
from gustform_cli.assemble import Assembled
from gustform_cli.checkpoint import Checkpoint
from gustform_cli.journalled_file import lock
from gustform_cli.result import ResultWriter
from gustform_cli.rows import RowBlocks
from gustform_cli.versions import versions
from gustform_cli.wind.blocks import FileWind

if TYPE_CHECKING:
    from gustform_runtime import Simulation

_LOOKED_AT = 1 << 16  # bytes at either end of a wind file: it may be a hundred gigabytes
_BATCH = 256  # blocks copied in one go


def wind_files(assembled: Assembled) -> dict[str, str]:
    """What each wind file is like: its size and a hash of its two ends."""
    found = {}
    for name, block in assembled.scenario.wind.items():
        if isinstance(block, FileWind):
            path = Path(assembled.document.file).parent / block.path
            with path.open("rb") as file:
                size = file.seek(0, 2)
                file.seek(0)
                digest = hashlib.sha256(file.read(_LOOKED_AT))
                file.seek(max(0, size - _LOOKED_AT))
                digest.update(file.read())
            found[name] = f"{size} bytes, {digest.hexdigest()}"
    return found


def other(what: str, was: str, now: str) -> GustformError:
    """GF7007: the run would not go on as it began."""
    return GustformError(
        "GF7007",
        f"the run cannot be resumed: {what} must be the same; it was {was} and is {now}",
        hint=f"the {what} of then, or gustform simulate with the scenario, anew",
    )


def check_same(found: Checkpoint, assembled: Assembled) -> None:
    """GF7007 unless versions and wind are those of the run; the runtime sees to the model itself."""
    now = versions()
    for name in sorted({*found.versions, *now}):
        was, is_ = found.versions.get(name, "absent"), now.get(name, "absent")
        if was != is_:
            raise other(f"version of {name}", was, is_)
    winds = wind_files(assembled)
    for name in sorted({*found.wind, *winds}):
        if found.wind.get(name) != winds.get(name):
            raise other(f"wind file of {name}", found.wind.get(name, "none"), winds.get(name, "none"))


class Keeper:
    """Writes the checkpoints of one run into the folder of its result."""

    def __init__(self, assembled: Assembled, result: Path, writer: ResultWriter, block_rows: int) -> None:
        scenario = assembled.scenario
        self.warnings: list[str] = []
        self._file, self._writer, self._result = files.checkpoint_file(result), writer, result
        self._every_one = scenario.run.checkpoint is not None
        self._last = time.perf_counter()
        self._known = 0  # blocks whose places have been written
        self._generation = 0
        self._fixed: dict[str, Any] = {
            "scenario": assembled.document.text(),
            "scenario_file": str(Path(assembled.document.file).absolute()),
            "wind": wind_files(assembled),
            "versions": versions(),
            "result": result.name,
            "block_rows": block_rows,
            "variables": writer.variables,
        }

    @property
    def due(self) -> bool:
        """Whether one is to be written, rather than passed over because the last one was just now."""
        return self._every_one or time.perf_counter() - self._last >= files.LEAST_WAIT

    def save(
        self, simulation: Simulation, number: int, blocks: RowBlocks, watches: dict[str, Any], wall: float
    ) -> None:
        """Write the checkpoint that the simulation has just made. If it cannot be written the run goes on with the one
        before; if the rows cannot, GF7001."""
        self._writer.sync()
        places = self._writer.places(self._known)
        pending_times, pending_rows = blocks.pending
        made = Checkpoint(
            **self._fixed,
            time=simulation.time,
            number=number,
            generation=self._generation,
            blocks=self._writer.blocks,
            wall=wall,
            watches=watches,
            solver=simulation.checkpoint_bytes(),
            times=pending_times,
            rows=pending_rows,
        )
        try:
            files.append_places(files.chunks_file(self._result, self._generation), self._known, places)
            files.write(self._file, made.encode())
        except OSError as error:
            self.warnings.append(
                f"the checkpoint at {simulation.time:g} s could not be written: {error.strerror or error}"
            )
            return
        self._known += len(places)
        self._last = time.perf_counter()

    def take_up(self, found: Checkpoint) -> None:
        """Copy the rows of a run that ended into the new result, and make that the one to go on from.

        The old file stays until the new one and a checkpoint that belongs to it are on the disk: at whatever moment
        this ends, the run can be resumed. GF7008 if the rows are not there, or if it goes on still.
        """
        folder, generation = self._result.parent, found.generation
        old = _rows_of(self._result, generation)
        places_file = files.chunks_file(self._result, generation)
        try:
            with old.open("rb") as source:
                lock(source, shared=True)
                for first in range(0, found.blocks, _BATCH):
                    wanted = min(_BATCH, found.blocks - first)
                    places = files.read_places(places_file, found.variables, first, wanted)
                    if len(places) < wanted:
                        raise ValueError(f"{places_file.name} is too short")
                    self._writer.adopt(source, places)
        except FileNotFoundError as error:
            raise files.damaged(self._file, f"{Path(error.filename or old).name} is missing") from None
        except BlockingIOError:
            raise GustformError(
                "GF7008", f"the run cannot go on from {str(old)!r}: it still runs", hint="waiting, or its Ctrl-C"
            ) from None
        except ValueError as error:
            raise files.damaged(old, str(error)) from None
        self._generation = generation + 1
        self._writer.sync()
        try:
            new_places = files.chunks_file(self._result, self._generation)
            new_places.unlink(missing_ok=True)
            for first in range(0, max(1, found.blocks), _BATCH):
                files.append_places(new_places, first, self._writer.places(first)[:_BATCH])
            files.write(self._file, replace(found, generation=self._generation).encode())
            self._writer.rename(self._result.with_name(f"{self._result.name}.part"))
            files.keep_names(folder)
        except OSError as error:
            raise GustformError(
                "GF7001", f"the result in {str(folder)!r} cannot be written; {error.strerror or error}", hint="space"
            ) from None
        self._known = found.blocks
        places_file.unlink(missing_ok=True)


def new_part(result: Path, found: Checkpoint) -> str:
    """The name of the file that the rows are copied into."""
    return f"{result.name}.part.{found.generation + 1}"


def _rows_of(result: Path, generation: int) -> Path:
    """The file that has the rows of a generation: under the name it was copied into, or the name of a running or of a
    closed result."""
    names = [f"{result.name}.part.{generation}", f"{result.name}.part", result.name]
    return next((path for path in map(result.with_name, names) if path.exists()), result)

"""What a campaign has found so far: a journal that only grows, one line for each case that ended.

A line is on the disk before the next second begins, a torn last line is one case that is run again, and two sweeps
cannot write into one folder. The table is made from the journal (`table.py`).
"""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from gustform.language.errors import GustformError, Place
from gustform_cli.result import prepare_folder
from gustform_cli.sweep.case import Fault, Outcome

JOURNAL = "journal.jsonl"
_SYNC_EVERY = 1.0  # s


@dataclass(frozen=True)
class Record:
    """How a case ended, as the journal keeps it."""

    key: str
    status: str
    fault: Fault | None
    scalars: Mapping[str, float]
    wall_seconds: float
    solve_seconds: float


class Store:
    """The journal of a folder; use as a context. GF7001 if it cannot be written, GF7004 if another sweep has it."""

    def __init__(self, folder: Path) -> None:
        prepare_folder(folder)
        self.file = folder / JOURNAL
        self.records: dict[str, Record] = {}
        self.units: dict[str, str] = {}
        self._synced = time.monotonic()
        try:
            self._stream = self.file.open("ab+")
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._stream.close()
            raise GustformError(
                "GF7004", f"the folder {str(folder)!r} must be free; another sweep writes into it", hint="--out"
            ) from None
        except OSError as error:
            raise self._not_written(error) from None
        self._read()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._stream:  # closing lets the lock go
            self._sync()

    def add(self, key: str, outcome: Outcome) -> None:
        """Note how a case ended."""
        new = {name: unit for name, unit in outcome.units.items() if self.units.get(name) != unit}
        if new:
            self.units.update(new)
            self._write({"units": new})
        record = Record(
            key, outcome.status, outcome.fault, outcome.scalars, outcome.wall_seconds, outcome.solve_seconds
        )
        self.records[key] = record
        self._write(asdict(record))
        if time.monotonic() - self._synced > _SYNC_EVERY:
            self._sync()

    def _write(self, line: Mapping[str, Any]) -> None:
        try:
            self._stream.write(json.dumps(line).encode() + b"\n")
            self._stream.flush()
        except OSError as error:
            raise self._not_written(error) from None

    def _sync(self) -> None:
        try:
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise self._not_written(error) from None
        self._synced = time.monotonic()

    def _read(self) -> None:
        """Take up what is there. The end of a file that a crash cut off is cut off too."""
        self._stream.seek(0)
        whole = 0
        for line in self._stream:
            if not line.endswith(b"\n"):
                break
            try:
                entry = json.loads(line)
                if "units" in entry:
                    self.units.update(entry["units"])
                else:
                    self.records[entry["key"]] = _record(entry)
            except (ValueError, KeyError, TypeError):
                break
            whole += len(line)
        self._stream.truncate(whole)

    def _not_written(self, error: OSError) -> GustformError:
        return GustformError(
            "GF7001",
            f"{str(self.file)!r} cannot be written; {error.strerror or error}",
            hint="--out with a folder that has space",
        )


def _record(entry: dict[str, Any]) -> Record:
    fault = entry.pop("fault")
    if fault is not None:
        place = fault.pop("place")
        fault = Fault(**fault, place=Place(**place) if place is not None else None)
    return Record(**entry, fault=fault)

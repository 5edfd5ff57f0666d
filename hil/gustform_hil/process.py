"""A gust-bridge that this process has started: what it says, and its end.

GF8076 the program cannot be started or has ended by itself
"""

from __future__ import annotations

import json
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from gustform.language.errors import GustformError

# On the sync clock time is counted in Syncs, and a pause of this computer is none of the bus.
UNHURRIED = ("--patience", "20000", "--watchdog", "20000")
_PATIENCE = 10.0  # s for a program to begin, and to end after SIGTERM


class Bridge:
    """A running bridge; a context that ends it with SIGTERM. `events`: the JSON lines that it has written so far."""

    def __init__(self, program: Path, interface: str, clock: str = "sync", options: Sequence[str] = ()) -> None:
        if not program.is_file():
            raise GustformError(
                "GF8076", f"the bridge {str(program)!r} must exist", hint="gustform hil build SCENARIO.yaml --out RIG"
            )
        command = [str(program), "--interface", interface, "--clock", clock, *options]
        self.events: list[dict[str, Any]] = []
        self.words: list[str] = []  # on stderr
        self._begun = threading.Event()
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
        except OSError as error:
            raise GustformError(
                "GF8076",
                f"the bridge {str(program)!r} cannot be started; {error.strerror or error}",
                hint="gustform hil build again, on this machine",
            ) from None
        self._readers = [
            threading.Thread(target=self._listen, daemon=True),
            threading.Thread(target=self._overhear, daemon=True),
        ]
        for reader in self._readers:
            reader.start()
        if not self._begun.wait(_PATIENCE):  # it then listens to the bus
            self.stop()
            raise GustformError("GF8076", f"gust-bridge has not begun within {_PATIENCE:g} s", hint="a free interface")
        self.check()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                found = json.loads(line)
            except ValueError:
                self.words.append(line.rstrip())
                continue
            if isinstance(found, dict):
                self.events.append(found)
                self._begun.set()
        self._begun.set()

    def _overhear(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.words.append(line.rstrip())

    @property
    def process_id(self) -> int:
        """Of the operating system."""
        return self._process.pid

    def check(self) -> None:
        """That it still runs. GF8076."""
        code = self._process.poll()
        if code is not None:
            self._join()
            words = " ".join(self.words[-3:]) or "without a word"
            raise GustformError(
                "GF8076", f"gust-bridge has ended with exit code {code}: {words}", hint="a look at its command line"
            )

    def stop(self) -> int:
        """End it; its exit code. Its statistics are then the last of `events`."""
        if self._process.poll() is None:
            self._process.terminate()
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        self._join()
        return code

    def _join(self) -> None:
        for reader in self._readers:
            reader.join(_PATIENCE)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()

"""What was on the bus, in a file: candump's text (.log) or ASAM MDF 4 (.mf4), by python-can's writers and readers.

Text is written as it comes and is whole whenever a run ends. MF4 takes a tenth of a millisecond for each frame, so what
comes is kept in memory and written at the end: for long runs, text.

GF8074 the file cannot be written   GF8075 the file cannot be read
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from gustform.language.errors import GustformError
from gustform_hil.bus import python_can

if TYPE_CHECKING:
    import can

KINDS = (".log", ".mf4")


def _check_kind(file: Path, code: str) -> None:
    if file.suffix.lower() not in KINDS:
        raise GustformError(
            code, f"a log must end in {' or '.join(KINDS)}; got {str(file)!r}", hint=f"{file.stem or 'bus'}.log"
        )
    if file.suffix.lower() == ".mf4":
        try:
            import asammdf  # noqa: F401
        except ImportError:
            raise GustformError(
                code, f"{file.name} needs the package asammdf", hint="pip install 'gustform[mf4]', or a .log"
            ) from None


class Log:
    """A log being written; a context, and a tap for a `Bus`. GF8074."""

    def __init__(self, file: Path) -> None:
        _check_kind(file, "GF8074")
        can = python_can()
        try:
            self._writer: Any = can.Logger(str(file))
        except OSError as error:
            raise GustformError(
                "GF8074", f"the log {str(file)!r} cannot be written; {error.strerror or error}", hint="another file"
            ) from None
        self.file, self.frames = file, 0
        self._kept: list[Any] | None = [] if file.suffix.lower() == ".mf4" else None

    def __call__(self, message: can.Message) -> None:
        self.frames += 1
        if self._kept is not None:
            self._kept.append(message)
        else:
            self._writer(message)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Write what is left. GF8074."""
        try:
            for message in self._kept or ():
                self._writer(message)
            self._writer.stop()
        except OSError as error:
            raise GustformError(
                "GF8074", f"the log {str(self.file)!r} cannot be written; {error.strerror or error}", hint="more space"
            ) from None


def read_log(file: Path) -> Iterator[can.Message]:
    """The frames of a log, error frames included, in the order of the file. GF8075."""
    _check_kind(file, "GF8075")
    can = python_can()
    if not file.is_file():
        raise GustformError("GF8075", f"the log {str(file)!r} must exist", hint="gustform hil plant ... --log FILE")
    try:
        with can.LogReader(str(file)) as messages:
            yield from messages
    except GustformError:
        raise
    except Exception as error:  # whatever a damaged file makes the readers say
        raise GustformError(
            "GF8075", f"the log {str(file)!r} cannot be read; {error}", hint="candump -L, or MDF 4 with CAN frames"
        ) from None

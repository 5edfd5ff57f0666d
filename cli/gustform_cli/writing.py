"""Files that cannot be written, said in one way by all who write them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gustform.language.errors import GustformError


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """What goes wrong on disk inside is GF7001 with the name of the file."""
    try:
        yield
    except OSError as error:
        raise GustformError(
            "GF7001", f"{str(file)!r} cannot be written; {error.strerror or error}", hint="--out with another folder"
        ) from None


def write_text(file: Path, text: str) -> Path:
    """Write a text file, UTF-8; GF7001 if it cannot be written."""
    with writing(file):
        file.write_text(text, encoding="utf-8")
    return file

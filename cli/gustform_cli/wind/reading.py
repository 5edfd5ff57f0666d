"""Wind files that cannot be read, said in one way by all who read them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gustform.language.errors import GustformError, Place


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """What the system refuses inside is GF2501 with the name of the file."""
    try:
        yield
    except OSError as error:
        raise GustformError(
            "GF2501",
            f"the wind file must be readable; {error.strerror or error}",
            hint="the path relative to the scenario file",
            place=Place(str(path)),
        ) from None

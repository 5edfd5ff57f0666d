"""Text files from outside: read whole, up to a size, in the first encoding that fits."""

from __future__ import annotations

from pathlib import Path

from gustform.language.errors import GustformError, Place


def read(file: Path, what: str, most_bytes: int, encodings: tuple[str, ...]) -> str:
    """The text in `file`, a `what`. Raises GF8001."""
    place = Place(str(file))
    try:
        with file.open("rb") as stream:
            data = stream.read(most_bytes + 1)
    except OSError as error:
        raise GustformError(
            "GF8001",
            f"the {what} must be a readable file; got: {error.strerror or error}",
            hint="the path of a file",
            place=place,
        ) from None
    if len(data) > most_bytes:
        raise GustformError("GF8001", f"the {what} must have at most {most_bytes} bytes; it has more", place=place)
    for encoding in encodings:
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" in text:
            break
        return text
    raise GustformError(
        "GF8001",
        f"the {what} must be text in {' or '.join(encodings)}; it is not",
        hint=f"saving it as {encodings[0]}",
        place=place,
    )

"""A DBC file by cantools, after a look at the sizes it asks for, and the line of each of its messages and signals."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError, Place
from gustform_hil.text import read

_MOST_BYTES = 4 << 20
_MOST_IDS = 4096  # multiplexer values of one signal; cantools writes ranges out

# As cantools cuts the text: white space and comments, strings, numbers, words, anything else.
_TOKEN = re.compile(r'\s+|//.*?\n|("(?:\\"|[^"])*?"|[-+]?\d+\.?\d*(?:[eE][+-]?\d+)?|\w+|.)', re.DOTALL)


@dataclass(frozen=True)
class Dbc:
    """The database of cantools, and where in the file its messages and signals are."""

    file: str
    database: Any
    lines: Mapping[tuple[str, str], Place]  # (message, signal or "")

    def place(self, message: str, signal: str = "") -> Place:
        """Where the signal, or else its message, is."""
        return self.lines.get((message, signal)) or self.lines.get((message, "")) or Place(self.file)


def cantools() -> Any:
    """The package, imported where it is needed. Raises GF8000."""
    try:
        import cantools.database
    except ImportError:
        raise GustformError(
            "GF8000",
            "the package cantools must be installed to read a database",
            hint="pip install 'gustform[hil]'",
        ) from None
    return cantools


def read_dbc(file: Path) -> Dbc:
    """The database in `file`. Raises GF8000, GF8001, GF8002."""
    package = cantools()
    text = read(file, "database", _MOST_BYTES, ("utf-8-sig", "cp1252"))
    place = Place(str(file))
    _check_sizes(text, place)
    try:
        # Signals that overlap in messages of no concern here are left alone; those of the mapping are checked again.
        database = package.database.load_string(text, database_format="dbc", strict=False)
    except Exception as error:  # whatever a text can make a parser raise is one refusal
        problem = " ".join(str(error).split())[:300]
        raise GustformError(
            "GF8002",
            f"the database must be a DBC that cantools understands; {problem or type(error).__name__}",
            hint="opening it with: cantools dump FILE",
            place=place,
        ) from None
    return Dbc(str(file), database, _lines(text, str(file)))


def _check_sizes(text: str, place: Place) -> None:
    """Refuse sizes that no CAN frame has, before a parser makes room for them."""
    tokens = [token for token in _TOKEN.findall(text) if token]
    tokens += [""] * 8
    for at, token in enumerate(tokens):
        if token == "BO_" and tokens[at + 3] == ":":
            _limit(f"the length of {tokens[at + 2][:64]}", tokens[at + 4], 64, place)
        elif token == "SG_" and ":" in tokens[at + 2 : at + 4]:
            colon = tokens.index(":", at + 2)
            _limit(f"the start bit of {tokens[at + 1][:64]}", tokens[colon + 1], 511, place)
            _limit(f"the length of {tokens[at + 1][:64]}", tokens[colon + 3], 64, place)
        elif token == "SG_MUL_VAL_" and tokens[at + 1].isdecimal():
            _check_span(tokens, at, place)


def _check_span(tokens: list[str], at: int, place: Place) -> None:
    values = 0
    numbers = []
    for token in tokens[at + 4 :]:
        if token in (";", ""):
            break
        if token != ",":
            numbers.append(token)
    for low, high in zip(numbers[::2], numbers[1::2], strict=False):
        _limit("a multiplexer value", low, _MOST_IDS, place)
        _limit("a multiplexer value", high.lstrip("-+"), _MOST_IDS, place)
        values += int(high.lstrip("-+")) - int(low) + 1
    if values > _MOST_IDS:
        _refuse(f"the number of multiplexer values of {tokens[at + 2][:64]}", str(values), _MOST_IDS, place)


def _limit(what: str, got: str, most: int, place: Place) -> None:
    if not re.fullmatch(r"\+?\d{1,9}", got) or int(got) > most:
        _refuse(what, got[:20], most, place)


def _refuse(what: str, got: str, most: int, place: Place) -> None:
    raise GustformError("GF8002", f"{what} must be a whole number of at most {most}; got {got!r}", place=place)


def _lines(text: str, file: str) -> dict[tuple[str, str], Place]:
    places: dict[tuple[str, str], Place] = {}
    message = ""
    for number, line in enumerate(text.splitlines(), start=1):
        found = re.match(r"\s*(BO_\s+\d+|SG_)\s+(\w+)", line)
        if not found:
            continue
        place = Place(file, number, found.start(2) + 1)
        if found[1] == "SG_":
            places.setdefault((message, found[2]), place)
        else:
            message = found[2]
            places.setdefault((message, ""), place)
    return places

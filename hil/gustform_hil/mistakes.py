"""Collects what is wrong with a database or a mapping, so that all of it is told in one go.

Codes of the bus's message set:
GF8000 package not installed        GF8010 quantity unknown            GF8020 name cannot become C
GF8001 file cannot be read          GF8011 range missing, empty        GF8021 two names are one in C
GF8002 database not understood      GF8012 unit of another quantity    GF8022 value of least harm out of range
GF8003 mapping not valid YAML       GF8013 E2E attributes              GF8030 no such message in the set
GF8004 key or kind of value         GF8014 E2E header not at its place GF8031 value not given
GF8005 message not in the database  GF8015 identifier                  GF8032 value cannot be carried
GF8006 signal not in its message    GF8016 multiplexer
GF8007 part or field unknown        GF8017 layout of a signal
GF8008 part twice, missing, torn    GF8018 too many signals
GF8009 field twice, missing, alien  GF8019 length of the frame
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from gustform.language.errors import ErrorList, GustformError, Place, did_you_mean


@dataclass
class Mistakes:
    """What has been found so far."""

    errors: list[GustformError] = field(default_factory=list)

    def add(self, code: str, message: str, place: Place, hint: str = "") -> None:
        """Keep one more."""
        self.errors.append(GustformError(code, message, hint=hint, place=place))

    def unknown(self, code: str, what: str, got: str, known: Iterable[str], place: Place) -> None:
        """Keep one about a name that is none of `known`."""
        names = sorted(known)
        self.add(code, f"{what} must be one that exists; got {got!r}", place, did_you_mean(got, names))

    def stop(self) -> None:
        """Raise what was found, if anything was: one as it is, several as a list."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise ErrorList(sorted(self.errors, key=_order))


def _order(error: GustformError) -> tuple[str, int, int]:
    place = error.place or Place("")
    return place.file, place.line, place.column

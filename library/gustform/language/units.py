"""Units of declarations as exponents of base dimensions, for checking equations.

Declarations use coherent SI units, per unit and two plain extensions that keep mistakes visible:

* ``pu`` and ``rad`` are dimensionless (the base is named in the sentence of the declaration);
* ``deg`` is a dimension of its own, so that degrees and radians cannot be added by accident.

Scaled units such as MW or rpm are refused here; they belong to the boundary (YAML), which converts them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from gustform.language.errors import GustformError

_BASES = ("m", "kg", "s", "A", "K", "deg")


@dataclass(frozen=True)
class Dimension:
    """Exponents of m, kg, s, A, K and deg."""

    exponents: tuple[Fraction, ...]

    def __mul__(self, other: Dimension) -> Dimension:
        return Dimension(tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        return Dimension(tuple(a - b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __pow__(self, power: Fraction | int) -> Dimension:
        return Dimension(tuple(a * power for a in self.exponents))

    def __str__(self) -> str:
        if self in _SHOWN:
            return _SHOWN[self]
        parts = [
            base if power == 1 else f"{base}^{power}"
            for base, power in zip(_BASES, self.exponents, strict=True)
            if power != 0
        ]
        return "*".join(parts) if parts else "1"


def _dimension(**powers: int) -> Dimension:
    return Dimension(tuple(Fraction(powers.get(base, 0)) for base in _BASES))


DIMENSIONLESS = _dimension()
SECOND = _dimension(s=1)

_UNITS: dict[str, Dimension] = {
    "1": DIMENSIONLESS,
    "pu": DIMENSIONLESS,
    "rad": DIMENSIONLESS,
    "deg": _dimension(deg=1),
    "m": _dimension(m=1),
    "kg": _dimension(kg=1),
    "s": SECOND,
    "A": _dimension(A=1),
    "K": _dimension(K=1),
    "Hz": _dimension(s=-1),
    "N": _dimension(kg=1, m=1, s=-2),
    "Pa": _dimension(kg=1, m=-1, s=-2),
    "J": _dimension(kg=1, m=2, s=-2),
    "W": _dimension(kg=1, m=2, s=-3),
    "VA": _dimension(kg=1, m=2, s=-3),
    "var": _dimension(kg=1, m=2, s=-3),
    "C": _dimension(A=1, s=1),
    "V": _dimension(kg=1, m=2, s=-3, A=-1),
    "ohm": _dimension(kg=1, m=2, s=-3, A=-2),
    "S": _dimension(kg=-1, m=-2, s=3, A=2),
    "F": _dimension(kg=-1, m=-2, s=4, A=2),
    "H": _dimension(kg=1, m=2, s=-2, A=-2),
    "Wb": _dimension(kg=1, m=2, s=-2, A=-1),
}

# How messages write dimensions that have a name; the others are products of base units.
_SHOWN = {_UNITS[name]: name for name in ("N", "Pa", "W", "V", "ohm", "S", "F", "H")}
_SHOWN |= {_UNITS["J"]: "N*m", _UNITS["Wb"]: "V*s", _UNITS["C"]: "A*s", _UNITS["Hz"]: "1/s"}

_TOKEN = re.compile(r"\s*(?:(?P<name>[A-Za-z]+|1)(?:\^(?P<power>-?\d+))?|(?P<op>[*/()]))")


@cache
def dimension_of(unit: str) -> Dimension:
    """The dimension of a unit string such as "kg*m^2", "N*m/rad", "deg/(pu*s)" or "1/s".

    Raises GF1001 for a unit that is not known here, naming it.
    """
    position = 0

    def fail() -> GustformError:
        return GustformError(
            "GF1001",
            f"unit {unit!r} is not understood",
            hint="a product of SI units without prefixes, e.g. 'kg*m^2', 'N*m/rad', 'deg/s', 'pu'",
        )

    def token() -> re.Match[str] | None:
        nonlocal position
        if not unit[position:].strip():
            return None
        match = _TOKEN.match(unit, position)
        if match is None:
            raise fail()
        position = match.end()
        return match

    def factor(match: re.Match[str] | None) -> Dimension:
        if match is None:
            raise fail()
        if match["op"] == "(":
            inner = term()
            closing = token()
            if closing is None or closing["op"] != ")":
                raise fail()
            return inner
        if match["name"] is None or match["name"] not in _UNITS:
            raise fail()
        return _UNITS[match["name"]] ** int(match["power"] or 1)

    def term() -> Dimension:
        nonlocal position
        result = factor(token())
        while True:
            before = position
            match = token()
            if match is None:
                return result
            if match["op"] == "*":
                result = result * factor(token())
            elif match["op"] == "/":
                result = result / factor(token())
            else:
                position = before
                return result

    result = term()
    if unit[position:].strip():
        raise fail()
    return result

"""Numbers as a reader wants them: as many digits as say something, units with a prefix, time spans in words."""

from __future__ import annotations

import math

_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))
_PREFIXED = {"W", "VA", "var", "V", "A", "J", "Wh", "N", "N*m", "Pa"}


def scale(unit: str, largest: float) -> tuple[float, str]:
    """What to divide by, and the unit then: 12e6 W are shown in MW. Per unit, degrees and the like stay."""
    if unit in _PREFIXED:
        for factor, prefix in _PREFIXES:
            if abs(largest) >= factor:
                return factor, prefix + pretty(unit)
    return 1.0, pretty(unit)


def pretty(unit: str) -> str:
    """kg*m^2 as kg·m²."""
    return unit.replace("*", "·").replace("^2", "²").replace("^3", "³")


def significant(value: float, digits: int = 4) -> str:
    """A number on its own: 49.64, 0.0123, 1026, 1.23e-07."""
    if not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{value:.0f}"
    if 1e-4 <= abs(value) < 1e6:
        places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:.{places}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits - 1}e}"


def places(spread: float, largest: float) -> int:
    """Decimals that show a spread to three digits: 49.9912 beside 0.0012. At most seven digits in all."""
    if not (math.isfinite(spread) and math.isfinite(largest)) or largest == 0.0:
        return 0
    whole = math.floor(math.log10(largest)) + 1
    wanted = 2 - math.floor(math.log10(spread)) if spread > 1e-7 * largest else 4 - whole
    return min(max(0, wanted), max(0, 7 - whole), 9)


def fixed(value: float, decimals: int) -> str:
    """A number among others of its row."""
    if not math.isfinite(value):
        return "–"
    if value != 0.0 and decimals >= 9 and abs(value) < 1e-6:
        return f"{value:.2e}"
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def plain(value: object) -> str:
    """A value of a scenario as one would write it in YAML: true, 1e-6."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}".replace("e-0", "e-").replace("e+0", "e") if isinstance(value, float) else str(value)


def count(value: float) -> str:
    """A whole number with thin spaces between thousands."""
    return f"{value:,.0f}".replace(",", "\u202f")


def many(number: int, one: str, several: str) -> str:
    """1 axis, 2 axes."""
    return f"{count(number)} {one if number == 1 else several}"


def duration(seconds: float) -> str:
    """90 s, 10 min, 24 h, 365 d."""
    if seconds < 300.0:
        return f"{significant(seconds)} s"
    divisor, name = next(
        (size, name) for least, size, name in ((259200.0, 86400.0, "d"), (7200.0, 3600.0, "h"), (0.0, 60.0, "min"))
        if seconds >= least
    )  # fmt: skip
    return f"{significant(seconds / divisor)} {name}"


def moment(seconds: float) -> str:
    """A time of a run: 42.66 s, 8.333 h where seconds would be many."""
    return f"{seconds:.2f} s" if seconds < 9000.0 else f"{seconds / 3600.0:.3f} h"


def size(number: int) -> str:
    """Bytes."""
    for factor, name in ((1 << 30, "GB"), (1 << 20, "MB"), (1 << 10, "kB")):
        if number >= factor:
            return f"{number / factor:.1f} {name}"
    return f"{number} bytes"

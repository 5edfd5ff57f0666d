"""Quantities of a scenario: "5 MW", "20 ms", "10 %" become numbers in the unit that the declaration asks for.

Units exist only at this boundary; behind it everything is SI, per unit or degrees as declared. What is declared in
"pu" or "1" may be a plain number or a percentage; everything else needs its unit written, so that nobody has to
guess whether 5 means 5 W or 5 MW.
"""

from __future__ import annotations

import math
import re
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from gustform.language.errors import GustformError

if TYPE_CHECKING:
    from pint import UnitRegistry
    from pint.util import UnitsContainer

_NUMBER = r"[+-]?(?:\d[\d_]*(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>.*?)\s*")
_NOT_FINITE = re.compile(r"\s*[+-]?\.?(nan|inf|infinity)\b.*", re.IGNORECASE)
# What a unit may consist of. Anything else never reaches the unit parser.
_UNIT = re.compile(r"[A-Za-zµμ°Ω%][A-Za-z0-9µμ°Ω%*/^() .-]*|1/[A-Za-z(][A-Za-z0-9*/^() -]*")

# Magnitudes that make a helpful example for a missing unit.
_USUAL = {"W": "MW", "VA": "MVA", "var": "Mvar", "V": "kV", "s": "s", "F": "mF", "H": "mH", "Hz": "Hz"}


@lru_cache(maxsize=1)
def _registry() -> UnitRegistry[float]:
    import pint  # 0.2 s: only when a quantity has to be converted

    return pint.UnitRegistry(Path(__file__).with_name("units.txt"), on_redefinition="raise")


@cache
def _scale(unit: str) -> tuple[float, UnitsContainer]:
    """Factor to base units, and the dimension. Raises ValueError for a unit that is not understood."""
    text = unit.strip()
    if text in ("1", ""):
        text = "pu"
    if not _UNIT.fullmatch(text):
        raise ValueError(unit)
    text = text.replace("%", "percent")
    registry = _registry()
    try:
        one = registry.Quantity(1.0, registry.parse_units(text.replace("1/", "pu/", 1) if text[0] == "1" else text))
        return float(one.to_base_units().magnitude), one.dimensionality
    except Exception as error:  # pint's parser stumbles in many ways over text that is no unit
        raise ValueError(unit) from error


def is_plain(unit: str) -> bool:
    """Whether a declared unit is taken without a unit written behind the number."""
    return unit in ("pu", "1")


def conversion(unit: str, declared: str) -> float | None:
    """The factor from `unit` to `declared`, None if they are of different dimensions.

    Raises ValueError if `unit` is not understood.
    """
    given, given_dimension = _scale(unit)
    wanted, wanted_dimension = _scale(declared)
    if given_dimension != wanted_dimension:
        # The equations know no radian ("1/s" is declared for angular speed): a radian may be dropped, but not
        # where the declaration is per unit, and never a turn (Hz is not rad/s).
        rest = given_dimension / wanted_dimension
        if is_plain(declared) or "deg" in declared or set(rest) != {"[angle]"}:
            return None
    return given / wanted


def split_quantity(value: object) -> tuple[float, str] | None:
    """A number and its unit as they are written, "" without one; None for what is no quantity."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), ""
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    return (float(match["number"]), match["unit"]) if match is not None else None


def parse_quantity(value: object, declared: str, path: str, description: str = "") -> float:
    """`value` as a number in the unit `declared`; `path` and `description` name it in errors.

    Raises GF2001 (not a number), GF2002 (not finite), GF2301 (no unit), GF2302 (another dimension), GF2303 (unit
    not understood).
    """
    what = f" ({description})" if description else ""
    example = _example(declared)
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise GustformError(
            "GF2001",
            f"{path} must be {'a number' if is_plain(declared) else f'a quantity in {declared}'}{what}; "
            f"got {_shown(value)}",
            hint=example,
        )
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value)
        if match is None and _NOT_FINITE.fullmatch(value):
            raise GustformError("GF2002", f"{path} must be finite{what}; got {_shown(value)}", hint=example)
        if match is None:
            raise GustformError(
                "GF2001", f"{path} must be a number with a unit of {declared}{what}; got {_shown(value)}", hint=example
            )
        number, unit = float(match["number"]), match["unit"]
        unit = "1" + unit if unit.startswith("/") else unit
    else:
        number, unit = float(value), ""
    if not math.isfinite(number):
        raise GustformError("GF2002", f"{path} must be finite{what}; got {_shown(value)}", hint=example)
    if not unit:
        if is_plain(declared):
            return number
        raise GustformError(
            "GF2301",
            f"{path} must be written with its unit ({declared}){what}; got {_shown(value)}",
            hint=f"{number:g} {_USUAL.get(declared, declared)}",
        )
    try:
        factor = conversion(unit, declared)
    except ValueError:
        raise GustformError(
            "GF2303", f"{path} must be in a unit of {declared}{what}; unit {unit!r} is not understood", hint=example
        ) from None
    if factor is None:
        raise GustformError(
            "GF2302",
            f"{path} must be in a unit of {declared}{what}; got {_shown(value)}, of another dimension",
            hint=example,
        )
    # Division where the declared unit is the larger one keeps 20 ms at 0.02 rather than 0.020000000000000004.
    inverse = 1.0 / factor
    if factor < 1.0 and abs(inverse - round(inverse)) < 1e-9 * inverse:
        return number / round(inverse)
    return number * factor


def _example(declared: str) -> str:
    if is_plain(declared):
        return "a number or a percentage, e.g. 0.05 or 5 %"
    return f"a number with a unit, e.g. 5 {_USUAL.get(declared, declared)}"


def _shown(value: object) -> str:
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."

"""Quantities at the boundary: what is accepted, and the code of what is refused."""

from __future__ import annotations

import hypothesis
import pytest

from gustform.language.errors import GustformError
from gustform_cli.quantity import parse_quantity


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("5 MW", "W", 5e6),
        ("20 ms", "s", 0.02),
        ("10 %", "pu", 0.1),
        (0.1, "pu", 0.1),
        (3, "1", 3.0),
        ("0.02 pu", "pu", 0.02),
        ("33 kV", "V", 33e3),
        ("8 m/s", "m/s", 8.0),
        ("72 km/h", "m/s", 20.0),
        ("5 deg", "deg", 5.0),
        ("180 deg", "rad", 3.141592653589793),
        ("210 MVA", "VA", 210e6),
        ("5 MVAr", "var", 5e6),
        ("5 Mvar", "var", 5e6),
        ("31.88 mF", "F", 0.03188),
        ("60 deg/pu", "deg/pu", 60.0),
        ("12 deg/(pu*s)", "deg/(pu*s)", 12.0),
        ("8.676e8 N*m/rad", "N*m/rad", 8.676e8),
        ("35.328e6 kg*m^2", "kg*m^2", 35.328e6),
        ("12 rpm", "1/s", 1.2566370614359172),
        ("1.2 rad/s", "1/s", 1.2),
        ("20 /s", "1/s", 20.0),
        ("1 h", "s", 3600.0),
        ("50Hz", "Hz", 50.0),
        ("-1_000.5e-1 V", "V", -100.05),
    ],
)
def test_accepted(text: object, unit: str, number: float) -> None:
    assert parse_quantity(text, unit, "x") == pytest.approx(number, rel=1e-15)


def test_a_prefix_leaves_no_rounding() -> None:
    # 20 * 0.001 is 0.020000000000000004 on some ways of converting; times of events are compared later.
    assert parse_quantity("20 ms", "s", "x") == 0.02
    assert parse_quantity("4.99 Mvar", "var", "x") == 4.99e6


@pytest.mark.parametrize(
    ("text", "unit", "code"),
    [
        (5, "W", "GF2301"),
        ("5", "W", "GF2301"),
        ("5 m", "W", "GF2302"),
        ("5 %", "W", "GF2302"),
        ("5 deg", "pu", "GF2302"),
        ("0.1 rad", "pu", "GF2302"),
        ("50 Hz", "1/s", "GF2302"),
        ("314 rad/s", "Hz", "GF2302"),
        ("5 mw", "W", "GF2303"),
        ("5 furlong", "m", "GF2303"),
        ("5 W; import os", "W", "GF2303"),
        ("5 __import__('os')", "W", "GF2303"),
        ("5 W^99999999999", "W", "GF2303"),
        ("5 degC", "K", "GF2303"),
        ("fast", "m/s", "GF2001"),
        ("", "m/s", "GF2001"),
        (True, "pu", "GF2001"),
        (None, "pu", "GF2001"),
        ([5], "pu", "GF2001"),
        (float("nan"), "pu", "GF2002"),
        (float("-inf"), "W", "GF2002"),
        (".nan", "pu", "GF2002"),
        ("NaN W", "W", "GF2002"),
        ("1e999 W", "W", "GF2002"),
    ],
)
def test_refused(text: object, unit: str, code: str) -> None:
    with pytest.raises(GustformError) as caught:
        parse_quantity(text, unit, "load.P", "active power")
    assert caught.value.code == code
    assert "load.P must" in caught.value.message
    assert "active power" in caught.value.message
    assert caught.value.hint


@hypothesis.given(text=hypothesis.strategies.text(max_size=30), number=hypothesis.strategies.floats())
def test_no_text_does_harm(text: str, number: float) -> None:
    for value in (text, f"5 {text}", f"{number} {text}", f"{number} MW", number):
        code = ""
        try:
            assert isinstance(parse_quantity(value, "W", "x"), float)
        except GustformError as error:
            code = error.code
        assert code in {"", "GF2001", "GF2002", "GF2301", "GF2302", "GF2303"}

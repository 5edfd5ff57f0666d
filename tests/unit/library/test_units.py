"""Units of declarations: what is understood, what is refused, and the arithmetic of dimensions."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gustform.language.errors import GustformError
from gustform.language.units import DIMENSIONLESS, Dimension, dimension_of

BASES = ("m", "kg", "s", "A", "K", "deg")


@pytest.mark.parametrize(
    ("unit", "same"),
    [
        ("N*m", "J"),  # torque and energy cannot be told apart by dimension
        ("J/s", "W"),
        ("V*A", "W"),
        ("VA", "var"),
        ("V/A", "ohm"),
        ("1/ohm", "S"),
        ("C/V", "F"),
        ("V*s", "Wb"),
        ("Wb/A", "H"),
        ("Pa*m^2", "N"),
        ("1/s", "Hz"),
        ("N*m/rad", "J"),  # rad is a plain number
        ("pu", "1"),
        ("rad", "1"),
        ("kg*m^2/s^2", "J"),
        ("kg*m^2*s^-2", "J"),
        ("deg/(pu*s)", "deg/s"),
        ("W/(V*(A))", "1"),
        ("m/s/s", "m*s^-2"),  # division goes from left to right
        (" m / s ", "m/s"),
        ("1^3", "1"),
    ],
)
def test_equal_dimensions(unit: str, same: str) -> None:
    assert dimension_of(unit) == dimension_of(same)


def test_degrees_are_a_dimension_of_their_own() -> None:
    assert dimension_of("deg") != dimension_of("rad")
    assert dimension_of("deg/s") / dimension_of("deg") == dimension_of("Hz")


@pytest.mark.parametrize(
    "unit",
    ["", " ", "MW", "rpm", "m2", "m^", "m^0.5", "m**2", "m//s", "/s", "m*", "(m", "m)", "()", "V A", "kg m", "2", "1e3",
     "m^2^2", "µF", "N·m", "m;s", "__import__('os')"],
)  # fmt: skip
def test_what_is_no_unit_is_refused_by_name(unit: str) -> None:
    with pytest.raises(GustformError) as refusal:
        dimension_of(unit)
    assert refusal.value.code == "GF1001"
    assert repr(unit) in str(refusal.value)
    assert "kg*m^2" in refusal.value.hint  # what to try


dimensions = st.tuples(*[st.integers(-4, 4)] * len(BASES)).map(lambda e: Dimension(tuple(Fraction(x) for x in e)))


@given(dimensions, dimensions)
def test_dimension_algebra(a: Dimension, b: Dimension) -> None:
    assert a * b / b == a
    assert a * b == b * a
    assert (a**2) ** Fraction(1, 2) == a
    assert a / a == DIMENSIONLESS
    assert (a * b) ** 3 == a**3 * b**3


@given(dimensions)
def test_a_dimension_prints_as_a_unit_that_reads_back(dimension: Dimension) -> None:
    assert dimension_of(str(dimension)) == dimension


@given(st.lists(st.tuples(st.sampled_from(BASES), st.integers(-3, 3)), min_size=1, max_size=5), st.integers(1, 5))
def test_products_and_quotients_add_and_subtract_exponents(factors: list[tuple[str, int]], cut: int) -> None:
    above, below = factors[:cut], factors[cut:]
    unit = "*".join(f"{name}^{power}" for name, power in above)
    if below:
        unit += "/(" + "*".join(f"{name}^{power}" for name, power in below) + ")"
    total = dict.fromkeys(BASES, 0)
    for sign, part in ((1, above), (-1, below)):
        for name, power in part:
            total[name] += sign * power
    assert dimension_of(unit).exponents == tuple(Fraction(total[name]) for name in BASES)

"""Unit check of equations: each kind of operation once with fitting units and once without."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import pytest

from gustform.language import (
    Component,
    Discrete,
    GustformError,
    Input,
    Parameter,
    Table,
    Variable,
    dead_band,
    limit,
    maximum,
    minimum,
    quantity,
    table2,
)
from gustform.language.scope import elaborate
from gustform.language.unitcheck import check_units


class Quantities(Component):
    """Something of each kind."""

    v = Variable("V", "a voltage")
    v2 = Variable("V", "another voltage")
    i = Variable("A", "a current")
    x = Variable("1", "a number")
    angle = Variable("rad", "an angle in radians")
    pitch = Variable("deg", "an angle in degrees")
    w = Variable("1/s", "a speed")
    u = Input("m/s", "wind")
    R = Parameter("ohm", "a resistance", default=1.0)
    C = Parameter("F", "a capacitance", default=1.0)
    T = Parameter("s", "a time", default=1.0)
    band = Parameter("V", "half a width", default=1.0)
    n = Parameter("1", "an exponent", default=2.0)
    d = Discrete("V", "a kept voltage")
    cp = Table("1", "deg", "pu", "power coefficient over tip speed ratio and pitch")


Sides = Callable[[Any], tuple[Any, Any]]


def check(statement: Callable[[Any], None]) -> None:
    kind = type("Case", (Quantities,), {"equations": statement})
    check_units(elaborate(kind()))


def check_equation(sides: Sides) -> None:
    check(lambda c: c.eq(*sides(c)))


FITTING: list[Sides] = [
    lambda c: (c.v, c.R * c.i),
    lambda c: (c.C * c.der(c.v), c.i),
    lambda c: (c.v, c.v2 - c.R * c.i),
    lambda c: (c.v, -c.v2),
    lambda c: (c.v, 2 * c.v2 + c.v2),
    lambda c: (c.v, 0),
    lambda c: (0, c.v),
    lambda c: (c.v * c.i, c.v**2 / c.R),
    lambda c: (c.v, ca.sqrt(c.v**2 + c.v2**2)),
    lambda c: (c.v, (c.v**2 + c.v2**2) ** 0.5),
    lambda c: (c.x, c.x**c.n),
    lambda c: (c.v * c.v * c.v, c.v2**3),
    lambda c: (c.v, ca.hypot(c.v, c.v2)),
    lambda c: (c.v, ca.fabs(c.v2)),
    lambda c: (1 / c.T, c.w),
    lambda c: (c.x, 1 / (1 + ca.exp(-c.x))),
    lambda c: (c.x, ca.sin(c.angle) * ca.cos(c.w * c.T) + ca.tan(c.angle) + ca.log(c.x)),
    lambda c: (c.angle, ca.atan2(c.v, c.v2)),
    lambda c: (c.der(c.angle), c.w),
    lambda c: (c.v, limit(c.v2, -c.band, c.band)),
    lambda c: (c.v, limit(c.v2, 0, c.band)),  # 0 fits any unit
    lambda c: (c.v, maximum(c.v2, c.R * c.i) + minimum(0, c.v2)),
    lambda c: (c.v, dead_band(c.v2, c.band)),
    lambda c: (c.v, c.v2 + c.d),
    lambda c: (c.x, c.pitch / quantity(1, "deg")),
    lambda c: (c.pitch, c.angle * quantity(57.3, "deg/rad")),
    lambda c: (c.x, table2(c.cp, c.w * c.T, c.pitch)),
    lambda c: (c.x, table2(c.cp, table2(c.cp, c.x, c.pitch), c.pitch)),
    lambda c: (c.x, c.u * c.T / quantity(1, "m")),
]


@pytest.mark.parametrize("sides", FITTING)
def test_fitting_units_pass(sides: Sides) -> None:
    check_equation(sides)


MISFITS: list[tuple[Sides, str]] = [
    (lambda c: (c.v, c.i), "'=' joins V and A"),
    (lambda c: (c.v, c.R * c.i + 1), "'+' joins V and 1"),
    (lambda c: (c.v, c.v2 - c.i), "'-' joins V and A"),
    (lambda c: (c.v, 5), "'=' joins V and 1"),  # a constant with a dimension must be a parameter
    (lambda c: (c.C * c.der(c.v), c.v), "'=' joins A and"),
    (lambda c: (c.C * c.v, c.i), "'=' joins A*s and A"),  # der() forgotten
    (lambda c: (c.pitch, c.angle), "'=' joins deg and 1"),
    (lambda c: (c.x, ca.sin(c.pitch)), "a function of deg"),
    (lambda c: (c.x, ca.cos(c.pitch + c.angle)), "'+' joins deg and 1"),
    (lambda c: (c.pitch, ca.atan2(c.v, c.v2)), "'=' joins deg and 1"),
    (lambda c: (c.x, ca.atan2(c.v, c.i)), "atan2 joins V and A"),
    (lambda c: (c.x, ca.exp(c.v)), "a function of V"),
    (lambda c: (c.x, ca.log(c.i)), "a function of A"),
    (lambda c: (c.x, ca.tan(c.w)), "a function of 1/s"),
    (lambda c: (c.x, c.v**c.n), "a function of V"),  # the unit would depend on the value of n
    (lambda c: (c.x, 2**c.v), "a function of V"),
    (lambda c: (c.v, ca.sqrt(c.v2)), "'=' joins V and m*kg^1/2"),
    (lambda c: (c.v, c.v2**2), "'=' joins"),
    (lambda c: (c.v, 1 / c.v2), "'=' joins"),
    (lambda c: (c.v, ca.hypot(c.v2, c.i)), "'hypot' joins V and A"),
    (lambda c: (c.v, limit(c.v2, -1, 1)), "'max' joins V and 1"),
    (lambda c: (c.v, maximum(c.v2, c.i)), "'max' joins V and A"),
    (lambda c: (c.v, minimum(c.v2, c.i)), "'min' joins V and A"),
    (lambda c: (c.v, dead_band(c.v2, c.T)), "joins"),
    (lambda c: (c.i, c.d), "'=' joins A and V"),
    (lambda c: (c.v, table2(c.cp, c.x, c.pitch)), "'=' joins V and 1"),
    (lambda c: (c.x, table2(c.cp, c.w, c.pitch)), "the table's x joins 1/s and 1"),
    (lambda c: (c.x, table2(c.cp, c.x, c.angle)), "the table's y joins 1 and deg"),
    (lambda c: (c.x, table2(c.cp, table2(c.cp, c.w, c.pitch), c.pitch)), "the table's x joins 1/s and 1"),
    (lambda c: (c.x, 1 + table2(c.cp, c.x + c.v, c.pitch)), "'+' joins 1 and V"),
    (lambda c: (c.x, c.u), "'=' joins 1 and m*s^-1"),
]


@pytest.mark.parametrize(("sides", "message"), MISFITS)
def test_misfits_are_named(sides: Sides, message: str) -> None:
    with pytest.raises(GustformError) as refusal:
        check_equation(sides)
    assert refusal.value.code == "GF1020"
    assert message in str(refusal.value)


class Misfit(Component):
    v = Variable("V", "a voltage")
    i = Variable("A", "a current")

    def equations(self) -> None:
        self.eq(self.v, 0)
        self.eq(
            self.i,
            2 * self.v,
        )


def test_the_message_has_file_line_and_text_of_the_equation() -> None:
    lines, first = inspect.getsourcelines(Misfit)
    line = first + next(k for k, text in enumerate(lines) if text.strip() == "self.eq(")
    with pytest.raises(GustformError) as refusal:
        check_units(elaborate(Misfit()))
    place = refusal.value.place
    assert place is not None
    assert (Path(place.file).name, place.line) == (Path(__file__).name, line)
    assert str(refusal.value).startswith(f"{place.file}:{line}: error GF1020: ")
    assert "i = 2 * v" in str(refusal.value)  # written over several lines, shown on one


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        (lambda c: c.when(c.v > c.i, {c.d: c.v}), "'<' joins A and V"),
        (lambda c: c.when(ca.logic_and(c.v > c.band, c.x > c.T), {c.d: c.v}), "'<' joins s and 1"),
        (lambda c: c.when(c.v > c.band, {c.d: c.i}), "'=' joins V and A"),
        (lambda c: c.when(c.v > c.band, reinit={c.v: c.x}), "'=' joins V and 1"),
        (lambda c: c.when(table2(c.cp, c.v, c.pitch) > 0.4, {c.d: c.v}), "the table's x"),
        (lambda c: c.sample(c.T, {c.d: c.x}), "'=' joins V and 1"),
        (lambda c: c.sample(c.n, {c.d: c.v}), "the sample period joins 1 and s"),
        (lambda c: c.initial(c.v, c.R), "'=' joins V and ohm"),
    ],
)
def test_events_and_initial_equations_are_checked_too(statement: Callable[[Any], None], message: str) -> None:
    with pytest.raises(GustformError, match="GF1020") as refusal:
        check(statement)
    assert message in str(refusal.value)


def test_events_with_fitting_units_pass() -> None:
    def statements(c: Any) -> None:
        c.eq(c.T * c.der(c.v), c.band - c.v)
        c.when(ca.logic_or(c.v > c.band, ca.logic_not(c.x > 1)), {c.d: c.v + c.band}, reinit={c.v: 0})
        c.sample(c.T, {c.d: c.R * c.i})
        c.initial(c.v, c.R * c.i)

    check(statements)


def test_a_symbol_of_nobody_is_refused() -> None:
    with pytest.raises(GustformError, match=r"GF1019.*stranger") as refusal:
        check_equation(lambda c: (c.x, ca.SX.sym("stranger")))
    assert refusal.value.place is not None

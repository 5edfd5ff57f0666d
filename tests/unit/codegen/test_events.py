"""Zero-crossing functions: conditions of when-clauses, bends of limiters, reinit of states under any name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gustform.language import (
    Component,
    Discrete,
    GustformError,
    Input,
    Output,
    Parameter,
    Part,
    Table,
    Variable,
    dead_band,
    limit,
    maximum,
    minimum,
    table2,
)
from gustform_codegen.flatten import flatten
from gustform_codegen.unit_type import UnitType


class Events(Component):
    x = Variable("1", "a state")
    y = Output("1", "an output that is explicit")
    m = Output("1", "the state with the other sign")
    a = Parameter("1", "a threshold", default=1.0)
    b = Parameter("1", "another", default=2.0)
    T = Parameter("s", "a time", default=0.5)
    u = Input("1", "an input")
    d = Discrete("1", "a kept value", start=3.0)
    e = Discrete("1", "another kept value")
    cp = Table("1", "1", "1", "a table")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), self.u - self.x)
        self.eq(self.y, 2 * self.x + self.u)
        self.eq(self.m, -self.x)


def with_events(statement: Callable[[Any], object]) -> UnitType:
    def equations(self: Any) -> None:
        Events.equations(self)
        statement(self)

    return flatten(type("Case", (Events,), {"equations": equations})())


def at(unit: UnitType, expressions: list[Any], **values: float) -> list[float]:
    """Numbers of expressions where x, u, d, e, a, b, T have these values."""
    symbols = [*(u.symbol for u in unit.unknowns), *(s.symbol for s in (*unit.inputs, *unit.discretes))]
    symbols += [p.symbol for p in unit.parameters]
    numbers = [values.get(str(s), {"a": 1.0, "b": 2.0, "T": 0.5}.get(str(s), 0.0)) for s in symbols]
    function = ca.Function("f", [ca.vertcat(*symbols)], [ca.vertcat(*expressions)])
    return list(np.array(function(numbers)).ravel())


# ---- conditions ----

COMPARISONS: list[tuple[Callable[[Any], Any], Callable[[float, float], bool]]] = [
    (lambda c: c.x > c.a, lambda x, u: x > 1),
    (lambda c: c.x < c.b, lambda x, u: x < 2),
    (lambda c: c.y >= c.b, lambda x, u: 2 * x + u >= 2),  # an explicit variable, substituted
    (lambda c: c.m <= 0, lambda x, u: -x <= 0),  # an alias with a sign
    (lambda c: c.u > c.x, lambda x, u: u > x),
    (lambda c: c.u < 0.5, lambda x, u: u < 0.5),
]
conditions = st.recursive(
    st.sampled_from(COMPARISONS),
    lambda inner: st.one_of(
        st.tuples(inner, inner).map(
            lambda p: (lambda c: ca.logic_and(p[0][0](c), p[1][0](c)), lambda x, u: p[0][1](x, u) and p[1][1](x, u))
        ),
        st.tuples(inner, inner).map(
            lambda p: (lambda c: ca.logic_or(p[0][0](c), p[1][0](c)), lambda x, u: p[0][1](x, u) or p[1][1](x, u))
        ),
        inner.map(lambda q: (lambda c: ca.logic_not(q[0](c)), lambda x, u: not q[1](x, u))),
    ),
    max_leaves=4,
)
numbers = st.floats(-3.0, 3.0)


@settings(max_examples=40)
@given(conditions, st.lists(st.tuples(numbers, numbers), min_size=5, max_size=5))
def test_the_root_is_positive_where_the_condition_holds(condition: Any, points: list[tuple[float, float]]) -> None:
    symbolic, truth = condition
    unit = with_events(lambda c: c.when(symbolic(c), {c.d: 1}))
    assert [r.kind for r in unit.roots] == [1]
    assert (unit.whens[0].root, unit.whens[0].period) == (0, -1)
    for x, u in points:
        (value,) = at(unit, [unit.roots[0].expression], x=x, u=u)
        assume(abs(value) > 1e-12)  # exactly on the edge either answer will do
        assert (value > 0) == truth(x, u)


def test_the_root_is_continuous() -> None:
    unit = with_events(lambda c: c.when(ca.logic_and(c.x > c.a, c.u < c.b), {c.d: 1}))
    line = [at(unit, [unit.roots[0].expression], x=x, u=1.0)[0] for x in np.linspace(-3, 3, 601)]
    assert np.max(np.abs(np.diff(line))) <= 0.01 + 1e-12  # slope at most one: no jump


@pytest.mark.parametrize(
    "condition",
    [
        lambda c: c.x,
        lambda c: c.d,
        lambda c: ca.eq(c.x, c.a),
        lambda c: ca.ne(c.x, c.a),
        lambda c: ca.logic_and(c.x > c.a, c.d),
        lambda c: (c.x > c.a) + (c.u > c.b),
        lambda c: True,
    ],
)
def test_conditions_that_are_no_comparison(condition: Callable[[Any], Any]) -> None:
    with pytest.raises(GustformError) as refusal:
        with_events(lambda c: c.when(condition(c), {c.d: 1}))
    assert refusal.value.code == "GF1017"
    assert "test_events.py" in str(refusal.value)


# ---- what a clause sets ----


def test_assignments_and_reinit() -> None:
    unit = with_events(lambda c: c.when(c.x > c.a, {c.d: c.e + c.y, c.e: c.d}, reinit={c.x: c.m * c.b}))
    clause = unit.whens[0]
    assert [unit.discretes[k].path for k, _ in clause.assign] == ["d", "e"]
    assert [unit.unknowns[k].path for k, _ in clause.reinit] == ["x"]
    values = at(unit, [v for _, v in clause.assign + clause.reinit], x=1.5, u=0.25, d=7.0, e=11.0)
    assert values == [11.0 + 2 * 1.5 + 0.25, 7.0, -3.0]


def test_reinit_under_an_alias_with_either_sign() -> None:
    unit = with_events(lambda c: c.when(c.x > c.a, reinit={c.m: c.b + c.x}))
    # m = -x, so setting m to b + x sets x to -(b + x).
    assert [unit.unknowns[k].path for k, _ in unit.whens[0].reinit] == ["x"]
    assert at(unit, [unit.whens[0].reinit[0][1]], x=3.0) == [-5.0]


def test_reinit_of_what_is_no_state() -> None:
    with pytest.raises(GustformError, match=r"GF1016.*reinit needs a state; y is none"):
        with_events(lambda c: c.when(c.x > c.a, reinit={c.y: 0}))


def test_sampled_blocks_know_their_period() -> None:
    unit = with_events(lambda c: c.sample(c.T, {c.d: c.d + c.x}))
    assert unit.roots == []
    assert unit.whens[0].root == -1
    assert unit.parameters[unit.whens[0].period].path == "T"
    with pytest.raises(GustformError, match=r"GF1015.*the sample period must be a parameter"):
        with_events(lambda c: c.sample(2 * c.T, {c.d: 1}))


def test_clauses_of_parts_carry_their_path() -> None:
    class Part1(Events):
        def equations(self) -> None:
            super().equations()
            self.when(self.x > self.a, {self.d: self.e})

    class Whole(Component):
        one = Part(Part1, "one")
        two = Part(Part1, "two", a=5.0)
        u = Input("1", "input")

        def equations(self) -> None:
            self.connect(self.u, self.one.u)
            self.connect(self.u, self.two.u)

    unit = flatten(Whole())
    assert [w.text.split(" (")[0] for w in unit.whens] == ["one: x > a: {d: e}", "two: x > a: {d: e}"]
    assert [unit.discretes[w.assign[0][0]].path for w in unit.whens] == ["one.d", "two.d"]
    assert [w.root for w in unit.whens] == [0, 1]


def test_a_table_in_a_condition() -> None:
    unit = with_events(lambda c: c.when(table2(c.cp, c.y, c.u) > c.a, {c.d: table2(c.cp, c.x, c.d)}))
    assert len(unit.calls) == 2


# ---- bends ----


def bends(expression: Callable[[Any], Any]) -> UnitType:
    class Bent(Component):
        x = Variable("1", "a state")
        T = Parameter("s", "a time", default=1.0)
        a = Parameter("1", "a bound", default=1.0)
        u = Input("1", "an input")
        cp = Table("1", "1", "1", "a table")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), expression(self))

    return flatten(Bent())


@pytest.mark.parametrize(
    ("expression", "places"),
    [
        (lambda c: maximum(c.x, c.a), [1.0]),  # bends at x = a = 1
        (lambda c: minimum(2 * c.x, 3), [1.5]),
        (lambda c: ca.fabs(c.x - 2), [2.0]),
        (lambda c: limit(c.x, -c.a, c.a), [-1.0, 1.0]),
        (lambda c: dead_band(c.x, c.a), [-1.0, 1.0]),
        (lambda c: limit(c.x, 0, c.a) * 2 + ca.sin(limit(c.x, 0, c.a)), [0.0, 1.0]),  # the same limiter twice
        (lambda c: ca.sin(c.x) + c.u, []),
        (lambda c: table2(c.cp, limit(c.x, 0, 2), c.u), [0.0, 2.0]),  # inside the argument of a table
    ],
)
def test_bends_are_roots_of_kind_0(expression: Callable[[Any], Any], places: list[float]) -> None:
    unit = bends(expression)
    assert [r.kind for r in unit.roots] == [0] * len(places)
    h = 1e-6
    found = []
    for root in unit.roots:
        for place in places:
            below, above = (at(unit, [root.expression], x=place + sign * h)[0] for sign in (-1, 1))
            if below * above < 0:
                found.append(place)
                assert abs(above - below) < 1e-4  # through zero, not over it
    assert sorted(found) == places


def test_bends_of_flows_and_of_explicit_variables_count_once() -> None:
    def twice(c: Any) -> Any:
        limited = limit(c.x, -1, c.a)
        return limited + 2 * limited

    assert len(bends(twice).roots) == 2


def test_bends_come_after_conditions() -> None:
    class Both(Events):
        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), limit(self.u, 0, 1) - self.x)
            self.eq(self.y, self.x + self.u)
            self.eq(self.m, -self.x)
            self.when(self.x > self.a, {self.d: 1})

    assert [r.kind for r in flatten(Both()).roots] == [1, 0, 0]

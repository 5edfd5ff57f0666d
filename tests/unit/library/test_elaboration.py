"""From a component to its symbols and statements: what is collected, from where, and what is refused."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import casadi as ca
import pytest

from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, Discrete, GustformError, Input, Output, Parameter, Part, Variable, table2
from gustform.language.scope import Elaborated, elaborate


class Inner(Component):
    R = Parameter("ohm", "resistance", default=2.0)
    mode = Parameter("1", "structural", default=1, structural=True)
    v = Variable("V", "voltage")
    d = Discrete("V", "kept voltage")
    pin = DcPort("pin")

    def equations(self) -> None:
        self.eq(self.v, self.R * self.pin.i)
        for _ in range(self.mode):
            self.eq(self.pin.v, self.v)


class Outer(Component):
    u = Input("A", "current to be drawn")
    y = Output("V", "what is measured")
    pin = DcPort("outer pin")
    ac = AcPort("another kind")
    a = Part(Inner, "first")
    b = Part(Inner, "second", mode=2)

    def equations(self) -> None:
        self.connect(self.pin, self.a.pin)
        self.connect(self.a.pin, self.b.pin)
        self.eq(self.y, self.a.v + self.der(self.b.v) * self.b.R / self.a.R)
        self.connect(self.u, self.b.pin.i)


def test_symbols_have_paths_kinds_and_owners() -> None:
    outer = Outer()
    e = elaborate(outer)
    kinds = {s.path: s.kind for s in e.symbols.values()}
    assert {p: k for p, k in kinds.items() if p.startswith(("u", "y", "pin"))} == {
        "u": "input", "y": "output", "pin.v": "potential", "pin.i": "flow",
    }  # fmt: skip
    assert {p: k for p, k in kinds.items() if p.startswith("b.")} == {
        "b.R": "parameter", "b.v": "variable", "b.d": "discrete", "b.pin.v": "potential", "b.pin.i": "flow",
    }  # fmt: skip
    symbol = e.by_path("b.pin.i")
    assert symbol is not None
    assert symbol.owner.path == "b"
    assert symbol.unit == "A"
    assert e.by_path("b.mode") is None  # a structural parameter is a plain value
    assert e.by_path("nothing") is None


def test_equations_come_once_per_part_with_their_source_text() -> None:
    e = elaborate(Outer())
    lines, first = inspect.getsourcelines(Inner.equations)
    at = {text.strip(): first + k for k, text in enumerate(lines)}
    shown = [(eq.path, eq.source.line, eq.source.text) for eq in e.equations]
    v, pin = at["self.eq(self.v, self.R * self.pin.i)"], at["self.eq(self.pin.v, self.v)"]
    assert shown[:5] == [
        ("a", v, "v = R * pin.i"),
        ("a", pin, "pin.v = v"),
        ("b", v, "v = R * pin.i"),
        ("b", pin, "pin.v = v"),
        ("b", pin, "pin.v = v"),  # mode = 2: the structural parameter shapes the equations
    ]
    assert shown[5][2] == "y = a.v + der(b.v) * b.R / a.R"
    assert shown[6][2] == "u = b.pin.i"  # connecting signals is an equation
    assert str(e.equations[0]) == f"a: v = R * pin.i (test_elaboration.py:{v})"
    assert [(a.path, b.path) for a, b, _, _ in e.connections] == [("pin", "a.pin"), ("a.pin", "b.pin")]
    assert len(e.derivatives) == 1


def test_elaborating_leaves_the_component_as_it_was() -> None:
    outer = Outer()
    first, second = elaborate(outer), elaborate(outer)
    assert outer.a.R == 2.0  # still a number
    assert set(first.symbols).isdisjoint(second.symbols)
    assert [str(e) for e in first.equations] == [str(e) for e in second.equations]


class Scratch(Component):
    """Something to state things about."""

    x = Variable("1", "a number")
    y = Output("1", "an output")
    u = Input("1", "an input")
    p = Parameter("1", "a parameter", default=1.0)
    T = Parameter("s", "a period", default=1.0)
    d = Discrete("1", "a discrete value")
    pin = DcPort("a port")
    other = DcPort("another")
    ac = AcPort("a port of another type")


def state(statement: Callable[[Any], object]) -> Elaborated:
    return elaborate(type("Case", (Scratch,), {"equations": statement})())


@pytest.mark.parametrize(
    ("code", "statement", "message"),
    [
        ("GF1012", lambda c: c.eq(c.x, "text"), "'text' is not an expression"),
        ("GF1012", lambda c: c.eq(c.x, None), "None is not an expression"),
        ("GF1012", lambda c: c.eq(c.pin, c.other), "is not an expression"),
        ("GF1012", lambda c: c.eq(ca.vertcat(c.x, c.y), 0), "equations are scalar; got (2, 1)"),
        ("GF1006", lambda c: c.eq(c.pin.u, 0), "DcPort has no quantity 'u' (port pin) — try v or i"),
        ("GF1013", lambda c: c.der(2 * c.x), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.x**2), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.p), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.u), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.d), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.pin.i), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(3.0), "der() takes a declared variable"),
        ("GF1013", lambda c: c.der(c.der(c.x)), "der() takes a declared variable"),
        ("GF1014", lambda c: c.when(c.x > 1, {c.x: 0}), "x cannot be set here: not a discrete"),
        ("GF1014", lambda c: c.when(c.x > 1, reinit={c.d: 0}), "d cannot be set here: not a variable"),
        ("GF1014", lambda c: c.when(c.x > 1, reinit={2 * c.x: 0}), "cannot be set here"),
        ("GF1014", lambda c: c.sample(c.T, {c.p: 0}), "p cannot be set here: not a discrete"),
        ("GF1014", lambda c: c.when(c.x > 1, {"d": 0}), "d cannot be set here"),
        ("GF3001", lambda c: c.connect(c.pin, c.ac), "cannot connect pin (DcPort) to ac (AcPort)"),
        ("GF3001", lambda c: c.connect(c.pin, c.x), "a port to a signal"),
        ("GF1002", lambda c: setattr(c, "x", 2), "cannot be assigned"),
        ("GF1010", lambda c: table2(c.p, c.x, c.y), "table2 takes a declared Table"),
    ],
)
def test_statements_refused(code: str, statement: Callable[[Any], object], message: str) -> None:
    with pytest.raises(GustformError) as refusal:
        state(statement)
    assert refusal.value.code == code
    assert message in str(refusal.value)


def test_statements_refused_name_the_line() -> None:
    with pytest.raises(GustformError, match=r"in 2 \* c\.x \(test_elaboration\.py:\d+\)"):
        state(lambda c: c.der(2 * c.x))


def test_one_derivative_symbol_for_each_variable() -> None:
    def statements(c: Any) -> None:
        c.eq(c.der(c.x) + c.der(c.y), c.der(c.x) * 2)

    assert len(state(statements).derivatives) == 2


def test_when_and_sampled_are_collected() -> None:
    def statements(c: Any) -> None:
        c.when(
            ca.logic_and(c.x > 1, c.y < 2),
            {
                c.d: c.x,
            },
            reinit={c.x: 0, c.y: c.d},
        )
        c.sample(c.T, {c.d: c.d + 1})

    when, sampled = state(statements).whens
    assert [str(t) for t, _ in when.assign] == ["d"]
    assert [(str(t), str(v)) for t, v in when.reinit] == [("x", "0"), ("y", "d")]
    assert when.period is None
    assert sampled.condition is None
    assert str(sampled.period) == "T"
    # Written over several lines, shown on one.
    assert when.source.text == "logic_and(c.x > 1, c.y < 2): {c.d: c.x}, reinit={c.x: 0, c.y: c.d}"

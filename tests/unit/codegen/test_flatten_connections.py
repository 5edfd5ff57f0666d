"""Connections inside a unit: potentials, signs of flows at every level, three and more ports, ports left open."""

from __future__ import annotations

from typing import Any

import pytest

from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, GustformError, Parameter, Part, Variable
from gustform_codegen.flatten import flatten
from tests.unit.codegen.circuits import Ground, Load, Resistor
from tests.unit.codegen.numeric import assert_solves, solved_point


class Parallel(Component):
    p = DcPort("positive")
    n = DcPort("negative")
    a = Part(Resistor, "first", R=3.0)
    b = Part(Resistor, "second", R=6.0)

    def equations(self) -> None:
        self.connect(self.p, self.a.p)
        self.connect(self.p, self.b.p)
        self.connect(self.n, self.a.n)
        self.connect(self.b.n, self.n)


class Series(Component):
    p = DcPort("positive")
    n = DcPort("negative")
    first = Part(Parallel, "first pair")
    second = Part(Parallel, "second pair")

    def equations(self) -> None:
        self.connect(self.p, self.first.p)
        self.connect(self.first.n, self.second.p)
        self.connect(self.second.n, self.n)


class ThreeDeep(Component):
    p = DcPort("positive")
    n = DcPort("negative")
    left = Part(Series, "one branch")
    right = Part(Series, "another, the other way round")

    def equations(self) -> None:
        self.connect(self.p, self.left.p)
        self.connect(self.left.p, self.right.n)
        self.connect(self.left.n, self.n)
        self.connect(self.n, self.right.p)


@pytest.mark.parametrize(
    ("kind", "resistance"),
    [
        (Parallel, 2.0),  # 3 and 6 ohm in parallel
        (Series, 4.0),  # two of these in series
        (ThreeDeep, 2.0),  # two of those in parallel
    ],
)
def test_nested_resistors(kind: type[Component], resistance: float) -> None:
    unit = flatten(kind())
    assert unit.unknowns == []  # everything is explicit: the solver sees none of it
    point = solved_point(unit, kind(), given={"p.v": 7.0, "n.v": 1.0})
    # Flows are positive into the component: what goes in at p comes out at n.
    assert point["p.i"] == pytest.approx(6.0 / resistance, rel=1e-12)
    assert point["n.i"] == pytest.approx(-6.0 / resistance, rel=1e-12)
    assert_solves(kind(), point)


def test_flows_at_every_level_of_three() -> None:
    component = ThreeDeep()
    point = solved_point(flatten(component), component, given={"p.v": 7.0, "n.v": 1.0})
    # 1.5 A through each branch; the 3 ohm resistor of a pair takes two thirds of it. `right` hangs the other way
    # round, so the current enters it at its n.
    assert point["left.p.i"] == pytest.approx(1.5)
    assert point["right.p.i"] == pytest.approx(-1.5)
    assert point["left.first.a.p.i"] == pytest.approx(1.0)
    assert point["left.first.a.n.i"] == pytest.approx(-1.0)
    assert point["right.second.b.p.i"] == pytest.approx(-0.5)
    assert point["left.first.n.v"] == pytest.approx(4.0)  # half way from 7 to 1 V
    assert point["right.second.a.n.v"] == pytest.approx(7.0)


class Star(Component):
    """Three resistors that meet at a centre: three ports in one connection set, written as a chain."""

    a = DcPort("a")
    b = DcPort("b")
    c = DcPort("c")
    ra = Part(Resistor, "a", R=1.0)
    rb = Part(Resistor, "b", R=2.0)
    rc = Part(Resistor, "c", R=4.0)

    def equations(self) -> None:
        self.connect(self.a, self.ra.p)
        self.connect(self.b, self.rb.p)
        self.connect(self.c, self.rc.p)
        self.connect(self.ra.n, self.rb.n)
        self.connect(self.rb.n, self.rc.n)


class StarInARing(Star):
    """The same set, with connections that say nothing new: a closed ring and one written twice."""

    def equations(self) -> None:
        super().equations()
        self.connect(self.rc.n, self.ra.n)
        self.connect(self.rb.n, self.ra.n)
        self.connect(self.a, self.ra.p)


@pytest.mark.parametrize("kind", [Star, StarInARing])
def test_three_ports_in_one_set(kind: type[Component]) -> None:
    point = solved_point(flatten(kind()), kind(), given={"a.v": 7.0, "b.v": 0.0, "c.v": 0.0})
    # Millman: centre = (7/1) / (1/1 + 1/2 + 1/4) = 4 V.
    assert point["ra.n.v"] == pytest.approx(4.0)
    assert [point[f"{p}.i"] for p in "abc"] == pytest.approx([3.0, -2.0, -1.0])
    assert_solves(kind(), point)


class Wire(Component):
    """Its two own ports connected: what goes in at one comes out at the other."""

    a = DcPort("one end")
    b = DcPort("other end")

    def equations(self) -> None:
        self.connect(self.a, self.b)


class Cable(Component):
    a = DcPort("one end")
    b = DcPort("other end")
    wire = Part(Wire, "a wire")
    r = Part(Resistor, "its resistance", R=0.5)

    def equations(self) -> None:
        self.connect(self.a, self.wire.a)
        self.connect(self.wire.b, self.r.p)
        self.connect(self.r.n, self.b)


def test_a_wire_between_its_own_ports() -> None:
    unit = flatten(Wire())
    assert len(unit.rows) == 1
    assert [x.path for x in unit.externals] == ["a.v", "b.v"]
    point = solved_point(unit, Wire(), given={"a.v": 2.0})
    assert point["b.v"] == pytest.approx(2.0)
    assert point["a.i"] == pytest.approx(-point["b.i"])
    point = solved_point(flatten(Cable()), Cable(), given={"a.v": 2.0, "b.v": 1.0})
    assert point["a.i"] == pytest.approx(2.0)
    assert point["wire.b.i"] == pytest.approx(-2.0)  # into the wire at b


class TwoQuantities(Component):
    """A connector with two potentials: each flow belongs to the potential of its place."""

    g = Parameter("S", "conductance of the real part", default=2.0)
    h = Parameter("S", "conductance of the imaginary part", default=3.0)
    ac = AcPort("terminal")

    def equations(self) -> None:
        self.eq(self.ac.ir, self.g * self.ac.vr)
        self.eq(self.ac.ii, self.h * self.ac.vi)


class Wrapped(Component):
    ac = AcPort("terminal")
    one = Part(TwoQuantities, "one")
    two = Part(TwoQuantities, "another", g=5.0)

    def equations(self) -> None:
        self.connect(self.one.ac, self.two.ac)
        self.connect(self.ac, self.one.ac)


def test_connectors_with_two_quantities() -> None:
    unit = flatten(Wrapped())
    assert [(f.path, f.potential) for f in unit.flows] == [("ac.ir", "ac.vr"), ("ac.ii", "ac.vi")]
    point = solved_point(unit, Wrapped(), given={"ac.vr": 1.0, "ac.vi": 10.0})
    assert point["ac.ir"] == pytest.approx(7.0)  # (2 + 5) * 1
    assert point["ac.ii"] == pytest.approx(60.0)  # (3 + 3) * 10


def test_an_inner_port_left_open_is_refused() -> None:
    class Open(Component):
        r = Part(Resistor, "resistor")
        ground = Part(Ground, "ground")

        def equations(self) -> None:
            self.connect(self.r.n, self.ground.pin)

    with pytest.raises(GustformError) as refusal:
        flatten(Open())
    assert refusal.value.code == "GF3003"
    assert str(refusal.value).startswith("error GF3003: Open: port r.p (positive pin) is not connected")
    assert "self.connect(self.r.p, ...)" in refusal.value.hint


def test_an_optional_inner_port_left_open_carries_no_flow() -> None:
    class Tap(Component):
        a = DcPort("main")
        tap = DcPort("tap", optional=True)

        def equations(self) -> None:
            self.eq(self.a.v, 2.0 * self.tap.v)
            self.eq(self.tap.i, -2.0 * self.a.i)

    class Whole(Component):
        inner = Part(Tap, "has a tap")
        pin = DcPort("terminal")
        load = Part(Load, "a load")

        def equations(self) -> None:
            self.connect(self.pin, self.inner.a)
            self.connect(self.pin, self.load.pin)

    point = solved_point(flatten(Whole()), Whole(), given={"pin.v": 4.0})
    assert point["inner.tap.i"] == 0.0
    assert point["inner.tap.v"] == pytest.approx(2.0)
    assert point["pin.i"] == pytest.approx(2.0)  # 4 V over the load's 2 ohm


def test_a_port_connected_to_itself_carries_no_flow() -> None:
    class Own(Component):
        r = Part(Resistor, "resistor")
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.connect(self.pin, self.r.p)
            self.connect(self.r.n, self.r.n)

    point = solved_point(flatten(Own()), Own())
    assert point["r.n.i"] == 0.0
    assert point["pin.i"] == pytest.approx(0.0)


def test_a_boundary_port_counts_with_its_own_sign_in_equations() -> None:
    class Meter(Component):
        i = Variable("A", "what flows into the unit")
        pin = DcPort("terminal")
        load = Part(Load, "a load", R=4.0)

        def equations(self) -> None:
            self.connect(self.pin, self.load.pin)
            self.eq(self.i, self.pin.i)

    point = solved_point(flatten(Meter()), Meter(), given={"pin.v": 2.0})
    assert point["i"] == point["load.pin.i"] == pytest.approx(0.5)


def test_signals_connected_between_parts() -> None:
    class Source(Component):
        y = Variable("1", "signal")

        def equations(self) -> None:
            self.eq(self.y, 3.0)

    class Sink(Component):
        u: Any = Variable("1", "signal")

    class Whole(Component):
        a = Part(Source, "gives")
        b = Part(Sink, "takes")

        def equations(self) -> None:
            self.connect(self.a.y, self.b.u)

    unit = flatten(Whole())
    point = solved_point(unit, Whole())
    assert point["b.u"] == 3.0
    assert unit.unknowns == []

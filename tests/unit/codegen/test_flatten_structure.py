"""What flattening makes of equations: aliases, states, explicit algebra, loops, and refusals that name the guilty."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gustform.interfaces import DcPort
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
    limit,
    quantity,
    table2,
)
from gustform.language.table import TableData
from gustform_codegen.flatten import flatten
from gustform_codegen.unit_type import UnitType
from tests.unit.codegen.circuits import Capacitor, Ground, IdealSource, Ladder, Resistor, Storage, VoltageSource
from tests.unit.codegen.numeric import assert_solves, solved_point


class Numbers(Component):
    """Plain variables to write equations about."""

    a = Variable("1", "a")
    b = Variable("1", "b")
    c = Variable("1", "c")
    e = Variable("1", "e")
    f = Variable("1", "f")
    p = Parameter("1", "a parameter", default=3.0)
    T = Parameter("s", "a time", default=0.5)
    u = Input("1", "an input")


def unit_of(*names: str, base: type[Component] = Numbers) -> Callable[[Callable[[Any], None]], type[Component]]:
    """A decorator: a component with `base`'s declarations of these names only, and the function as its equations."""

    def build(equations: Callable[[Any], None]) -> type[Component]:
        members = {name: copy.copy(d) for name, d in base.declarations().items() if name in names}
        return type("Case", (Component,), {**members, "equations": equations})

    return build


def refused(code: str, kind: type[Component]) -> str:
    with pytest.raises(GustformError) as refusal:
        flatten(kind())
    assert refusal.value.code == code, str(refusal.value)
    return str(refusal.value)


def paths(unit: UnitType) -> list[str]:
    return [u.path for u in unit.unknowns]


# ---- aliases ----


def test_aliases_with_signs_and_chains() -> None:
    @unit_of("a", "b", "c", "e", "f", "T")
    def Chain(self: Any) -> None:
        self.eq(self.a, self.b)
        self.eq(self.b, -self.c)
        self.eq(-self.c, self.e)
        self.eq(self.f + self.e, 0)
        self.eq(self.T * self.der(self.c), -self.f)

    unit = flatten(Chain())
    assert paths(unit) == ["c"]  # the state stands for the whole set
    assert unit.aliases == {"a": ("c", -1), "b": ("c", -1), "e": ("c", -1), "f": ("c", 1)}
    assert unit.recorded == []
    assert_solves(Chain(), solved_point(unit, Chain()))


def test_the_derivative_of_an_alias_is_that_of_the_state() -> None:
    @unit_of("a", "b", "T")
    def Both(self: Any) -> None:
        self.eq(self.a, -self.b)
        self.eq(self.T * self.der(self.a), self.b + 1)  # via one name

    unit = flatten(Both())
    assert unit.n_states == 1
    assert_solves(Both(), solved_point(unit, Both()))


def test_an_alias_of_the_outside_reads_the_outside() -> None:
    class Measured(Component):
        v = Output("V", "terminal voltage")
        minus = Output("V", "with the other sign")
        w = Output("1", "input as it is")
        u = Input("1", "input")
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.v, self.pin.v)
            self.eq(self.minus, -self.v)
            self.eq(self.w, self.u)
            self.eq(self.pin.i, 0)

    unit = flatten(Measured())
    assert unit.unknowns == []
    assert unit.aliases == {"v": ("pin.v", 1), "minus": ("pin.v", -1), "w": ("u", 1)}
    assert [s.path for s in unit.inputs] == ["u"]
    # Wired to another unit, the same input is an external value instead.
    wired = flatten(Measured(), signals=frozenset({"u"}))
    assert [x.path for x in wired.externals] == ["u", "pin.v"] or [x.path for x in wired.externals] == ["pin.v", "u"]
    assert wired.inputs == []


def test_equal_externals_are_a_row_not_an_alias() -> None:
    class Bar(Component):
        a = DcPort("a")
        b = DcPort("b")

        def equations(self) -> None:
            self.eq(self.a.v, self.b.v)
            self.eq(self.a.i + self.b.i, 0)

    unit = flatten(Bar())
    assert [r.text.split(" (")[0] for r in unit.rows] == ["a.v = b.v"]
    assert len(unit.unknowns) == 1  # one of the two currents
    assert_solves(Bar(), solved_point(unit, Bar()))


class Pole(Component):
    """A capacitor to ground."""

    C = Parameter("F", "capacitance", default=1.0)
    v = Variable("V", "voltage")
    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.v, self.pin.v)
        self.eq(self.C * self.der(self.v), self.pin.i)


class Inverse(Pole):
    """The same, its voltage counted the other way round."""

    def equations(self) -> None:
        self.eq(-self.v, self.pin.v)
        self.eq(self.C * self.der(self.v) + self.pin.i, 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_kept_start_stands_for_its_alias_set(sign: int) -> None:
    class Kept(Component):
        T = Parameter("s", "time", default=0.5)
        angle = Variable("1", "kept at the start", start=2.0, fixed=True)
        x = Variable("1", "what the differential equation is written in", start=7.0)
        pin = DcPort("terminal")
        volt = Parameter("V", "base", default=1.0)
        siemens = Parameter("S", "base", default=1.0)

        def equations(self) -> None:
            self.eq(self.angle, sign * self.x)
            self.eq(self.T * self.der(self.x), self.pin.v / self.volt - self.x)
            self.eq(self.pin.i, self.siemens * self.pin.v)

    unit = flatten(Kept())
    assert paths(unit) == ["angle"]
    assert unit.n_states == 1
    assert_solves(Kept(), solved_point(unit, Kept()))

    class AtTerminal(Component):
        """The same, but the state is the terminal's potential: it must not be merged with what is given there."""

        C = Parameter("F", "capacitance", default=0.5)
        v0 = Variable("V", "kept at the start", start=2.0, fixed=True)
        v = Variable("V", "voltage")
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.v0, sign * self.v)
            self.eq(self.v, self.pin.v)
            self.eq(self.C * self.der(self.v), self.pin.i)

    unit = flatten(AtTerminal())
    assert [u.path for u in unit.unknowns if u.der is not None] == ["v0"]
    assert_solves(AtTerminal(), solved_point(unit, AtTerminal()))


@pytest.mark.parametrize("second", [Pole(C=1.5), Inverse(C=1.5)])
def test_two_states_that_are_equal_become_one(second: Pole) -> None:
    class TwoCapacitors(Component):
        pin = DcPort("terminal")
        r = Part(Resistor, "series resistance", R=2.0)
        a = Part(Pole, "one", C=0.5)
        b = Part(Pole, "another")

        def equations(self) -> None:
            self.connect(self.pin, self.r.p)
            self.connect(self.r.n, self.a.pin)
            self.connect(self.r.n, self.b.pin)

    component = TwoCapacitors(b=second)
    unit = flatten(component)
    assert unit.n_states == 1
    assert len(unit.unknowns) == 1
    sign = -1 if isinstance(second, Inverse) else 1
    voltages = {"a.v": 4.0, "b.v": sign * 4.0}
    state = paths(unit)[0]
    point = solved_point(unit, component, given={"pin.v": 10.0, state: voltages[state]})
    # (10 - 4) V / 2 ohm = 3 A into 0.5 + 1.5 F: 1.5 V/s, a quarter of the current into the smaller one.
    assert point["der(a.v)"] == pytest.approx(1.5)
    assert point["der(b.v)"] == pytest.approx(sign * 1.5)
    assert point["a.pin.i"] == pytest.approx(0.75)
    assert point["b.pin.i"] == pytest.approx(2.25)
    assert_solves(component, point)


# ---- explicit algebra and loops ----


def test_explicit_algebra_never_reaches_the_solver() -> None:
    unit = flatten(Ladder())
    assert paths(unit) == ["store.v"]
    assert len(unit.rows) == 1
    point = solved_point(unit, Ladder(), given={"pin.v": 5.0, "store.v": 1.0})
    assert point["pin.i"] == pytest.approx(1.0)  # (5 - 1) V over twice 2 ohm
    assert point["second.p.v"] == pytest.approx(3.0)
    assert_solves(Ladder(), point)
    n_declared = unit.declared_equations
    assert len(unit.aliases) + unit.substituted + len(unit.rows) >= n_declared


def test_a_state_row_reads_derivative_minus_right_hand_side() -> None:
    # Solvers for explicit systems rely on it: the slope with respect to der is one.
    for kind in (Storage, Ladder):
        unit = flatten(kind())
        der: Any = unit.unknowns[0].der
        assert ca.jacobian(unit.rows[0].expression, der).is_one()


@pytest.mark.parametrize("n", [2, 3, 4])  # 4: three are left after tearing, the largest block solved by symbols
def test_linear_loops_are_solved(n: int) -> None:
    matrix = np.array([[4.0, 1.0, -2.0, 0.5], [2.0, -5.0, 1.0, 3.0], [1.0, 2.0, 6.0, -1.0], [2.5, 1.5, -3.0, 7.0]])
    matrix, names = matrix[:n, :n], "abce"[:n]

    @unit_of(*names, "u", "p")
    def Loop(self: Any) -> None:
        for row in range(n):
            total = sum(float(matrix[row, k]) * getattr(self, name) for k, name in enumerate(names))
            self.eq(total, self.u + row * self.p)

    unit = flatten(Loop())
    assert unit.unknowns == []
    assert unit.substituted == n
    point = solved_point(unit, Loop(), given={"u": 7.0})
    expected = np.linalg.solve(matrix, 7.0 + 3.0 * np.arange(n))
    assert [point[name] for name in names] == pytest.approx(expected.tolist(), rel=1e-12)


def test_a_larger_dense_linear_loop_is_torn_but_right() -> None:
    matrix = 5 * np.eye(5) + np.arange(25).reshape(5, 5) / 10

    @unit_of("a", "b", "c", "e", "f", "u")
    def Dense(self: Any) -> None:
        x = [self.a, self.b, self.c, self.e, self.f]
        for row in range(5):
            self.eq(sum(float(matrix[row, k]) * x[k] for k in range(5)), self.u)

    unit = flatten(Dense())
    assert 0 < len(unit.unknowns) < 5  # dense: all but one are iterated on
    point = solved_point(unit, Dense(), given={"u": 1.0})
    expected = np.linalg.solve(matrix, np.ones(5))
    assert [point[name] for name in "abcef"] == pytest.approx(expected.tolist(), rel=1e-9)


def test_coefficients_that_may_pass_through_zero_are_still_exact() -> None:
    class ConstantPower(Component):
        P = Parameter("W", "power taken", default=12.0)
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.pin.v * self.pin.i, self.P)

    point = solved_point(flatten(ConstantPower()), ConstantPower(), given={"pin.v": 4.0})
    assert point["pin.i"] == pytest.approx(3.0)


class Diode(Component):
    """A diode behind a resistance: one nonlinear loop of four variables."""

    V = Parameter("V", "source voltage", default=5.0)
    R = Parameter("ohm", "resistance", default=10.0)
    saturation = Parameter("A", "saturation current", default=1e-3)
    thermal = Parameter("V", "thermal voltage", default=0.5)
    v = Variable("V", "voltage over the diode", start=0.5)
    i = Variable("A", "current")
    drop = Variable("V", "voltage over the resistance")
    power = Variable("W", "power in the diode")

    def equations(self) -> None:
        self.eq(self.i, self.saturation * (ca.exp(self.v / self.thermal) - 1))
        self.eq(self.drop, self.R * self.i)
        self.eq(self.v + self.drop, self.V)
        self.eq(self.power, self.v * self.i)


def test_a_nonlinear_loop_is_torn_to_one_variable() -> None:
    unit = flatten(Diode())
    assert len(unit.unknowns) == len(unit.rows) == 1
    assert unit.substituted == 3
    point = solved_point(unit, Diode())
    low, high = 0.0, 5.0
    for _ in range(80):  # bisection: an independent solution of v + R i(v) = V
        v = (low + high) / 2
        low, high = (v, high) if v + 10.0 * 1e-3 * math.expm1(v / 0.5) < 5.0 else (low, v)
    assert point["v"] == pytest.approx(low, rel=1e-9)
    assert point["power"] == pytest.approx(low * (5.0 - low) / 10.0, rel=1e-9)
    assert_solves(Diode(), point)


def test_every_variable_can_be_kept_for_other_units() -> None:
    for name in ("v", "i", "drop", "power"):
        unit = flatten(Diode(), keep=frozenset({name}))
        assert name in paths(unit)
        assert len(unit.rows) == len(unit.unknowns)
        assert_solves(Diode(), solved_point(unit, Diode()))


def test_kept_aliases_are_unknowns_of_their_own() -> None:
    for name in ("soc", "minus", "seen"):
        unit = flatten(Storage(), keep=frozenset({name}))
        assert paths(unit) == ["v", name]
        point = solved_point(unit, Storage(), given={"pin.v": 3.0, "v": 1.25})
        assert point[name] == pytest.approx({"soc": 1.25, "minus": -1.25, "seen": 3.0}[name])
        assert_solves(Storage(), point)


# ---- connector potentials ----


def test_an_equation_that_fixes_a_potential_leaves_the_flow_to_the_solver() -> None:
    unit = flatten(IdealSource())
    assert paths(unit) == ["pin.i"]
    assert [str(r.expression) for r in unit.rows] == ["(pin.v-V)"]
    unit = flatten(VoltageSource())
    assert len(unit.unknowns) == 1
    point = solved_point(unit, VoltageSource(), given={"n.v": 1.0})
    assert point["p.v"] == pytest.approx(6.0)
    assert point["p.i"] == pytest.approx(-point["n.i"])
    assert_solves(VoltageSource(), point)


def test_a_state_at_a_terminal_stays_a_state() -> None:
    class Bare(Component):
        C = Parameter("F", "capacitance", default=0.5)
        v = Variable("V", "voltage")
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.v, self.pin.v)
            self.eq(self.C * self.der(self.v), self.pin.i)

    unit = flatten(Bare())
    assert unit.n_states == 1
    point = solved_point(unit, Bare(), given={"v": 3.0})
    assert point["pin.v"] == pytest.approx(3.0)
    assert point["pin.i"] == pytest.approx(0.5 * point["der(v)"])
    assert_solves(Bare(), point)


# ---- tables in loops ----

GRID = np.linspace(0.0, 4.0, 9)
CP = TableData(GRID, GRID, 1.0 + np.sin(GRID)[:, None] * np.exp(-0.2 * GRID)[None, :])


class WithTable(Component):
    cp = Table("1", "1", "1", "a table")
    a = Variable("1", "a", start=0.6)
    b = Variable("1", "b", start=0.3)
    u = Input("1", "input")


def check_table(equations: Any, iterated: int, **given: float) -> Any:
    kind = type("Case", (WithTable,), {"equations": equations})
    component = kind(cp=CP)
    unit = flatten(component)
    assert len(unit.unknowns) == iterated
    point = solved_point(unit, component, given={"u": 1.3, **given})
    assert_solves(component, point)
    return point


def test_a_table_of_known_arguments_is_explicit() -> None:
    def explicit(self: Any) -> None:
        self.eq(self.a, 2 * table2(self.cp, self.u, 0.5))
        self.eq(self.b, self.a + table2(self.cp, self.a / 4, self.u))  # through another look-up's value

    point = check_table(explicit, 0)
    assert point["a"] == pytest.approx(2 * CP.evaluate(np.array([1.3]), np.array([0.5]))[0][0])


def test_a_table_inside_a_loop_is_iterated_on() -> None:
    def loop(self: Any) -> None:
        self.eq(self.a, 0.5 * table2(self.cp, self.a, self.u))
        self.eq(self.b, self.a)

    check_table(loop, 1)

    def loop_of_two(self: Any) -> None:
        both = table2(self.cp, self.a, self.b)
        self.eq(self.a, 0.3 * both + 0.1)
        self.eq(self.b, 0.2 * both + self.a)

    check_table(loop_of_two, 2)


def test_a_table_can_be_solved_for_its_argument() -> None:
    def inverse(self: Any) -> None:
        self.eq(table2(self.cp, self.a, 0.5), 1.5)
        self.eq(self.b, self.a * table2(self.cp, self.a, self.a))

    check_table(inverse, 1)


def test_a_table_of_a_table_in_a_loop() -> None:
    def nested(self: Any) -> None:
        self.eq(self.a, 0.5 * table2(self.cp, table2(self.cp, self.b, self.u), 0.2))
        self.eq(self.b, 0.4 * self.a)

    check_table(nested, 1)


def test_a_table_beside_a_linear_loop_stays_explicit() -> None:
    def beside(self: Any) -> None:
        self.eq(self.a + self.b, table2(self.cp, self.u, 1.0))
        self.eq(self.a - self.b, 1)

    check_table(beside, 0)


# ---- refusals ----


def test_overdetermined_names_the_guilty_only() -> None:
    class Over(Component):
        a = Variable("1", "a")
        b = Variable("1", "b")
        c = Variable("1", "innocent")
        T = Parameter("s", "time", default=1.0)

        def equations(self) -> None:
            self.eq(self.T * self.der(self.c), -self.c)
            self.eq(self.a, 2 * self.b)
            self.eq(self.b, 1)
            self.eq(self.a + self.b, 5)

    text = refused("GF3010", Over)
    assert "Over is over-determined: 4 equations for 3 unknowns" in text
    for guilty in ("a = 2 * b", "b = 1", "a + b = 5"):
        assert guilty in text
    assert "variables a; b" in text
    assert "der(" not in text


def test_underdetermined_names_the_guilty_only() -> None:
    class Under(Component):
        a = Variable("1", "a")
        b = Variable("1", "b")
        c = Variable("1", "innocent")
        g = Variable("1", "innocent too")
        T = Parameter("s", "time", default=1.0)

        def equations(self) -> None:
            self.eq(self.T * self.der(self.c), -self.c)
            self.eq(self.g, 2 * self.c)
            self.eq(self.a + self.b, self.g)

    text = refused("GF3011", Under)
    assert "Under is under-determined: 3 equations for 4 unknowns" in text
    assert "variables a; b; equations a + b = g (test_flatten_structure.py:" in text
    assert "der(" not in text
    assert "g = 2" not in text


def test_a_part_without_its_input_is_underdetermined() -> None:
    class Lag(Component):
        u = Input("1", "input")
        x = Variable("1", "state")
        T = Parameter("s", "time", default=1.0)

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), self.u - self.x)

    class Whole(Component):
        lag = Part(Lag, "a lag whose input nobody drives")

    assert "lag.u" in refused("GF3011", Whole)


def test_a_terminal_that_nobody_uses_is_underdetermined() -> None:
    class Unused(Component):
        pin = DcPort("terminal")

    assert "variables pin.i" in refused("GF3011", Unused)


def test_balanced_but_singular() -> None:
    @unit_of("a", "b", "c", "T")
    def Singular(self: Any) -> None:
        self.eq(self.T * self.der(self.c), -self.c)
        self.eq(self.a, 1)
        self.eq(2 * self.a, self.c)

    text = refused("GF3012", Singular)
    assert "no equation is left for b" in text
    assert "a = 1" in text
    assert "2 * a = c" in text
    assert "der(" not in text


def test_a_constraint_between_states() -> None:
    @unit_of("a", "b", "c", "e", "T")
    def Constrained(self: Any) -> None:
        self.eq(self.T * self.der(self.a), self.c)
        self.eq(self.T * self.der(self.b), self.e)
        self.eq(self.a, 2 * self.b)
        self.eq(self.c + self.e, 1)

    text = refused("GF3013", Constrained)
    assert "Case: a = 2 * b (test_flatten_structure.py:" in text
    assert "constrain the states a; b" in text


def test_a_constraint_between_states_through_other_variables() -> None:
    class Parallel(Component):
        """Two capacitors between the same two pins, neither of which is at ground: their equations look independent,
        as each contains a potential, and only putting them together shows a.v = b.v."""

        pin = DcPort("terminal")
        a = Part(Capacitor, "one")
        b = Part(Capacitor, "another")
        r = Part(Resistor, "behind them")
        ground = Part(Ground, "ground")

        def equations(self) -> None:
            for capacitor in (self.a, self.b):
                self.connect(self.pin, capacitor.p)
                self.connect(self.r.p, capacitor.n)
            self.connect(self.r.n, self.ground.pin)

    text = refused("GF3013", Parallel)
    assert "constrain the states a.v; b.v" in text
    assert "v = p.v - n.v (circuits.py:" in text
    assert "R * p.i" not in text


def test_a_constraint_between_states_and_ground() -> None:
    class Grounded(Component):
        """Two capacitors with a common pin, the other ones at ground."""

        a = Part(Capacitor, "one")
        b = Part(Capacitor, "another")
        ground = Part(Ground, "ground")

        def equations(self) -> None:
            self.connect(self.a.p, self.b.p)
            self.connect(self.a.n, self.ground.pin)
            self.connect(self.b.n, self.ground.pin)

    text = refused("GF3013", Grounded)
    assert "constrain the states a.v; b.v" in text
    assert "ground: pin.v = 0 (circuits.py:" in text


def test_equations_that_say_the_same_twice() -> None:
    @unit_of("a", "b")
    def Twice(self: Any) -> None:
        self.eq(self.a, self.b)
        self.eq(self.b, self.a)

    text = refused("GF3012", Twice)
    assert "b = a" in text


def test_the_derivative_of_what_is_given_from_outside() -> None:
    class Outside(Component):
        C = Parameter("F", "capacitance", default=1.0)
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.C * self.der(self.pin.v), self.pin.i)

    assert "Outside: the derivative of pin.v is used" in refused("GF3004", Outside)


@pytest.mark.parametrize("names", [[], ["one", "two"]])
def test_one_initial_equation_for_each_free_parameter(names: list[str]) -> None:
    class Start(Component):
        x = Variable("1", "state")
        T = Parameter("s", "time", default=1.0)
        r = Parameter("1", "set point", free=True, start=1.0)

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), self.r - self.x)
            for _ in names:
                self.initial(self.x, 2)

    text = refused("GF3005", Start)
    assert f"Start has 1 free parameters and {len(names)} initial equations: r" in text


@pytest.mark.parametrize(
    "expression",
    [
        lambda c: ca.if_else(c.u > 1, c.b, 0),
        lambda c: (c.u > 1) * c.b,
        lambda c: (c.u <= 1) * c.b,
        lambda c: (c.u == 1) * c.b,
        lambda c: (c.u != 1) * c.b,
        lambda c: ca.sign(c.u) * c.b,
        lambda c: ca.floor(c.u),
        lambda c: ca.ceil(c.b),
        lambda c: ca.fmod(c.b, c.u),
    ],
)
def test_steps_without_an_event_are_refused(expression: Any) -> None:
    @unit_of("a", "b", "u")
    def Steps(self: Any) -> None:
        self.eq(self.a, expression(self))
        self.eq(self.b, 2 * self.u)

    text = refused("GF1018", Steps)
    assert "a = expression(self)" in text
    assert "test_flatten_structure.py:" in text.split(" error ")[0]  # with its place


def test_steps_in_the_arguments_of_a_table_are_refused_too() -> None:
    kind = type(
        "Steps",
        (WithTable,),
        {"equations": lambda c: (c.eq(c.a, table2(c.cp, (c.u > 1) * 2.0, c.b)), c.eq(c.b, 1))},
    )
    assert "the arguments of table cp" in refused("GF1018", kind)


def test_smooth_and_bent_functions_are_welcome() -> None:
    @unit_of("a", "b", "u")
    def Bent(self: Any) -> None:
        self.eq(self.a, ca.fabs(self.u) + limit(self.u, -1, 1))
        self.eq(self.b, ca.tanh(self.u))

    point = solved_point(flatten(Bent()), Bent(), given={"u": -3.0})
    assert point["a"] == 2.0  # 3 - 1


def test_constants_with_a_unit_become_numbers() -> None:
    class Degrees(Component):
        pitch = Variable("deg", "pitch")
        x = Variable("1", "number of degrees")

        def equations(self) -> None:
            self.eq(self.pitch, quantity(30.0, "deg"))
            self.eq(self.x, self.pitch / quantity(0.5, "deg"))

    assert solved_point(flatten(Degrees()), Degrees())["x"] == 60.0


def test_structural_parameters_shape_the_equations() -> None:
    class Order(Component):
        n = Parameter("1", "order", default=1, structural=True, min=1, max=2)
        T = Parameter("s", "time", default=1.0)
        x = Variable("1", "first")
        y = Variable("1", "second")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), -self.x)
            self.eq(self.y if self.n == 1 else self.T * self.der(self.y), self.x)

    assert flatten(Order()).n_states == 1
    assert flatten(Order(n=2)).n_states == 2


def test_discretes_and_inputs_can_be_recorded() -> None:
    class Kept(Component):
        d = Discrete("1", "kept value")
        u = Input("1", "input")
        y = Variable("1", "sum")

        def equations(self) -> None:
            self.eq(self.y, self.d + self.u)
            self.when(self.u > 1, {self.d: self.u})

    unit = flatten(Kept())
    assert {r.path for r in unit.recorded} == {"d", "u", "y"}
    assert unit.substituted == 1
    wired = flatten(Kept(), signals=frozenset({"u"}))
    assert {r.path for r in wired.recorded} == {"d", "y"}  # a wired input is the other unit's unknown


class Divider(Component):
    """1 over a reactance X, then R + jX to ground: the voltage a + jb between them, the current c + jd."""

    R = Parameter("1", "resistance", default=0.0, min=0.0)
    X = Parameter("1", "reactance", default=4.0, above=0.0)
    a = Variable("1", "a")
    b = Variable("1", "b")
    c = Variable("1", "c")
    d = Variable("1", "d")

    def equations(self) -> None:
        self.eq(self.a, self.R * self.c - self.X * self.d)
        self.eq(self.b, self.R * self.d + self.X * self.c)
        self.eq(1 - self.a, -self.X * self.d)
        self.eq(-self.b, self.X * self.c)


def test_a_parameter_that_may_be_zero_divides_nothing() -> None:
    component = Divider()
    point = solved_point(flatten(component), component)
    # half of the voltage, 1/(8j)
    assert [point[name] for name in "abcd"] == [0.5, 0.0, 0.0, -0.125]

"""The steady-state start: bounds, free parameters, kept states, many instances, and what it says when there is none."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from gustform.interfaces import DcPort
from gustform.language import Component, GustformError, Input, Output, Parameter, Table, Variable, quantity, table2
from gustform.language.system import Constant, Series, System
from gustform.language.table import TableData
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import SteadyState, steady_state
from gustform_codegen.link import Linked
from tests.unit.codegen.assembled import Assembled
from tests.unit.codegen.circuits import Follower, IdealSource, Ladder, Load, Resistor, Storage


def start(system: System, cache: KernelCache) -> tuple[Linked, SteadyState, dict[str, float]]:
    linked = build(system, cache).linked
    found = steady_state(linked)
    values = {linked.unknown_name(k): float(v) for k, v in enumerate(found.table.start)}
    # Whatever Ipopt says, the compiled kernels must agree that nothing moves.
    if not any(t.table.size for t in found.table.types):
        residual = Assembled(linked, found.table).residual(found.table.start, found.table.start_derivative)
        assert np.max(np.abs(residual)) < 1e-7 * max(1.0, np.max(np.abs(found.table.start)))
    return linked, found, values


def lone(component: Component) -> System:
    s = System()
    s.add("it", component)
    return s


def test_a_linear_network_takes_a_step_or_two(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource(V=9.0))
    s.add("line", Resistor(R=1.0))
    s.add("load", Load(R=2.0))
    s.add("store", Storage())
    s.add("ladder", Ladder())
    s.connect("source.pin", "line.p")
    for name in ("load", "store", "ladder"):
        s.connect(f"{name}.pin", "line.n")
    _, found, values = start(s, cache)
    assert values["line.n.v"] == pytest.approx(6.0, rel=1e-9)  # 9 V over 1 + 2 ohm
    assert values["store.v"] == pytest.approx(6.0, rel=1e-9)
    assert values["ladder.store.v"] == pytest.approx(6.0, rel=1e-9)
    assert values["source.pin.i"] == pytest.approx(-3.0, rel=1e-9)
    assert found.iterations <= 3  # Newton's method on a linear problem, and Ipopt's own bookkeeping
    assert found.table.start_derivative.tolist() == [0.0] * found.table.n_unknowns
    assert found.free == {}


class Square(Component):
    """x^2 = 4 at rest: two solutions, of which the bounds choose one."""

    T = Parameter("s", "time constant", default=1.0)
    x = Variable("1", "state", start=0.5, min=0.0)

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), 4 - self.x**2)


class NegativeSquare(Square):
    x = Variable("1", "state", start=-0.5, max=0.0)


def test_bounds_choose_the_solution(cache: KernelCache) -> None:
    assert start(lone(Square()), cache)[2]["it.x"] == pytest.approx(2.0, rel=1e-8)
    assert start(lone(NegativeSquare()), cache)[2]["it.x"] == pytest.approx(-2.0, rel=1e-8)
    # A start on the wrong side of the bound is no obstacle.
    assert start(lone(Square(x=-3.0)), cache)[2]["it.x"] == pytest.approx(2.0, rel=1e-8)


class Exponential(Component):
    """A stiff nonlinearity far from its start, and a scale far from one."""

    V = Parameter("V", "voltage", default=2000.0)
    R = Parameter("ohm", "resistance", default=0.01)
    thermal = Parameter("V", "thermal voltage", default=100.0)
    saturation = Parameter("A", "saturation current", default=1.0)
    v = Variable("V", "voltage", start=800.0, nominal=1000.0, min=0.0)
    C = Parameter("F", "capacitance", default=1.0)

    def equations(self) -> None:
        self.eq(
            self.C * self.der(self.v),
            (self.V - self.v) / self.R - self.saturation * (ca.exp(self.v / self.thermal) - 1),
        )


def test_a_nonlinear_system_with_a_large_nominal(cache: KernelCache) -> None:
    v = start(lone(Exponential()), cache)[2]["it.v"]
    assert (2000.0 - v) / 0.01 == pytest.approx(np.expm1(v / 100.0), rel=1e-6)


class Machine(Component):
    """A swing equation with a set point that the start must find, and an angle that is kept."""

    H = Parameter("s", "inertia", default=4.0)
    w0 = Parameter("1/s", "nominal speed", default=314.0)
    P_set = Parameter("pu", "mechanical power", free=True, start=0.1, min=0.0, max=2.0)
    X = Parameter("pu", "reactance", default=0.5, above=0.0)
    P_want = Parameter("pu", "power to be delivered", default=0.8)
    reference = Parameter("rad", "angle kept", default=0.25)
    frame = Input("pu", "speed of the frame")
    delta = Variable("rad", "angle", start=lambda self: self.reference, fixed=True)
    theta = Variable("rad", "angle of the other end", start=0.0)
    omega = Variable("pu", "speed", start=0.9, min=0.5, max=1.5)
    P = Output("pu", "electrical power")

    def equations(self) -> None:
        self.eq(self.der(self.delta), self.w0 * (self.omega - self.frame))
        self.eq(2 * self.H * self.der(self.omega), self.P_set - self.P)
        self.eq(self.P, ca.sin(self.delta - self.theta) / self.X)
        self.eq(self.H * self.der(self.theta), self.P_want - self.P)
        self.initial(self.omega, 1)


def test_free_parameters_and_kept_states(cache: KernelCache) -> None:
    s = lone(Machine())
    s.bind("it.frame", Constant(1.0))
    _, found, values = start(s, cache)
    assert found.free == {"it.P_set": pytest.approx(0.8, rel=1e-8)}
    assert values["it.delta"] == 0.25  # exactly the start value
    assert values["it.omega"] == pytest.approx(1.0, rel=1e-9)
    assert values["it.theta"] == pytest.approx(0.25 - np.arcsin(0.8 * 0.5), rel=1e-8)
    table = found.table.types[0]
    assert table.parameters[0, table.parameter_names.index("P_set")] == pytest.approx(0.8, rel=1e-8)


def test_a_kept_state_may_move_at_the_start(cache: KernelCache) -> None:
    class Draining(Component):
        T = Parameter("s", "time constant", default=2.0)
        level = Variable("1", "kept", start=3.0, fixed=True)
        follower = Variable("1", "at rest with the level")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.level), -self.level)
            self.eq(self.T * self.der(self.follower), self.level - self.follower)

    _, found, values = start(lone(Draining()), cache)
    assert values == {"it.level": 3.0, "it.follower": pytest.approx(3.0)}
    assert found.table.start_derivative.tolist() == [pytest.approx(-1.5), 0.0]  # -3 / 2 s


def test_a_kept_start_is_kept_under_an_alias(cache: KernelCache) -> None:
    class Drifting(Component):
        T = Parameter("s", "time constant", default=2.0)
        angle = Variable("1", "kept", start=3.0, fixed=True)
        x = Variable("1", "minus the angle, the name in the differential equation")

        def equations(self) -> None:
            self.eq(self.angle, -self.x)
            self.eq(self.T * self.der(self.x), 1)

    _, found, values = start(lone(Drifting()), cache)
    assert values == {"it.angle": 3.0}
    assert found.table.start_derivative.tolist() == [pytest.approx(-0.5)]


def test_series_start_from_their_operating_value(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource(V=4.0))
    s.add("f", Follower(gain=2.0))
    s.connect("source.pin", "f.pin")
    s.bind("f.u", Series("wind", 8.0, dt=0.1, value=np.array([1.0, 2.0])))
    s.bind("f.bias", Constant(0.5))
    assert start(s, cache)[2]["f.x"] == pytest.approx(17.0)  # 2 * (8 + 0.5)


class Look(Component):
    cp = Table("1", "1", "1", "table")
    x = Variable("1", "state", start=1.0)
    y = Output("1", "looked up")
    T = Parameter("s", "time constant", default=1.0)

    def equations(self) -> None:
        self.eq(self.y, table2(self.cp, self.x, 0.5))
        self.eq(self.T * self.der(self.x), 2 - self.y)


def test_each_instance_starts_from_its_own_table(cache: KernelCache) -> None:
    grid = np.linspace(0.0, 4.0, 9)
    s = System()
    for slope in (1.0, 2.0, 4.0):
        data = TableData(grid, grid, slope * grid[:, None] + 0 * grid[None, :])
        s.add(f"it[{slope:.0f}]", Look(cp=data))
    values = start(s, cache)[2]
    assert values == {"it[1].x": pytest.approx(2.0), "it[2].x": pytest.approx(1.0), "it[4].x": pytest.approx(0.5)}


def test_fifty_instances_with_parameters_of_their_own(cache: KernelCache) -> None:
    n = 50
    s = System()
    s.add("source", IdealSource(V=10.0))
    for k in range(n):
        s.add(f"m[{k}]", Machine(P_want=0.2 + 0.01 * k, reference=0.1))
        s.bind(f"m[{k}].frame", Constant(1.0))
        s.add(f"line[{k}]", Resistor(R=1.0 + k))
        s.add(f"load[{k}]", Load(R=1.0))
        s.connect("source.pin", f"line[{k}].p")
        s.connect(f"line[{k}].n", f"load[{k}].pin")
    _, found, values = start(s, cache)
    for k in range(n):
        assert found.free[f"m[{k}].P_set"] == pytest.approx(0.2 + 0.01 * k, rel=1e-7)
        assert values[f"line[{k}].n.v"] == pytest.approx(10.0 / (2.0 + k), rel=1e-8)
    assert found.iterations < 20
    assert found.largest_residual < 1e-7


# ---- when there is none ----


def failure(system: System, cache: KernelCache) -> str:
    linked = build(system, cache).linked
    with pytest.raises(GustformError) as refusal:
        steady_state(linked)
    assert refusal.value.code == "GF5001"
    assert "better start values" in refusal.value.hint
    return str(refusal.value)


class ConstantPower(Component):
    """More power than the line can carry has no solution: P_max = V^2 / (4 R)."""

    P = Parameter("W", "power", default=1.0)
    pin = DcPort("terminal", start={"v": 8.0})
    i = Variable("A", "current", start=1.0)

    def equations(self) -> None:
        self.eq(self.pin.v * self.i, self.P)
        self.eq(self.i, self.pin.i)


def power(value: float) -> System:
    s = System()
    s.add("source", IdealSource(V=10.0))
    s.add("line", Resistor(R=1.0))
    s.add("load", ConstantPower(P=value))
    s.add("other", Storage())
    s.connect("source.pin", "line.p")
    s.connect("line.n", "load.pin")
    s.connect("source.pin", "other.pin")
    return s


def test_the_limit_of_what_a_line_carries(cache: KernelCache) -> None:
    values = start(power(24.0), cache)[2]
    assert values["line.n.v"] == pytest.approx(6.0, rel=1e-6)  # (10 - 6) * 6 = 24 W, the upper of two solutions
    text = failure(power(26.0), cache)  # more than 10^2 / 4 = 25 W
    worst = text.partition("Worst equations: ")[2]
    assert worst.split(";")[0].startswith(("load: ", "sum of flows at line.n.v", "sum of flows at load.pin.v"))
    assert "other" not in worst.split(";")[0]


def test_bounds_that_exclude_the_solution_are_named(cache: KernelCache) -> None:
    class Bounded(Square):
        x = Variable("1", "state", start=0.5, min=0.0, max=1.5)

    s = lone(Bounded())
    s.add("innocent", Square())
    text = failure(s, cache)
    assert "it: T * der(x) = 4 - x**2 (test_initial.py:" in text
    assert "At a bound: it.x" in text
    assert "At a bound: innocent" not in text


def test_a_free_parameter_at_its_bound_is_named(cache: KernelCache) -> None:
    s = lone(Machine(P_want=3.0, X=0.1))  # P_set may be at most 2
    s.bind("it.frame", Constant(1.0))
    text = failure(s, cache)
    assert "it.P_set" in text


def test_an_integrator_with_a_constant_input_never_rests(cache: KernelCache) -> None:
    class Integrator(Component):
        T = Parameter("s", "time constant", default=1.0)
        u = Input("1", "input")
        x = Variable("1", "state")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), self.u)

    s = lone(Integrator())
    s.bind("it.u", Constant(0.5))
    assert "it: T * der(x) = u (test_initial.py:" in failure(s, cache)


def test_a_division_by_a_parameter_that_is_zero_names_the_instance(cache: KernelCache) -> None:
    class Unguarded(Load):
        R = Parameter("ohm", "resistance", default=0.0)

    s = System()
    s.add("source", IdealSource())
    s.add("good", Load())
    s.add("bad", Unguarded())
    s.connect("source.pin", "good.pin")
    s.connect("source.pin", "bad.pin")
    assert "Not a number at all: bad: the flow pin.i." in failure(s, cache)


def test_a_start_outside_the_domain_of_an_equation_does_not_crash(cache: KernelCache) -> None:
    class Logarithm(Component):
        T = Parameter("s", "time constant", default=1.0)
        x = Variable("1", "state", start=-1.0)

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), 1 - ca.log(self.x))

    assert "it: T * der(x) = 1 - log(x)" in failure(lone(Logarithm()), cache)


def test_a_parameter_computed_from_a_free_one_is_refused(cache: KernelCache) -> None:
    class Computed(Component):
        P = Parameter("1", "found at the start", free=True, start=1.0)
        Q = Parameter("1", "twice P", default=lambda self: 2.0 * self.P)
        x = Variable("1", "state", start=1.0)

        def equations(self) -> None:
            self.eq(self.der(self.x) * quantity(1.0, "s"), self.P - self.x + self.Q)
            self.initial(self.x, 5.0)

    system = System()
    system.add("one", Computed())
    with pytest.raises(GustformError, match="Q is computed from P") as caught:
        steady_state(build(system, cache).linked)
    assert caught.value.code == "GF5003"

"""Linearisation of linked systems: closed forms, the compiled kernels, inputs, limiters, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform.language import (
    Component,
    GustformError,
    Input,
    Output,
    Parameter,
    Table,
    Variable,
    dead_band,
    limit,
    maximum,
    quantity,
    table2,
)  # fmt: skip
from gustform.language.system import Constant, System
from gustform.language.table import TableData, evaluate_spline
from gustform_codegen import linear
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_codegen.linear import Lineariser, LinearSystem, linearise
from gustform_codegen.link import Linked
from gustform_codegen.modes import modes
from gustform_codegen.table import SystemTable
from tests.unit.codegen.assembled import Assembled
from tests.unit.codegen.circuits import Follower, IdealSource, Inductor, Ladder, Load, Resistor, Storage

Array = NDArray[np.float64]


def steady(system: System, cache: KernelCache) -> tuple[Linked, SystemTable]:
    linked = build(system, cache).linked
    return linked, steady_state(linked).table


def lone(component: Component, **inputs: float) -> System:
    s = System()
    s.add("it", component)
    for name, value in inputs.items():
        s.bind(f"it.{name}", Constant(value))
    return s


class Oscillator(Component):
    """m x'' + d x' + k x = F."""

    m = Parameter("kg", "mass", default=2.0)
    d = Parameter("N*s/m", "damping", default=0.6)
    k = Parameter("N/m", "stiffness", default=50.0)
    F = Input("N", "force")
    x = Variable("m", "deflection", nominal=0.01)
    v = Variable("m/s", "speed", nominal=100.0)
    energy = Output("J", "of the spring")
    push = Output("W", "power of the force, with d(x)/dt in it")

    def equations(self) -> None:
        self.eq(self.der(self.x), self.v)
        self.eq(self.m * self.der(self.v), self.F - self.k * self.x - self.d * self.v)
        self.eq(self.energy, 0.5 * self.k * self.x * self.x)
        self.eq(self.push, self.F * self.der(self.x))


def test_an_oscillator_has_its_closed_form(cache: KernelCache) -> None:
    linked, table = steady(lone(Oscillator(), F=5.0), cache)
    channels, _ = linked.select(["it.x", "it.energy", "it.push"])
    system = linearise(linked, table, outputs=channels)
    m, d, k, F = 2.0, 0.6, 50.0, 5.0
    order = [q.name for q in system.states]
    assert sorted(order) == ["it.v", "it.x"]
    ix, iv = order.index("it.x"), order.index("it.v")
    np.testing.assert_allclose(system.A[np.ix_([ix, iv], [ix, iv])], [[0.0, 1.0], [-k / m, -d / m]], rtol=1e-13)
    np.testing.assert_allclose(system.B[[ix, iv], 0], [0.0, 1.0 / m], rtol=1e-13)
    assert [q.name for q in system.inputs] == ["it.F"]
    assert (system.inputs[0].unit, system.states[ix].unit) == ("N", "m")
    assert system.x0[ix] == pytest.approx(F / k)
    assert system.u0.tolist() == [F]
    names = [q.name for q in system.outputs]
    # energy = k x^2/2: slope k x0 = F to x, none to the force; power = F v: slope F to v, and v0 = 0 to the force
    energy, push = names.index("it.energy"), names.index("it.push")
    np.testing.assert_allclose(system.C[energy, [ix, iv]], [F, 0.0], atol=1e-9)
    np.testing.assert_allclose(system.C[push, [ix, iv]], [0.0, F], atol=1e-9)
    np.testing.assert_allclose(system.D, 0.0, atol=1e-9)
    assert system.y0[energy] == pytest.approx(0.5 * k * (F / k) ** 2)
    # w0 = sqrt(k/m) = 5 rad/s, damping d/(2 sqrt(k m)) = 0.03
    found = modes(system)
    (mode,) = found.listed
    assert mode.damping == pytest.approx(0.03, rel=1e-12)
    assert mode.frequency == pytest.approx(5.0 * np.sqrt(1.0 - 0.03**2) / (2.0 * np.pi), rel=1e-12)
    assert found.stable
    # kinetic and potential energy change places: both states take part alike
    assert [share for _, share in mode.participation] == pytest.approx([0.5, 0.5], abs=1e-12)


def network(cache: KernelCache) -> tuple[Linked, SystemTable]:
    s = System()
    s.add("source", IdealSource(V=9.0))
    s.add("line", Resistor(R=1.0))
    s.add("coil", Inductor(L=0.3))
    s.add("load", Load(R=2.0))
    s.add("store[1]", Storage())
    s.add("store[2]", Storage(R=3.0, C=0.25))
    s.add("ladder", Ladder())
    s.add("lag", Follower(gain=0.8))
    s.connect("source.pin", "line.p")
    s.connect("line.n", "coil.p")
    for name in ("load", "store[1]", "store[2]", "ladder", "lag"):
        s.connect(f"{name}.pin", "coil.n")
    s.signal("lag.u", "store[1].seen")
    s.bind("lag.bias", Constant(0.3))
    s.change(1.0, "load.R", 1.5)
    return steady(s, cache)


def by_kernels(linked: Linked, table: SystemTable) -> Array:
    """A from the compiled kernels: F_y and F_y' are their Jacobian at cj = 0 and its change with cj."""
    assembled = Assembled(linked, table)
    y, yp = table.start, table.start_derivative
    F_y = assembled.jacobian(y, yp, 0.0)
    F_yp = assembled.jacobian(y, yp, 1.0) - F_y
    x = table.differential != 0
    solved = -np.linalg.solve(np.where(x, F_yp, F_y), F_y[:, x])
    return np.asarray(solved[x])


def test_a_network_of_units_equals_the_compiled_kernels(cache: KernelCache) -> None:
    linked, table = network(cache)
    system = linearise(linked, table)
    assert len(system.states) == 5  # coil, two stores, ladder, lag; the potentials in between are algebraic
    np.testing.assert_allclose(system.A, by_kernels(linked, table), rtol=1e-12, atol=1e-12)
    assert [q.name for q in system.inputs] == ["lag.bias", "load.R"], "driven inputs, then what events change"


def test_one_storage_behind_two_resistors(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource(V=9.0))
    s.add("line", Resistor(R=1.0))
    s.add("store", Storage())
    s.connect("source.pin", "line.p")
    s.connect("line.n", "store.pin")
    linked, table = steady(s, cache)
    channels, _ = linked.select(["store.seen", "store.minus"])
    system = linearise(linked, table, ["source.V"], channels)
    # C (R1 + R2) dv/dt = V - v with C = 0.5 F, R1 = 1, R2 = 2 ohm; the terminal is at v + R2 (V - v)/(R1 + R2)
    np.testing.assert_allclose(system.A, [[-1.0 / 1.5]])
    np.testing.assert_allclose(system.B, [[1.0 / 1.5]])
    output = {q.name: k for k, q in enumerate(system.outputs)}
    seen = next(k for name, k in output.items() if name != "store.v")
    assert (system.C[seen, 0], system.D[seen, 0]) == pytest.approx((1.0 / 3.0, 2.0 / 3.0))
    # an alias with the other sign is recorded as what it stands for
    assert system.C[output["store.v"], 0] == 1.0
    assert system.outputs[output["store.v"]].unit == "V"


def steady_with(cache: KernelCache, **values: float) -> dict[str, float]:
    s = System()
    s.add("lag", Follower(**values))
    s.add("store", Storage())
    s.connect("lag.pin", "store.pin")
    s.signal("lag.u", "store.seen")
    s.bind("lag.bias", Constant(0.3))
    linked, table = steady(s, cache)
    return {linked.unknown_name(k): float(v) for k, v in enumerate(table.start)}


def test_what_is_computed_from_a_parameter_moves_with_it(cache: KernelCache) -> None:
    s = System()
    s.add("lag", Follower(gain=0.8))
    s.add("store", Storage())
    s.connect("lag.pin", "store.pin")
    s.signal("lag.u", "store.seen")
    s.bind("lag.bias", Constant(0.3))
    linked, table = steady(s, cache)
    system = linearise(linked, table, ["lag.gain", "lag.bias"])
    # the linear system's own steady state, -A^-1 B, is the derivative of the steady state: another way to it
    slope = -np.linalg.solve(system.A, system.B)
    h = 1e-4
    above, below = steady_with(cache, gain=0.8 + h), steady_with(cache, gain=0.8 - h)
    for k, q in enumerate(system.states):
        # central differences: h^2 times the third derivative, some 1e2 here
        assert slope[k, 0] == pytest.approx((above[q.name] - below[q.name]) / (2.0 * h), rel=1e-5), q.name


class Surface(Component):
    """A state that a table drives."""

    T = Parameter("s", "time constant", default=0.5)
    u = Input("1", "place")
    curve = Table("1", "1", "1", "a surface")
    x = Variable("1", "state", start=0.4)

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), table2(self.curve, self.x, self.u) - self.x)


def surface() -> TableData:
    x = np.linspace(0.0, 1.0, 9)
    return TableData(x, x, np.cos(x)[:, None] * np.cos(2.0 * x)[None, :])


def test_slopes_go_through_tables(cache: KernelCache) -> None:
    linked, table = steady(lone(Surface(curve=surface()), u=0.2), cache)
    system = linearise(linked, table)
    x, T, h = float(system.x0[0]), 0.5, 1e-6
    spline = table.tables[0].spline

    def rate(x: float, u: float) -> float:
        return float((evaluate_spline(spline, np.array([x]), np.array([u]))[0][0] - x) / T)

    # central differences of a smooth function at h = 1e-6: some 1e-10
    assert system.A[0, 0] == pytest.approx((rate(x + h, 0.2) - rate(x - h, 0.2)) / (2.0 * h), abs=1e-8)
    assert system.B[0, 0] == pytest.approx((rate(x, 0.2 + h) - rate(x, 0.2 - h)) / (2.0 * h), abs=1e-8)


# ---- limiters ----


class Limited(Component):
    """dx/dt = -x - 2 (what a limiter leaves of y)."""

    low = Parameter("1", "lower end", default=0.0)
    x = Variable("1", "state")
    y = Variable("1", "another, at rest at zero")

    def leaves(self) -> Any:
        return maximum(self.y, self.low)

    def equations(self) -> None:
        self.eq(quantity(1.0, "s") * self.der(self.x), -self.x - 2.0 * self.leaves())
        self.eq(quantity(1.0, "s") * self.der(self.y), -self.y)


class Inactive(Limited):
    """A gain of zero beside the limiter hides nothing that was there."""

    gain = Parameter("1", "gain", default=0.0)

    def leaves(self) -> Any:
        return maximum(self.x, -1.0) / 1e9 + self.gain * self.y


class WithoutBand(Limited):
    def leaves(self) -> Any:
        return dead_band(self.y, self.low)


class Inside(Limited):
    def leaves(self) -> Any:
        return limit(self.y, self.low - 1.0, self.low + 1.0)


@pytest.mark.parametrize(
    ("component", "slope", "bends", "flats"),
    [
        (Limited(), -1.0, 1, 0),  # 0 below, -2 above: the mean
        (Limited(low=-1.0), -2.0, 0, 0),
        (Limited(low=1.0), 0.0, 0, 1),
        (WithoutBand(), -2.0, 0, 0),  # two limiters meet, and together they do not bend
        (WithoutBand(low=0.1), 0.0, 0, 1),
        (WithoutBand(low=1e-9), -2.0, 0, 0),  # narrower than what the start is solved to
        (Inside(), -2.0, 0, 0),
        (Inactive(), 0.0, 0, 0),
    ],
)
def test_limiters_at_the_operating_point(
    component: Component, slope: float, bends: int, flats: int, cache: KernelCache
) -> None:
    linked, table = steady(lone(component), cache)
    system = linearise(linked, table)
    x, y = ([q.name for q in system.states].index(name) for name in ("it.x", "it.y"))
    assert system.A[x, y] == pytest.approx(slope, rel=1e-9)
    assert system.A[x, x] == pytest.approx(-1.0, abs=1e-8)
    assert system.A[y, y] == -1.0
    assert (len(system.bends), len(system.flats)) == (bends, flats)
    for limiter in [*system.bends, *system.flats]:
        assert limiter.instances == ["it"]
        assert limiter.unknowns == ["it.y"]
        assert "der(x)" in limiter.text
        assert "it.y" in str(limiter)


def test_instances_with_the_same_limiter_are_named_together(cache: KernelCache) -> None:
    s = System()
    for k in (1, 2, 3):
        s.add(f"it[{k}]", Limited(low=0.0 if k < 3 else -1.0))
    linked, table = steady(s, cache)
    (bend,) = linearise(linked, table).bends
    assert bend.instances == ["it[1]", "it[2]"]
    assert "and 1 more" in str(bend)


# ---- what is refused ----


def test_not_in_a_steady_state(cache: KernelCache) -> None:
    linked, table = steady(lone(Oscillator(), F=5.0), cache)
    with pytest.raises(GustformError, match=r"GF5004.*is off by"):
        linearise(linked, replace(table, start=table.start + 0.01))
    with pytest.raises(GustformError, match="GF5004"):
        linearise(linked, linked.table)  # before the steady state was found


class Kept(Component):
    """A state that the start keeps, and that moves from there."""

    x = Variable("1", "state", start=1.0, fixed=True)

    def equations(self) -> None:
        self.eq(quantity(1.0, "s") * self.der(self.x), -self.x)


def test_a_kept_state_that_moves_is_named(cache: KernelCache) -> None:
    linked, table = steady(lone(Kept()), cache)
    with pytest.raises(GustformError, match=r"it\.x moves by 1 of its nominal value a second"):
        linearise(linked, table)


class Cubic(Component):
    """z^3 = x: at x = 0 nothing tells how z moves."""

    x = Variable("1", "state")
    z = Variable("1", "algebraic")

    def equations(self) -> None:
        self.eq(quantity(1.0, "s") * self.der(self.x), -self.x - self.z)
        self.eq(self.z * self.z * self.z, self.x)


def test_a_singular_algebraic_part_is_named(cache: KernelCache) -> None:
    linked = build(lone(Cubic()), cache).linked  # its start, all zero, is a steady state already
    with pytest.raises(GustformError, match=r"GF5005.*do not determine it\.z here"):
        linearise(linked, linked.table)


def test_inputs_must_exist(cache: KernelCache) -> None:
    linked, _ = steady(lone(Oscillator(), F=5.0), cache)
    with pytest.raises(GustformError, match="GF2007"):
        Lineariser(linked, ["other.F"])
    with pytest.raises(GustformError, match=r"GF2008.*it\.stiffness.*it\.") as error:
        Lineariser(linked, ["it.stiffness"])
    assert "neither an input nor a parameter" in error.value.message


def test_too_large_a_system_is_refused(cache: KernelCache, monkeypatch: pytest.MonkeyPatch) -> None:
    linked, table = steady(lone(Oscillator(), F=5.0), cache)
    monkeypatch.setattr(linear, "MOST_UNKNOWNS", 1)
    with pytest.raises(GustformError, match=r"GF5006.*at most 1 unknowns.*this one has 2"):
        linearise(linked, table)


def test_a_system_without_states(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource(V=9.0))
    s.add("load", Load())
    s.connect("source.pin", "load.pin")
    linked, table = steady(s, cache)
    channels, _ = linked.select(["load.P"])
    system: LinearSystem = linearise(linked, table, ["source.V"], channels)
    assert system.A.shape == (0, 0)
    assert system.D[0, 0] == pytest.approx(9.0)  # P = V^2/R: slope 2 V/R with R = 2 ohm
    found = modes(system)
    assert found.listed == []
    assert found.stable

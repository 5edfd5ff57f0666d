"""Parameters, parts and what a constructor takes: values, bounds, bindings and refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gustform.interfaces import DcPort
from gustform.language import (
    Component,
    Connector,
    Flow,
    GustformError,
    Input,
    Parameter,
    Part,
    Potential,
    Table,
    Variable,
)
from gustform.language.declare import Discrete
from gustform.language.table import TableData


class Machine(Component):
    """Parameters of every sort."""

    H = Parameter("s", "inertia constant", above=0.0, max=100.0)
    D = Parameter("pu", "damping", min=0.0, default=1.5)
    n = Parameter("1", "number of machines", min=1.0, default=10.0)
    S = Parameter("VA", "rating of all machines", default=lambda self: self.n * 5e6)
    J = Parameter("kg*m^2", "inertia of all machines", default=lambda self: 2 * self.H * self.S)
    P = Parameter("W", "set point", free=True, start=lambda self: 0.5 * self.S, min=0.0)
    order = Parameter("1", "order of the model", default=6, structural=True, min=2, max=6)
    kind = Parameter("1", "name of the exciter", default="SEXS", structural=True)
    saturation = Parameter("1", "with saturation", default=False, structural=True)
    cp = Table("1", "deg", "pu", "power coefficient")
    w = Variable("pu", "speed", start=1.0)
    mode = Discrete("1", "mode", start=2.0)
    wind = Input("m/s", "wind speed")
    terminal = DcPort("terminal")


def refused(code: str, build: Any) -> str:
    with pytest.raises(GustformError) as refusal:
        build()
    assert refusal.value.code == code
    return str(refusal.value)


# ---- one value ----


def test_bounds_are_told_with_the_sentence_unit_and_something_to_try() -> None:
    text = refused("GF2003", lambda: Machine(H=-1))
    assert text == (
        "error GF2003: Machine.H must be greater than 0 (inertia constant, s); got -1 — try a value from 0 to 100"
    )
    text = refused("GF2003", lambda: Machine(D=-0.1))
    assert text == "error GF2003: Machine.D must be at least 0 (damping, pu); got -0.1 — try the default, 1.5"


@pytest.mark.parametrize(
    ("name", "value"), [("H", 0.0), ("H", 1e-61), ("H", 100.5), ("D", -1e-9), ("n", 0), ("P", -1), ("order", 7)]
)
def test_out_of_bounds(name: str, value: float) -> None:
    assert f"Machine.{name} must be" in refused("GF2003", lambda: Machine(**{name: value}))


@pytest.mark.parametrize(("name", "value"), [("H", 1e-60), ("H", 100), ("D", 0), ("n", 1), ("order", 2), ("order", 6)])
def test_inclusive_and_exclusive_bounds_let_their_edge_in_or_not(name: str, value: float) -> None:
    assert Machine(**{name: value}).value(name) == value


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_only_finite_numbers(value: float) -> None:
    assert "Machine.D must be a finite number" in refused("GF2002", lambda: Machine(D=value))


@pytest.mark.parametrize("value", ["5", "5 s", True, [1.0], {"a": 1}])
def test_only_numbers(value: Any) -> None:
    text = refused("GF2001", lambda: Machine(D=value))
    assert f"Machine.D must be a number in pu (damping); got {value!r}" in text


def test_missing_value_is_told_when_it_is_needed() -> None:
    machine = Machine()
    text = refused("GF2004", lambda: machine.H)
    assert text == ("error GF2004: Machine.H is not given (inertia constant, s) — try H: a number in s")
    assert "Machine.H" in refused("GF2004", lambda: machine.J)  # computed from it
    assert "Machine.H" in refused("GF2004", machine.parameter_values)
    assert "needs a table" in refused("GF2004", lambda: machine.table("cp"))
    assert "must be a table; got 3" in refused("GF2001", lambda: Machine(cp=3))


def test_defaults_from_other_parameters_and_free_start() -> None:
    machine = Machine(H=4.0, n=2.0)
    assert machine.S == 1e7  # 2 machines of 5 MVA
    assert machine.J == 2 * 4.0 * 1e7
    assert machine.P == 0.5e7
    assert Machine(H=4.0, S=1e6).J == 8e6
    assert machine.parameter_values() == {"H": 4.0, "D": 1.5, "n": 2.0, "S": 1e7, "J": 8e7, "P": 5e6}


def test_computed_values_are_checked_too() -> None:
    class Wrong(Component):
        a = Parameter("1", "a number", default=2.0)
        b = Parameter("1", "another", default=lambda self: -self.a, min=0.0)
        c = Parameter("1", "one more", default=lambda self: self.a / 0.0 if self.a == 0 else math.inf)

    assert "b must be at least 0 (another, 1); got -2" in refused("GF2003", lambda: Wrong().b)
    assert "c must be a finite number" in refused("GF2002", lambda: Wrong().c)


def test_values_computed_in_a_circle() -> None:
    class Circle(Component):
        a = Parameter("1", "one", default=lambda self: self.b + 1)
        b = Parameter("1", "another", default=lambda self: self.a + 1)

    assert "Circle.a is computed from itself" in refused("GF1022", lambda: Circle().a)
    assert Circle(b=1.0).a == 2.0


@pytest.mark.parametrize("value", [np.float64(2.5), np.float32(2.5), np.int64(2), 2])
def test_numbers_of_numpy_are_numbers(value: Any) -> None:
    machine = Machine(D=value)
    assert float(value) == machine.D
    assert type(machine.D) is float


def test_a_free_parameter_needs_a_start() -> None:
    assert "start=" in refused("GF1003", lambda: Parameter("W", "set point", free=True))


def test_structural_values_keep_their_type_and_make_the_key() -> None:
    six, classical = Machine(), Machine(order=2, kind="AC1A", saturation=True)
    assert (six.order, six.kind, six.saturation) == (6, "SEXS", False)
    assert (classical.order, classical.kind, classical.saturation) == (2, "AC1A", True)
    assert six.structure_key() != classical.structure_key()
    assert six.structure_key() == Machine(H=3.0, D=0.0, n=4.0).structure_key()
    assert "order" not in Machine(H=1.0).parameter_values()


# ---- names and assignment ----


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("damping", "one of H, D, n, S, J, P, order, kind, saturation, cp"),
        ("ordr", "try order"),
        ("wind", "no parameter 'wind'"),  # an input is bound in a system, not given here
        ("terminal", "no parameter 'terminal'"),
        ("__class__", "no parameter '__class__'"),
    ],
)
def test_unknown_names_with_a_suggestion(name: str, message: str) -> None:
    assert message in refused("GF1004", lambda: Machine(**{name: 1.0}))


@pytest.mark.parametrize("name", ["H", "w", "mode", "wind", "terminal", "cp", "rotor"])
def test_declarations_cannot_be_assigned(name: str) -> None:
    class Whole(Machine):
        rotor = Part(Machine, "a part", H=1.0)

    whole = Whole(H=2.0)
    text = refused("GF1002", lambda: setattr(whole, name, 1.0))
    assert f"Whole.{name} cannot be assigned" in text
    assert f"try Whole({name}=...)" in text


@pytest.mark.parametrize("name", ["w", "mode", "wind", "terminal"])
def test_what_moves_has_no_value_outside_equations(name: str) -> None:
    assert f"Machine.{name} has a value only in a running model" in refused("GF1008", lambda: getattr(Machine(), name))


def test_equations_cannot_be_stated_outside_elaboration() -> None:
    machine = Machine()
    for statement in (machine.eq, machine.initial, machine.connect):
        refused("GF1009", lambda statement=statement: statement(1, 2))
    refused("GF1009", lambda: machine.der(1))


@pytest.mark.parametrize("name", ["eq", "path", "value", "part", "_scope"])
def test_a_declaration_must_not_hide_what_components_have(name: str) -> None:
    text = refused("GF1021", lambda: type("Hiding", (Component,), {name: Variable("1", "hides a method")}))
    assert f"Hiding declares {name!r}" in text


def test_connectors_pair_potentials_with_flows() -> None:
    text = refused("GF1005", lambda: type("Odd", (Connector,), {"v": Potential("V", "voltage")}))
    assert "Odd has 1 potentials and 0 flows" in text
    even = type("Even", (Connector,), {"v": Potential("V", "voltage"), "i": Flow("A", "current")})
    assert "no quantity 'u'" in refused("GF1006", lambda: even("port", start={"u": 1.0}))
    assert "try v or i" in refused("GF1006", lambda: even("port", nominal={"I": 1.0}))


# ---- parts ----


class Rotor(Component):
    R = Parameter("m", "radius", above=0.0)
    J = Parameter("kg*m^2", "inertia", default=1.0)
    w = Variable("1/s", "speed", start=1.0)


class HeavyRotor(Rotor):
    rim = Parameter("kg", "mass of the rim", default=7.0)


class Plain(Component):
    x = Parameter("1", "no rotor at all", default=0.0)


class Turbine(Component):
    D = Parameter("m", "rotor diameter", default=120.0, above=0.0)
    rotor = Part(Rotor, "the rotor", base=Rotor, R=lambda self: self.D / 2, J=5.0, w=lambda self: 100 / self.D)


class Farm(Component):
    D = Parameter("m", "diameter of all rotors", default=90.0)
    turbine = Part(Turbine, "the turbine", D=lambda self: self.D)


def test_parts_are_bound_by_the_parent_level_by_level() -> None:
    farm = Farm()
    assert farm.turbine.rotor.R == 45.0  # half of 90 m
    assert farm.parameter_values() == {"D": 90.0, "turbine.D": 90.0, "turbine.rotor.R": 45.0, "turbine.rotor.J": 5.0}
    assert Farm(D=60.0).at("turbine.rotor").value("R") == 30.0
    assert farm.at("turbine.rotor").path == "turbine.rotor"


def test_a_binding_can_be_overridden_at_every_level() -> None:
    assert Turbine(rotor={"R": 10.0}).rotor.R == 10.0
    assert Turbine(rotor={"R": 10.0}).rotor.J == 5.0  # the parent's number stays
    assert Turbine(rotor=Rotor(J=2.0)).rotor.J == 2.0
    assert Turbine(rotor=Rotor(J=2.0)).rotor.R == 60.0  # the parent's function stays
    assert Farm(turbine={"D": 50.0}).turbine.rotor.R == 25.0
    assert Farm(turbine=Turbine(rotor={"R": 1.0})).parameter_values()["turbine.D"] == 90.0
    assert Turbine(rotor=Rotor(R=lambda parent: parent.D)).rotor.R == 120.0


def test_a_part_given_to_a_parent_is_not_changed_by_it() -> None:
    rotor = Rotor()
    assert Turbine(D=10.0, rotor=rotor).rotor.R == 5.0
    assert Turbine(D=20.0, rotor=rotor).rotor.R == 10.0
    refused("GF2004", lambda: rotor.R)


def test_parts_replaced_by_kin_only() -> None:
    turbine = Turbine(rotor=HeavyRotor(rim=3.0))
    assert (turbine.rotor.rim, turbine.rotor.R) == (3.0, 60.0)
    assert turbine.structure_key() != Turbine().structure_key()
    text = refused("GF1007", lambda: Turbine(rotor=Plain()))
    assert text == ("error GF1007: Turbine.rotor must be a Rotor; got Plain — try a component derived from Rotor")
    refused("GF1007", lambda: Turbine(rotor=3.0))
    assert "Rotor has no parameter 'X'" in refused("GF1004", lambda: Turbine(rotor={"X": 1.0}).rotor)
    assert "no parameter 'X'" in refused("GF1004", lambda: Part(Rotor, "the rotor", X=1.0))


def test_bounds_of_a_bound_parameter_name_the_path() -> None:
    class Negative(Component):
        rotor = Part(Rotor, "the rotor", R=lambda self: -1.0)

    assert "rotor.R must be greater than 0 (radius, m); got -1" in refused("GF2003", lambda: Negative().rotor.R)


def test_with_value_is_a_copy_and_what_is_computed_follows() -> None:
    farm = Farm()
    other = farm.with_value("D", 40.0)
    assert other.parameter_values() == {
        "D": 40.0, "turbine.D": 40.0, "turbine.rotor.R": 20.0, "turbine.rotor.J": 5.0
    }  # fmt: skip
    assert farm.parameter_values()["turbine.rotor.R"] == 45.0
    deep = other.with_value("turbine.rotor.J", 9.0).with_value("turbine.D", 8.0)
    assert deep.parameter_values() == {"D": 40.0, "turbine.D": 8.0, "turbine.rotor.R": 4.0, "turbine.rotor.J": 9.0}
    replaced = Turbine(rotor=HeavyRotor(rim=3.0)).with_value("rotor.R", 2.0)
    assert isinstance(replaced.rotor, HeavyRotor)
    assert (replaced.rotor.rim, replaced.rotor.R) == (3.0, 2.0)
    assert "must be greater than 0" in refused("GF2003", lambda: farm.with_value("turbine.rotor.R", -1.0))


def test_starts_are_declared_bound_or_given() -> None:
    assert Rotor().start_value(Rotor.declared(Variable)["w"]) == 1.0
    assert Rotor(w=3.0).start_value(Rotor.declared(Variable)["w"]) == 3.0
    assert Turbine(D=50.0).rotor.start_value(Rotor.declared(Variable)["w"]) == 2.0  # 100 / 50
    text = refused("GF2002", lambda: Rotor(w=math.nan).start_value(Rotor.declared(Variable)["w"]))
    assert "w (start) must be finite" in text


def test_tables_come_from_the_constructor_or_the_parent() -> None:
    data = TableData(np.arange(4.0), np.arange(5.0), np.ones((4, 5)))

    class Inner(Component):
        cp = Table("1", "deg", "pu", "power coefficient")

    class Outer(Component):
        cp = Table("1", "deg", "pu", "power coefficient")
        inner = Part(Inner, "uses it", cp=lambda self: self.cp)

    assert Inner(cp=data).table("cp") is data
    assert Outer(cp=data).inner.table("cp") is data
    assert Outer(inner={"cp": data}).inner.table("cp") is data


def test_inheritance_of_declarations_and_override() -> None:
    class Lighter(Rotor):
        J = Parameter("kg*m^2", "inertia", default=0.5)

    assert list(HeavyRotor.declarations()) == ["R", "J", "w", "rim"]
    assert Lighter(R=1.0).J == 0.5
    assert Rotor(R=1.0).J == 1.0


class _Plain(Component):
    """One of two."""

    gain = Parameter("1", "gain", default=1.0)


class _Fancy(_Plain):
    """The other."""

    extra = Parameter("1", "something more", default=2.0)


class _Choosing(Component):
    """Chooses a part by a word, unless the user does."""

    mode = Parameter("1", "how well", default="plain", structural=True, choices=("plain", "fancy"))
    part_ = Part(
        _Plain,
        "the part",
        base=_Plain,
        select=lambda self: _Fancy if self.mode == "fancy" else _Plain,
        among=(_Fancy,),
        gain=3.0,
    )


def test_an_owner_chooses_its_part_by_structure() -> None:
    assert type(_Choosing().part_) is _Plain
    fancy = _Choosing(mode="fancy", part_={"extra": 5.0})
    assert type(fancy.part_) is _Fancy
    assert (fancy.part_.gain, fancy.part_.extra) == (3.0, 5.0)
    assert fancy.structure_key() != _Choosing().structure_key()
    assert type(_Choosing(mode="fancy", part_=_Plain()).part_) is _Plain  # the user's word counts more
    assert fancy.with_value("part_.extra", 6.0).part_.extra == 6.0


def test_a_word_must_be_among_the_choices() -> None:
    with pytest.raises(GustformError, match=r"mode must be plain or fancy .*; got 'best'"):
        _Choosing(mode="best")

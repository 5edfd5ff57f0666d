"""The registry: what a scenario may name, and how it stands in a system."""

from __future__ import annotations

import pytest

from gustform.interfaces import AcPort
from gustform.language import Component, Connector, Input, Parameter, Part, Table
from gustform.language.errors import GustformError
from gustform.registry import ALIASES, PARTS, UNITS, component_types, find_part, find_unit, fitting_parts
from gustform.turbines.pmsg_turbine import PmsgTurbine


def place(kind: type[Component], name: str) -> Part:
    part: Part = kind.declared(Part)[name]
    return part


@pytest.mark.parametrize("name", sorted(UNITS))
def test_roles_name_what_the_unit_has(name: str) -> None:
    unit = UNITS[name]
    ports = unit.kind.declared(Connector)
    for port in (unit.at, *(unit.ends or ())):
        assert port is None or isinstance(ports[port], AcPort)
    assert (unit.at is None) or (unit.ends is None)
    for parameter in (unit.voltage, unit.wind_speed):
        assert parameter is None or parameter in unit.kind.declared(Parameter)
    assert unit.wind is None or unit.wind in unit.kind.declared(Input)
    for variable in (unit.speed, unit.frequency):
        assert variable is None or variable in unit.kind.declarations()


@pytest.mark.parametrize("name", sorted(PARTS))
def test_readers_are_those_of_declared_tables(name: str) -> None:
    part = PARTS[name]
    declared = set(part.kind.declared(Table))
    # a table without a reader comes from the turbine
    places = [place for place in PmsgTurbine.declared(Part).values() if part.kind in place.among]
    computed = {key for place in places for key in place.modifiers if key in declared}
    assert set(part.tables) | computed == declared


def test_every_name_is_that_of_its_class() -> None:
    assert all(kind.__name__ == name for name, kind in component_types().items())
    assert set(ALIASES.values()) <= set(PARTS)


def test_parts_are_found_by_name_and_alias() -> None:
    rotor = place(PmsgTurbine, "rotor")
    assert fitting_parts(rotor) == ["ClosedFormRotor", "TableRotor", "nrel_5mw"]
    assert find_part("nrel_5mw", rotor) is find_part("ClosedFormRotor", rotor)
    # a part that is not replaceable is its own only choice
    assert find_part("OneMass", place(PmsgTurbine, "drive")).kind.__name__ == "OneMass"


def test_what_does_not_exist_or_fit_is_refused_with_a_suggestion() -> None:
    rotor = place(PmsgTurbine, "rotor")
    with pytest.raises(GustformError, match=r"GF2012.*no unit of type 'PmsgTurbin'.*try PmsgTurbine"):
        find_unit("PmsgTurbin")
    with pytest.raises(GustformError, match=r"GF2012.*no Rotor of type 'os.system'"):
        find_part("os.system", rotor)
    with pytest.raises(GustformError, match=r"GF1007.*rotor must be a Rotor"):
        find_part("TGOV1", rotor)
    with pytest.raises(GustformError, match="GF2012"):
        find_part("PmsgTurbine", rotor)

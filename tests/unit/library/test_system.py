"""A system as data: names, connections, drivers of inputs, scheduled changes, and what is refused at once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, GustformError, Input, Output, Parameter, Part
from gustform.language.system import Change, Constant, Series, System


class Controller(Component):
    K = Parameter("1", "gain", default=2.0, min=0.0)


class Turbine(Component):
    P = Parameter("W", "rated power", default=5e6, above=0.0)
    order = Parameter("1", "order", default=2, structural=True)
    controller = Part(Controller, "the controller")
    wind = Input("m/s", "wind speed")
    frame = Input("pu", "speed of the frame")
    grid = DcPort("grid terminal")
    ac = AcPort("AC terminal")


class Machine(Component):
    omega = Output("pu", "speed")
    terminal = DcPort("stator")


def system() -> System:
    s = System()
    s.add("wt", Turbine())
    s.add("wt[2]", Turbine())
    s.add("sg", Machine())
    return s


def refused(code: str, call: Any) -> str:
    with pytest.raises(GustformError) as refusal:
        call()
    assert refusal.value.code == code
    return str(refusal.value)


@pytest.mark.parametrize("name", ["wt", "_x", "a1", "WT_3", "wt[0]", "wt[12]"])
def test_names_that_can_be_used(name: str) -> None:
    System().add(name, Machine())


@pytest.mark.parametrize(
    "name",
    ["", "1wt", "wt-1", "wt.1", "wt 1", "wt[", "wt[]", "wt[-1]", "wt[1", "wt[a]", "wt[1][2]", "wt\n", "wt[1]\n", 'wt"',
     "wt';drop", "wt;system(1)", "*/", "wtä", "wt\0", "../wt", "$(x)"],
)  # fmt: skip
def test_names_that_cannot(name: str) -> None:
    assert repr(name) in refused("GF2005", lambda: System().add(name, Machine()))


def test_a_name_is_used_once() -> None:
    text = refused("GF2006", lambda: system().add("wt", Machine()))
    assert text == "error GF2006: component name 'wt' is used twice — try wt_2"


def test_connections() -> None:
    s = system()
    s.connect("wt.grid", "sg.terminal")
    s.connect("wt[2].grid", "sg.terminal")
    assert s.connections == [("wt.grid", "sg.terminal"), ("wt[2].grid", "sg.terminal")]


@pytest.mark.parametrize(
    ("code", "ports", "message"),
    [
        ("GF2007", ("sgg.terminal", "wt.grid"), "no component 'sgg' (in 'sgg.terminal') — try sg"),
        ("GF2007", ("wt.grid", "wt[3].grid"), "no component 'wt[3]'"),
        ("GF2008", ("wt.grd", "sg.terminal"), "Turbine 'wt' has no port 'grd' — try grid"),
        ("GF2008", ("wt", "sg.terminal"), "Turbine 'wt' has no port ''"),
        ("GF2008", ("wt.wind", "sg.terminal"), "Turbine 'wt' has no port 'wind' — try one of grid, ac"),
        ("GF3001", ("wt.ac", "sg.terminal"), "cannot connect wt.ac (AcPort) to sg.terminal (DcPort)"),
        ("GF3002", ("wt.grid", "wt.grid"), "wt.grid is connected to itself"),
    ],
)
def test_connections_refused(code: str, ports: tuple[str, str], message: str) -> None:
    assert message in refused(code, lambda: system().connect(*ports))


def test_what_drives_an_input() -> None:
    s = system()
    s.bind("wt.wind", Constant(8.0))
    s.bind("wt.wind", Constant(9.0))  # a new value replaces the old one
    assert s.inputs == {"wt.wind": Constant(9.0)}
    s.bind("wt[2].frame", Constant(1.0))
    s.frame("sg.omega")
    assert s.signals == {"wt.frame": "sg.omega"}  # what is bound stays bound
    assert "wt has no input 'wnd' — try wind" in refused("GF2009", lambda: s.bind("wt.wnd", Constant(1.0)))
    assert "sg has no input 'x'" in refused("GF2009", lambda: s.signal("sg.x", "wt.P"))
    refused("GF2007", lambda: s.signal("wt.frame", "nobody.omega"))
    assert "driven by sg.omega already" in refused("GF2014", lambda: s.bind("wt.frame", Constant(1.0)))
    assert "driven by a constant" in refused("GF2014", lambda: s.signal("wt.wind", "sg.omega"))


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_drivers_are_finite(value: float) -> None:
    text = refused("GF2002", lambda: system().bind("wt.wind", Constant(value)))
    assert f"wt.wind must be a finite number (wind speed, m/s); got {value}" in text
    refused("GF2002", lambda: system().bind("wt.wind", Series("wind", value, dt=0.05)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "spacing dt > 0"),
        ({"dt": -0.1}, "spacing dt > 0 from t0; got -0.1"),
        ({"dt": math.nan}, "spacing dt > 0"),
        ({"dt": 0.1, "interpolation": "cubic"}, "linear, pchip or hold; got 'cubic'"),
        ({"dt": 0.1, "on_end": "stop"}, "error, hold or repeat; got 'stop'"),
        ({"dt": 0.1, "value": np.zeros(0)}, "one row of numbers; got shape (0,)"),
        ({"dt": 0.1, "value": np.zeros((2, 2))}, "one row of numbers"),
        ({"dt": 0.1, "value": np.array([1.0, math.nan])}, "value number 1 is not finite"),
        ({"time": np.arange(3.0), "value": np.zeros(2)}, "3 times for 2 values"),
        ({"time": np.array([0.0, 2.0, 2.0]), "value": np.zeros(3)}, "finite and increasing"),
        ({"time": np.array([0.0, math.inf]), "value": np.zeros(2)}, "finite and increasing"),
    ],
)
def test_series_that_cannot_be_meant(arguments: dict[str, Any], message: str) -> None:
    text = refused("GF2013", lambda: Series("site wind", 8.0, **arguments))
    assert "series 'site wind'" in text
    assert message in text


def test_series_that_can() -> None:
    Series("uniform, from a reader", 8.0, dt=0.05)
    Series("stamped, from a reader", 8.0, time=np.empty(0), t_end=10.0)
    Series("uniform", 8.0, t0=-1.0, dt=0.05, value=np.ones(3), interpolation="hold", on_end="repeat")
    Series("stamped", 8.0, time=np.array([0.0, 0.5]), value=np.ones(2))


def test_scheduled_changes() -> None:
    s = system()
    s.change(30, "wt.P", 4e6)
    s.change(10.0, "wt[2].controller.K", 0)
    assert s.schedule == [Change(30.0, "wt.P", 4e6), Change(10.0, "wt[2].controller.K", 0.0)]


@pytest.mark.parametrize(
    ("code", "change", "message"),
    [
        ("GF2007", (1.0, "wd.P", 1.0), "no component 'wd'"),
        ("GF2008", (1.0, "wt.Q", 1.0), "no parameter 'Q'"),
        ("GF2008", (1.0, "wt", 1.0), "no parameter ''"),
        ("GF2008", (1.0, "wt.controler.K", 1.0), "no part 'controler' — try controller"),
        ("GF2008", (1.0, "wt.P.K", 1.0), "no part 'P'"),
        ("GF2008", (1.0, "wt.grid", 1.0), "no parameter 'grid'"),
        ("GF2008", (1.0, "wt.order", 1), "wt.order cannot change while the model runs"),
        ("GF2003", (1.0, "wt.controller.K", -1.0), "wt.controller.K must be at least 0 (gain, 1); got -1"),
        ("GF2002", (1.0, "wt.P", math.nan), "wt.P must be a finite number"),
        ("GF2001", (1.0, "wt.P", "5 MW"), "wt.P must be a number in W"),
        ("GF2002", (math.nan, "wt.P", 1.0), "the time of a change of wt.P must be finite"),
    ],
)
def test_scheduled_changes_refused(code: str, change: tuple[Any, str, Any], message: str) -> None:
    assert message in refused(code, lambda: system().change(*change))


def test_long_lists_of_suggestions_are_cut() -> None:
    s = System()
    for k in range(100):
        s.add(f"wt[{k}]", Machine())
    text = refused("GF2007", lambda: s.split("grid"))
    assert len(text) < 200
    assert text.endswith(", ...")

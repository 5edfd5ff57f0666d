"""Scenarios that are wrong: each fault with its code and its place in the file, several in one go."""

from __future__ import annotations

from pathlib import Path

import pytest

from gustform.language.errors import GustformError
from gustform_cli import document
from gustform_cli.assemble import assemble
from gustform_cli.errors import ErrorList

# One line for each thing, so that places are easy to count.
GOOD = """\
name: case
components:
  bus: {type: Bus, voltage: 33 kV}
  sg: {type: SynchronousGenerator, at: bus, governor: {type: TGOV1, droop: 5 %}}
  wt: {type: PmsgTurbine, at: bus, aggregate: 10, rotor: {radius: 63 m}}
  load: {type: ConstantPowerLoad, at: bus, active: 100 MW}
frame: sg
wind:
  wt: {type: constant, speed: 8 m/s}
events:
  - {at: 30 s, set: {load.active: 120 MW}}
run: {until: 90 s}
output: {every: 20 ms, channels: [wt.*]}
"""


def faults(text: str, *overrides: str, file: str = "s.yaml") -> list[GustformError]:
    """What is wrong with a scenario, in the order of the file."""
    try:
        assemble(document.parse(text, file, overrides))
    except ErrorList as several:
        return list(several.errors)
    except GustformError as error:
        return [error]
    return []


def changed(old: str, new: str) -> str:
    assert old in GOOD
    return GOOD.replace(old, new)


def test_the_good_one_is_good() -> None:
    assert faults(GOOD) == []


@pytest.mark.parametrize(
    ("old", "new", "code", "place", "part"),
    [
        # keys and shapes
        ("name: case", "name: case\nfidelty: rms", "GF2201", "2:1", "'fidelty'"),
        ("name: case", "name: 3", "GF2203", "1:7", "text"),
        ("name: case", "name: ''", "GF2003", "1:7", "empty"),
        ("run: {until: 90 s}", "run: {until: 90 s, rtoll: 1e-6}", "GF2201", "12:20", "'rtoll'"),
        ("run: {until: 90 s}", "run: {}", "GF2202", "12:6", "run.until"),
        ("run: {until: 90 s}", "run: 90 s", "GF2203", "12:6", "a mapping"),
        ("[wt.*]", "wt.*", "GF2203", "13:34", "a list"),
        ("[wt.*]", "[]", "GF2003", "13:34", "at least 1"),
        ("name: case", "name: case\nfidelity: exact", "GF2204", "2:11", "'exact'"),
        ("name: case", "name: case\nturbines: 0", "GF2003", "2:11", "turbines"),
        ("name: case", "name: case\nturbines: 2.5", "GF2203", "2:11", "whole number"),
        # names
        ("  bus: {", "  'b us': {", "GF2205", "3:3", "'b us'"),
        ("  load: {", "  'a\"; system(\"ls': {", "GF2205", "6:3", "letters"),
        ("  load: {", "  2nd: {", "GF2205", "6:3", "digit"),
        # units
        ("active: 100 MW", "active: 100", "GF2301", "6:52", "load.active"),
        ("active: 100 MW", "active: 5 m", "GF2302", "6:52", "'5 m'"),
        ("active: 100 MW", "active: 5 MWh", "GF2302", "6:52", "'5 MWh'"),
        ("active: 100 MW", "active: 5 mw", "GF2303", "6:52", "'mw'"),
        ("active: 100 MW", "active: lots", "GF2001", "6:52", "'lots'"),
        ("active: 100 MW", "active: [1]", "GF2001", "6:52", "[1]"),
        ("active: 100 MW", "active: .nan", "GF2002", "6:52", "nan"),
        ("active: 100 MW", "active: .inf MW", "GF2002", "6:52", "finite"),
        ("speed: 8 m/s", "speed: 8", "GF2301", "9:31", "wind.wt.speed"),
        ("until: 90 s", "until: 90 m", "GF2302", "12:14", "run.until"),
        # ranges
        ("until: 90 s", "until: -90 s", "GF2003", "12:14", "greater than 0"),
        ("voltage: 33 kV", "voltage: 0 V", "GF2003", "3:29", "greater than 0"),
        ("radius: 63 m", "radius: -63 m", "GF2003", "5:67", "wt.rotor.radius"),
        ("droop: 5 %", "droop: 0", "GF2003", "4:76", "sg.governor.droop"),
        ("aggregate: 10", "aggregate: 0", "GF2003", "5:47", "from 1 on"),
        ("aggregate: 10", "aggregate: many", "GF2003", "5:47", "'many'"),
        ("aggregate: 10", "aggregate: turbines", "GF2202", "5:47", "turbines must be given"),
        ("aggregate: 10", "curtailment: 99 %", "GF2003", "5:49", "at most 0.95"),
        # types and parts
        ("type: Bus", "type: Buss", "GF2012", "3:15", "'Buss'"),
        ("type: Bus", "type: os.system", "GF2012", "3:15", "'os.system'"),
        ("type: TGOV1", "type: SEXS", "GF1007", "4:62", "a Governor"),
        ("type: TGOV1", "type: TGOV2", "GF2012", "4:62", "'TGOV2'"),
        ("radius: 63 m", "raduis: 63 m", "GF2402", "5:59", "'raduis'"),
        ("rotor: {radius: 63 m}", "rotor: 7", "GF2203", "5:58", "a mapping"),
        ("rotor: {radius: 63 m}", "rotor: {type: TableRotor}", "GF2004", "5:58", "wt.rotor.cp"),
        ("rotor: {radius: 63 m}", "rotor: {type: TableRotor, cp: no.txt}", "GF2030", "5:81", "no.txt"),
        # how things hang together
        ("type: ConstantPowerLoad, at: bus", "type: ConstantPowerLoad, at: buss", "GF2007", "6:39", "'buss'"),
        ("type: ConstantPowerLoad, at: bus, ", "type: ConstantPowerLoad, ", "GF3003", "6:9", "load.terminal"),
        ("type: ConstantPowerLoad, at: bus", "type: ConstantPowerLoad, from: bus, to: bus", "GF2403", "6:41", "by at"),
        ("type: ConstantPowerLoad, at: bus", "type: Line, at: bus, R: 1 ohm, X", "GF2402", "6:44", "'active'"),
        ("frame: sg", "frame: load", "GF2204", "7:8", "a machine"),
        ("frame: sg", "frame: sgg", "GF2007", "7:8", "'sgg'"),
        ("frame: sg\n", "", "GF2202", "4:7", "frame"),
        ("frame: sg", "connections: [[wt.grid, wt.grid]]\nframe: sg", "GF3002", "7:15", "itself"),
        ("frame: sg", "connections: [[wt.grid, load.tap]]\nframe: sg", "GF2008", "7:15", "'tap'"),
        ("frame: sg", "connections: [[wt.grid, away.terminal]]\nframe: sg", "GF2007", "7:25", "'away'"),
        ("frame: sg", "connections: [[wt.grid]]\nframe: sg", "GF2003", "7:15", "2 entries"),
        # wind
        ("  wt: {type: constant, speed: 8 m/s}", "  {}", "GF2404", "5:7", "wind.wt must be given"),
        ("  wt: {type: constant", "  load: {type: constant", "GF2404", "5:7", "wind.wt must be given"),
        ("  wt: {type: constant", "  wtt: {type: constant", "GF2404", "5:7", "wind.wt"),
        ("type: constant", "type: breeze", "GF2204", "9:14", "'breeze'"),
        ("{type: constant, speed: 8 m/s}", "{speed: 8 m/s}", "GF2202", "9:7", "wind.wt.type"),
        ("{type: constant, speed: 8 m/s}", "8 m/s", "GF2203", "9:7", "a mapping"),
        ("speed: 8 m/s", "speed: 8 m/s, gust: 3", "GF2201", "9:38", "'gust'"),
        ("speed: 8 m/s", "speed: 1 m/s", "GF2020", "5:7", "cut-in"),
        ("{type: constant, speed: 8 m/s}", "{type: turbulence, mean: 8 m/s, class: D}", "GF2204", "9:46", "A, B or C"),
        ("{type: constant, speed: 8 m/s}", "{type: turbulence, mean: 8 m/s, seed: -1}", "GF2003", "9:45", "seed"),
        ("{type: constant, speed: 8 m/s}", "{type: file, path: no.csv}", "GF2501", "no.csv", "readable"),
        # events
        ("load.active: 120 MW", "load.activ: 120 MW", "GF2405", "11:22", "'activ'"),
        ("load.active: 120 MW", "load: 120 MW", "GF2405", "11:22", "component.parameter"),
        ("load.active: 120 MW", "lode.active: 120 MW", "GF2007", "11:22", "'lode'"),
        ("load.active: 120 MW", "wt.gear.ratio: 3", "GF2405", "11:22", "'gear'"),
        ("load.active: 120 MW", "load.active: 120", "GF2301", "11:35", "load.active"),
        ("load.active: 120 MW", "bus.voltage: -1 V", "GF2003", "11:35", "bus.voltage"),
        ("{at: 30 s, set", "{when: 30 s, set", "GF2202", "11:5", "events[0].at"),
        ("set: {load.active: 120 MW}", "set: {}", "GF2003", "11:21", "at least 1"),
    ],
)
def test_each_fault_has_its_code_and_place(old: str, new: str, code: str, place: str, part: str) -> None:
    errors = faults(changed(old, new))
    found = [error for error in errors if error.code == code]
    assert found, [str(error) for error in errors]
    error = next((error for error in found if part in error.message), found[0])
    assert part in error.message
    assert error.hint, "one thing to try"
    assert error.place is not None
    if not place[0].isdigit():
        assert place in error.place.file
    else:
        assert f"{error.place.line}:{error.place.column}" == place


def test_several_faults_are_told_at_once_in_the_order_of_the_file() -> None:
    text = changed("active: 100 MW", "active: 5 m").replace("radius", "raduis").replace("until: 90 s", "until: 90")
    assert [error.code for error in faults(text)] == ["GF2402", "GF2302", "GF2301"]


def test_misspelt_names_get_a_proposal() -> None:
    (error,) = faults(changed("type: PmsgTurbine", "type: pmsgturbine"))
    assert error.hint == "PmsgTurbine"
    (error,) = faults(changed("active: 100 MW", "activ: 100 MW"))
    assert "active" in error.hint


def test_faults_of_an_override_name_it() -> None:
    (error,) = faults(GOOD, "load.active=5 m")
    assert str(error.place) == "--set load.active=5 m"
    (error,) = faults(GOOD, "wt.contrl.K_gsc=0.6")
    assert str(error.place) == "--set wt.contrl.K_gsc=0.6"


def test_overrides_reach_parts_that_the_file_does_not_mention() -> None:
    read = assemble(document.parse(GOOD, "s.yaml", ["wt.control.K_gsc=0.6", "wt.dc_link.C=30 mF"]))
    assert read.system.components["wt"].part("control").value("K_gsc") == 0.6
    assert read.system.components["wt"].part("dc_link").value("C") == 0.03


def test_what_follows_from_the_rest_of_the_scenario() -> None:
    system = assemble(document.parse(GOOD, "s.yaml", ["bus.voltage=20 kV", "wind.wt.speed=9 m/s"])).system
    assert system.components["wt"].value("voltage") == 20e3, "the bus's"
    assert system.components["wt"].value("wind_speed") == 9.0, "that of its wind"
    system = assemble(document.parse(GOOD, "s.yaml", ["wt.wind_speed=7 m/s"])).system
    assert system.components["wt"].value("wind_speed") == 7.0, "what is written stands"
    assert system.signals["wt.frame"] == "sg.omega"


FARM = GOOD.replace("aggregate: 10", "count: turbines").replace("name: case", "name: case\nturbines: 3")


def test_a_counted_component_stands_there_several_times() -> None:
    assembled = assemble(document.parse(FARM, "s.yaml"))
    names = [name for name in assembled.system.components if name.startswith("wt")]
    assert names == ["wt[1]", "wt[2]", "wt[3]"]
    assert ("wt[3].grid", "bus.terminal") in assembled.system.connections
    more = assemble(document.parse(FARM, "s.yaml", ["turbines=5"]))
    assert more.instances("wt")[-1] == "wt[5]"


def test_each_counted_turbine_has_its_own_wind() -> None:
    text = FARM.replace("{type: constant, speed: 8 m/s}", "{type: turbulence, mean: 8 m/s, seed: 4}")
    assembled = assemble(document.parse(text, "s.yaml"))
    first = {name: reader(0, 2)[1].tolist() for name, reader in assembled.readers.items()}
    assert len(first) == 3
    assert len({tuple(values) for values in first.values()}) == 3
    more = assemble(document.parse(text, "s.yaml", ["turbines=5"]))
    for name, values in first.items():
        assert more.readers[name](0, 2)[1].tolist() == values, "a larger farm leaves the others' wind as it was"


def test_counted_components_connect_one_to_one() -> None:
    text = FARM.replace(
        "  load:", "  tie: {type: Bus, count: turbines}\n  line: {type: Line, count: 3, from: tie, to: bus}\n  load:"
    ).replace("PmsgTurbine, at: bus", "PmsgTurbine, at: tie")
    system = assemble(document.parse(text, "s.yaml")).system
    assert ("wt[2].grid", "tie[2].terminal") in system.connections
    assert ("line[2].sending", "tie[2].terminal") in system.connections
    assert ("line[2].receiving", "bus.terminal") in system.connections
    (error,) = faults(text.replace("Line, count: 3", "Line, count: 2"))
    assert error.code == "GF2403"
    assert "equal numbers" in error.message


def test_events_reach_all_or_one_of_counted_components() -> None:
    text = FARM.replace("load.active: 120 MW", "wt.control.K_gsc: 0.6, 'wt[2].control.K_q_gsc': 0.03")
    paths = [change.path for change in assemble(document.parse(text, "s.yaml")).system.schedule]
    assert paths == ["wt[1].control.K_gsc", "wt[2].control.K_gsc", "wt[3].control.K_gsc", "wt[2].control.K_q_gsc"]
    (error,) = faults(FARM.replace("load.active: 120 MW", "'wt[9].control.K_gsc': 0.6"))
    assert error.code == "GF2007"


def test_a_wind_file_is_found_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "wind.csv").write_text("t,v\n0,8\n50,9\n")
    text = changed("{type: constant, speed: 8 m/s}", "{type: file, path: wind.csv, columns: {time: t, speed: v}}")
    (error,) = faults(text, file=str(tmp_path / "s.yaml"))
    assert error.code == "GF2506"
    assert "it ends at 50 s" in error.message
    (error,) = faults(text.replace("wind.csv", "no.csv"), file=str(tmp_path / "s.yaml"))
    assert error.code == "GF2501"
    assert error.place is not None
    assert error.place.file == str(tmp_path / "no.csv")
    held = text.replace("path: wind.csv", "path: wind.csv, on_end: hold")
    assert faults(held, file=str(tmp_path / "s.yaml")) == []
    assembled = assemble(document.parse(held, str(tmp_path / "s.yaml")))
    assert assembled.system.components["wt"].value("wind_speed") == 8.5, "the mean of the file as far as it goes"
    assert ["ends at 50 s" in text for text in assembled.warnings] == [True]
    stated = assemble(document.parse(held, str(tmp_path / "s.yaml"), ["wt.wind_speed=7 m/s"]))
    assert stated.system.components["wt"].value("wind_speed") == 7.0
    (error,) = faults(text.replace("path: wind.csv", "path: wind.csv, units: {time: m}"), file=str(tmp_path / "s.yaml"))
    assert error.code == "GF2303"

"""One scenario of a power plant in all fidelities, and what it may say about the plant's parts."""

from __future__ import annotations

import pytest

from gustform_cli import document
from gustform_cli.assemble import assemble
from gustform_cli.errors import ErrorList

SCENARIO = """\
name: plant
fidelity: FIDELITY
components:
  bus: {type: Bus, voltage: 33 kV}
  load: {type: ConstantPowerLoad, at: bus, active: 100 MW}
  sg: {type: SynchronousGenerator, at: bus, PARTS}
frame: sg
run: {until: 1 s}
"""
FULL, SIMPLE = ["Machine6", "TGOV1", "SEXS"], ["ClassicalMachine", "FirstOrderGovernor", "ConstantField"]


def parts(fidelity: str, given: str) -> list[str]:
    """Types of machine, governor and exciter."""
    text = SCENARIO.replace("FIDELITY", fidelity).replace("PARTS", given)
    generator = assemble(document.parse(text, "plant.yaml")).system.components["sg"]
    return [type(generator.part(name)).__name__ for name in ("machine", "governor", "exciter")]


@pytest.mark.parametrize("fidelity", ["lossless", "rms", "dq"])
@pytest.mark.parametrize(
    ("given", "at_lossless"),
    [
        ("machine: {H: 8 s}, governor: {droop: 4 %}", SIMPLE),
        ("governor: {type: TGOV1, droop: 5 %}", ["ClassicalMachine", "TGOV1", "ConstantField"]),
        ("governor: {type: TGOV1, droop: 5 %}, exciter: {type: SEXS}", FULL),
        ("exciter: {K: 100}", ["Machine6", "FirstOrderGovernor", "SEXS"]),
    ],
)
def test_the_same_scenario_stands_in_every_fidelity(fidelity: str, given: str, at_lossless: list[str]) -> None:
    assert parts(fidelity, given) == (at_lossless if fidelity == "lossless" else FULL)


@pytest.mark.parametrize("fidelity", ["lossless", "rms"])
def test_named_parts_stand_in_every_fidelity(fidelity: str) -> None:
    given = "machine: ClassicalMachine, governor: FirstOrderGovernor"
    assert parts(fidelity, given) == SIMPLE


@pytest.mark.parametrize(
    ("given", "code", "words"),
    [
        ("machine: ClassicalMachine, exciter: SEXS", "GF2060", "the voltage of a ClassicalMachine is constant"),
        ("machine: ClassicalMachine, exciter: {K: 100}", "GF1004", "ConstantField has no parameter 'K'"),
        ("machine: TGOV1", "GF1007", "sg.machine must be a SynchronousMachine"),
        ("machine: {xd1: 2}", "GF2061", "machine.xd must be at least xd1 = 2"),
    ],
)
def test_parts_that_do_not_go_together_are_refused_with_their_line(given: str, code: str, words: str) -> None:
    with pytest.raises(ErrorList) as caught:
        parts("rms", given)
    (error,) = caught.value.errors
    assert error.code == code
    assert words in error.message
    assert error.place is not None
    assert error.place.line == 6

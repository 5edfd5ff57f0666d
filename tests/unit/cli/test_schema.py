"""The JSON schema that editors complete from: current, valid, and of one mind with the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from gustform_cli import document
from gustform_cli.new import SCENARIOS
from gustform_cli.schema import FILE, scenario_schema, schema_text

SHIPPED = sorted(SCENARIOS.glob("*.yaml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json.loads(FILE.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def complaints(schema: dict[str, Any], text: str) -> list[str]:
    plain = document.parse(text, "s.yaml").plain()
    return [error.message for error in jsonschema.Draft202012Validator(schema).iter_errors(plain)]


def test_the_file_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == schema_text(), "python -m gustform_cli.schema"


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(scenario_schema())


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_scenarios_are_valid(schema: dict[str, Any], file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    assert complaints(schema, text) == []
    line = text.splitlines()[0]
    assert line.startswith("# yaml-language-server: $schema=")
    assert (file.parent / line.partition("$schema=")[2]).resolve() == FILE


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("active: 100 MW", "active: 100"),
        ("active: 100 MW", "activ: 100 MW"),
        ("type: Bus", "type: Buss"),
        ("fidelity: rms", "fidelity: exact"),
        ("until: 90 s", "until: 90"),
        ("droop: 5 %", "droop: 0"),
        ("aggregate: 10", "aggregate: 0"),
        ("type: constant", "type: breeze"),
        ("rtol: 1e-6", "rtoll: 1e-6"),
    ],
)
def test_it_refuses_what_the_command_refuses(schema: dict[str, Any], old: str, new: str) -> None:
    text = (SCENARIOS / "load_step_8ms.yaml").read_text(encoding="utf-8")
    assert old in text
    assert complaints(schema, text.replace(old, new))


def test_every_parameter_says_what_it_is(schema: dict[str, Any]) -> None:
    for name, definition in schema["$defs"].items():
        if name.startswith(("component ", "part ")):
            for key, entry in definition["properties"].items():
                assert key == "type" or entry["description"], f"{name}: {key}"
    turbine = schema["$defs"]["component PmsgTurbine"]["properties"]
    assert "[VA; default 5e+06; > 0]" in turbine["rating"]["description"]

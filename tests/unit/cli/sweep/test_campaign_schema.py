from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML

from gustform_cli.new import SCENARIOS
from gustform_cli.sweep.plan import plan
from gustform_cli.sweep.schema import FILE, schema_text

SHIPPED = sorted((SCENARIOS / "campaigns").glob("*.yaml"))


@pytest.fixture(scope="module")
def schema() -> Any:
    return json.loads(FILE.read_text(encoding="utf-8"))


def test_the_file_is_current() -> None:
    assert FILE.read_text(encoding="utf-8") == schema_text(), "python -m gustform_cli.sweep.schema"


def test_it_is_a_schema(schema: Any) -> None:
    jsonschema.Draft202012Validator.check_schema(schema)


def test_there_is_a_shipped_campaign() -> None:
    assert SHIPPED


@pytest.mark.parametrize("file", SHIPPED, ids=lambda path: path.stem)
def test_shipped_campaigns_are_valid(schema: Any, file: Path) -> None:
    jsonschema.validate(YAML(typ="safe", pure=True).load(file), schema)
    assert "campaign.schema.json" in file.read_text(encoding="utf-8").splitlines()[0]
    assert plan(file).cases


@pytest.mark.parametrize(
    "wrong",
    [
        {"axes": [{"type": "grid"}]},
        {"axes": [{"type": "lists", "values": {"a": [1]}}]},
        {"axes": [{"type": "latin_hypercube", "n": 0, "ranges": {"a": {"from": 1, "to": 2}}}]},
        {"wind": {"DLC": "1.3"}},
        {"wind": {"n_seed": 3}},
        {"keep": "some"},
        {"scalar": ["*"]},
    ],
    ids=str,
)
def test_it_refuses_what_the_command_refuses(schema: Any, wrong: dict[str, Any]) -> None:
    good = {"name": "a", "base": "b.yaml"}
    jsonschema.validate(good, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**good, **wrong}, schema)

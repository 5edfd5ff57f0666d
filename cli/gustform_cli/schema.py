"""The JSON schema of a scenario, for editors: the models of `scenario.py` with every component type and its
parameters, units and sentences from the declarations.

    python -m gustform_cli.schema            writes scenario.schema.json beside this file
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from gustform.language.component import Component
from gustform.language.declare import Parameter, Part, Table
from gustform.registry import PARTS, UNITS, Unit
from gustform_cli.catalogue import choices, part_types, short_names
from gustform_cli.fields import NAME_PATTERN, QUANTITY_PATTERN
from gustform_cli.info import default_text, range_text, sentence
from gustform_cli.quantity import is_plain
from gustform_cli.scenario import Scenario

FILE = Path(__file__).with_name("scenario.schema.json")


def scenario_schema() -> dict[str, Any]:
    """The schema as a JSON object (draft 2020-12)."""
    fixed = tidy(Scenario.model_json_schema(by_alias=True))
    definitions: dict[str, Any] = fixed.pop("$defs")
    placing = definitions.pop("ComponentEntry")["properties"]
    definitions["quantity"] = {"type": "string", "pattern": QUANTITY_PATTERN}
    for name, kind in part_types().items():
        definitions[f"part {name}"] = _type_schema(name, kind, None, {})
    for name, unit in UNITS.items():
        definitions[f"component {name}"] = _type_schema(name, unit.kind, unit, placing)
    components = fixed["properties"]["components"]
    units = [{"$ref": f"#/$defs/component {name}"} for name in UNITS]
    components["patternProperties"] = {NAME_PATTERN: {"anyOf": units}}
    for names in (components, fixed["properties"]["wind"]):
        names["additionalProperties"] = False
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gustform scenario",
        **fixed,
        "$defs": dict(sorted(definitions.items())),
    }


def tidy(node: Any) -> Any:
    """pydantic's schema without titles, nulls for what may be left out, and defaults that are numbers in SI where
    the file has text with a unit."""
    if isinstance(node, list):
        return [tidy(item) for item in node]
    if not isinstance(node, dict):
        return node
    result = {key: tidy(value) for key, value in node.items() if not (key == "title" and isinstance(value, str))}
    options = [option for option in result.get("anyOf", []) if option != {"type": "null"}]
    if len(options) == 1:
        del result["anyOf"]
        result = {**options[0], **result}
    elif options:
        result["anyOf"] = options
    if result.get("default", 0) is None or ("pattern" in result and isinstance(result.get("default"), float)):
        del result["default"]
    return result


def _type_schema(name: str, kind: type[Component], unit: Unit | None, placing: dict[str, Any]) -> dict[str, Any]:
    """One component type; as a unit of a system it has the keys of `placing` that its terminals ask for."""
    properties: dict[str, Any] = {"type": {"const": name}}
    if unit is not None:
        for key in ("at",) if unit.at else ("from", "to") if unit.ends else ():
            properties[key] = placing[key]
        properties["count"] = placing["count"]
    for key, parameter in kind.declared(Parameter).items():
        properties[key] = placing[key] if key == "aggregate" and unit is not None else _parameter_schema(parameter)
    for key, table in kind.declared(Table).items():
        if name in PARTS and key in PARTS[name].tables:
            properties[key] = {
                "type": "string",
                "description": f"{table.description}: a file, relative to the scenario",
            }
    for key, part in kind.declared(Part).items():
        options: list[dict[str, Any]] = [{"$ref": f"#/$defs/part {choice}"} for choice in choices(part)]
        if part.base is not None:
            options.append({"enum": [*choices(part), *short_names(part)]})
        properties[key] = {"description": part.description, "anyOf": options}
    needed = [
        key for key, parameter in kind.declared(Parameter).items() if parameter.default is None and not parameter.free
    ]
    if unit is not None:
        needed.insert(0, "type")
    schema: dict[str, Any] = {
        "type": "object",
        "description": sentence(kind),
        "properties": properties,
        "additionalProperties": False,
    }
    if needed:
        schema["required"] = needed
    return schema


def _parameter_schema(parameter: Parameter) -> dict[str, Any]:
    """One parameter: its sentence, unit, default and range; a quantity is text with a unit."""
    notes = [parameter.unit, f"default {default_text(parameter)}", range_text(parameter)]
    description = f"{parameter.description} [{'; '.join(note for note in notes if note)}]"
    if parameter.structural and isinstance(parameter.default, bool):
        return {"type": "boolean", "description": description}
    if parameter.choices:
        return {"enum": list(parameter.choices), "description": description}
    if parameter.structural and isinstance(parameter.default, str):
        return {"type": "string", "description": description}
    if not is_plain(parameter.unit):
        return {"$ref": "#/$defs/quantity", "description": description}
    number: dict[str, Any] = {"type": "number"}
    for key, bound in (
        ("minimum", parameter.min),
        ("exclusiveMinimum", parameter.above),
        ("maximum", parameter.max),
    ):
        if bound is not None:
            number[key] = bound
    return {"anyOf": [number, {"$ref": "#/$defs/quantity"}], "description": description}


def schema_text() -> str:
    """The schema as it stands in the file."""
    # One item a line shows what changes; the blanks in front would be a fifth of the file.
    return json.dumps(scenario_schema(), indent=0, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the file."""
    FILE.write_text(schema_text(), encoding="utf-8")
    print(FILE)


if __name__ == "__main__":
    main()

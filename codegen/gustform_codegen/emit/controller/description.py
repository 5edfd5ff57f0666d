"""<name>.json: every signal and parameter with a stable id, unit, range, default and sentence."""

from __future__ import annotations

import json
import math
import zlib
from typing import Any

from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.c_header import Names, errors_of, members
from gustform_codegen.emit.controller.program import Program
from gustform_codegen.emit.controller.signals import Signal


def stable_id(kind: str, name: str) -> int:
    """A 16-bit id that depends on the kind and the name alone: it survives what is added or left out beside it."""
    return zlib.crc32(f"{kind}:{name}".encode()) & 0xFFFF


def describe(program: Program, names: Names) -> dict[str, Any]:
    """The description as plain data. GF4103 if two ids are the same."""
    block, step = program.step.block, program.step
    result: dict[str, Any] = {
        "format": "gustform controller 1",
        "name": names.prefix,
        "control": block.name,
        "description": block.description,
        "period_s": step.period,
        "method": step.method.value,
        "real": "double" if names.double else "float",
        "prewarped_rad_per_s": step.prewarped,
    }
    taken: dict[int, str] = {}
    for kind, (member, signals) in members(program).items():
        entries = []
        for position, s in enumerate(signals):
            number = stable_id(kind, s.name)
            if number in taken:
                raise GustformError("GF4103", f"{s.name} and {taken[number]} have the same id", hint="another name")
            taken[number] = s.name
            entries.append(_entry(s, number, member, position))
        result[kind] = entries
    result["states"] = [
        {"name": s.name, "unit": s.unit, "description": s.description, "start": s.value} for s in block.states
    ]
    result["tables"] = [
        {
            "name": g.name,
            "unit": g.declared.unit,
            "description": g.declared.description,
            "x": [g.spline["x_start"], g.x_end],
            "y": [g.spline["y_start"], g.y_end],
            "coefficients": int(g.spline["coefficient"].size),
        }
        for g in block.tables
    ]
    result["errors"] = [{"name": name, "mask": mask, "description": text} for mask, name, text in errors_of(program)]
    return result


def _entry(s: Signal, number: int, member: str, position: int) -> dict[str, Any]:
    return {
        "id": number,
        "name": s.name,
        "c": f"{member}.{s.name}",
        "position": position,
        "unit": s.unit,
        "description": s.description,
        "min": s.low if math.isfinite(s.low) else None,
        "min_excluded": s.exclusive,
        "max": s.high if math.isfinite(s.high) else None,
        "default": s.value,
        "nominal": s.nominal,
    }


def as_json(program: Program, names: Names) -> str:
    """The description as a file."""
    return json.dumps(describe(program, names), indent=2, ensure_ascii=False) + "\n"

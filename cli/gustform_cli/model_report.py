"""The report of `gustform check`."""

from __future__ import annotations

import json

from gustform_cli.model import Model
from gustform_codegen.report import ModelReport


def as_json(report: ModelReport, model: Model) -> str:
    """The report for programs."""
    return json.dumps(
        {
            **report.as_dict(),
            "compiled_types": model.built.compilations,
            "build_seconds": model.built.seconds,
            "channels": len(model.channels),
            "scenario_warnings": model.assembled.warnings,
        },
        indent=2,
    )


def as_text(report: ModelReport, model: Model) -> str:
    """The report for people."""
    head = (
        "type", "instances", "equations", "aliases", "substituted", "states", "iterated", "nonzeros", "crossings",
    )  # fmt: skip
    rows = [
        (
            t.name, t.instances, t.declared_equations, t.aliases, t.substituted, t.states, t.iteration_variables,
            t.nonzeros, t.zero_crossings,
        )
        for t in report.types
    ]  # fmt: skip
    width = [max(len(str(row[k])) for row in [head, *rows]) for k in range(len(head))]
    lines = [
        "  ".join(
            str(cell).ljust(w) if k == 0 else str(cell).rjust(w)
            for k, (cell, w) in enumerate(zip(row, width, strict=True))
        )
        for row in [head, *rows]
    ]
    scenario = model.assembled.scenario
    lines = [scenario.name, "", *lines, ""]
    lines += [
        f"{report.instances} units; {report.unknowns} unknowns, of which {report.states} states and",
        f"    {report.connection_unknowns} at connections; {report.equations} equations, {report.nonzeros} nonzeros",
        f"structure: {report.structure}",
        f"inputs: {report.inputs}, of which series: {report.series}; scheduled changes: {report.scheduled_changes}",
        f"channels recorded: {len(model.channels)}",
        f"compiled now: {model.built.compilations} of {len(report.types)} types, built in {model.built.seconds:.2f} s",
    ]
    lines += [f"warning: {warning}" for warning in report.warnings]
    return "\n".join(lines)

"""What is said at the end of a sweep, for people and as JSON."""

from __future__ import annotations

import json

from gustform_cli.progress import clock
from gustform_cli.sweep.execute import Swept

_MOST_SHOWN = 10  # failures; all of them are in the table


def status(swept: Swept) -> str:
    """interrupted, failed (at least one case) or completed."""
    if swept.missing:
        return "interrupted"
    return "failed" if swept.failures else "completed"


def failure_lines(swept: Swept) -> list[str]:
    """Each case that failed with its reason; after the tenth, how many more."""
    lines = []
    for case, record in swept.failures[:_MOST_SHOWN]:
        fault = record.fault
        lines.append(f"{case.text()}: {fault.error() if fault is not None else 'failed'}")
    if len(swept.failures) > _MOST_SHOWN:
        lines.append(f"... and {len(swept.failures) - _MOST_SHOWN} more: column `error` of {swept.table}")
    return lines


def as_text(swept: Swept) -> str:
    """A few lines."""
    parts = [f"{swept.ran} run now"]
    if swept.kept:
        parts.append(f"{swept.kept} from before")
    if swept.failures:
        parts.append(f"{len(swept.failures)} failed")
    if swept.missing:
        parts.append(f"{swept.missing} not run")
    rate = f", {swept.ran / swept.run_seconds:.3g} cases a second" if swept.ran and swept.run_seconds > 0.0 else ""
    return "\n".join(
        [
            f"{swept.plan.campaign.name}: {len(swept.plan.cases)} cases, {', '.join(parts)}",
            f"checked in {clock(swept.check_seconds)}, ran for {clock(swept.run_seconds)}{rate}",
            f"table    {swept.table}",
        ]
    )


def as_json(swept: Swept) -> str:
    """The same for programs."""
    return json.dumps(
        {
            "status": status(swept),
            "name": swept.plan.campaign.name,
            "cases": len(swept.plan.cases),
            "ran": swept.ran,
            "kept": swept.kept,
            "failed": len(swept.failures),
            "missing": swept.missing,
            "check_seconds": swept.check_seconds,
            "run_seconds": swept.run_seconds,
            "table": str(swept.table),
            "failures": [
                {
                    "case": case.number,
                    "values": dict(case.labels),
                    "code": record.fault.code if record.fault is not None else None,
                    "message": record.fault.message if record.fault is not None else None,
                }
                for case, record in swept.failures
            ],
        },
        indent=2,
    )

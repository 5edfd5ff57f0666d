"""The last words of a run: where things are, and the numbers a reader looks for."""

from __future__ import annotations

import json

from gustform_cli.progress import times
from gustform_cli.simulate import Outcome


def summary_json(outcome: Outcome) -> str:
    """The summary as on disk, with the paths of the files."""
    paths = {"result": str(outcome.result), "summary": str(outcome.summary_file)}
    if outcome.figure is not None:
        paths["figure"] = str(outcome.figure)
    return json.dumps({**outcome.summary.as_dict(), "paths": paths}, indent=2)


def closing_lines(outcome: Outcome) -> str:
    """Paths, then nadir, settling frequency, real-time factor and trips where there are any."""
    summary = outcome.summary
    lines = [f"result   {outcome.result}", f"summary  {outcome.summary_file}"]
    if outcome.figure is not None:
        lines.append(f"figure   {outcome.figure}")
    numbers = []
    frequency = summary.frequency or {}
    if frequency.get("nadir_hz") is not None:
        numbers.append(f"nadir {frequency['nadir_hz']:.3f} Hz at {frequency['nadir_time_s']:.2f} s")
    if frequency.get("settle_hz") is not None:
        numbers.append(f"settling {frequency['settle_hz']:.3f} Hz")
    numbers.append(f"{times(summary.real_time_factor)} x real time")
    numbers += [f"{name} tripped at {time:.2f} s" for name, time in list(summary.trips.items())[:4]]
    if summary.status != "completed":
        numbers.insert(0, f"{summary.status} at {summary.simulated_seconds:.3f} s")
    return "\n".join([*lines, ", ".join(numbers)])

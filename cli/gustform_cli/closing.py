"""The last words of a run: where things are, and the numbers a reader looks for."""

from __future__ import annotations

import json

from gustform_cli.progress import times
from gustform_cli.simulate import Outcome
from gustform_cli.summary import Summary


def summary_json(outcome: Outcome) -> str:
    """The summary as on disk, with the paths of the files."""
    paths = {"result": str(outcome.result), "summary": str(outcome.summary_file)}
    if outcome.figure is not None:
        paths["figure"] = str(outcome.figure)
    return json.dumps({**outcome.summary.as_dict(), "paths": paths}, indent=2)


def closing_lines(outcome: Outcome) -> str:
    """Paths, then what the grid did after an event or, without one, what the turbines delivered; real-time factor;
    trips where there are any."""
    summary = outcome.summary
    lines = [f"result   {outcome.result}", f"summary  {outcome.summary_file}"]
    if outcome.figure is not None:
        lines.append(f"figure   {outcome.figure}")
    numbers = []
    delivered = _delivered(summary) if not summary.events else None
    frequency = (summary.frequency or {}) if delivered is None else {}
    if delivered is not None:
        numbers.append(delivered)
    if frequency.get("nadir_hz") is not None:
        numbers.append(f"nadir {frequency['nadir_hz']:.3f} Hz at {frequency['nadir_time_s']:.2f} s")
    if frequency.get("settle_hz") is not None:
        numbers.append(f"settling {frequency['settle_hz']:.3f} Hz")
    numbers.append(f"{times(summary.real_time_factor)} x real time")
    numbers += [f"{name} tripped at {time:.2f} s" for name, time in list(summary.trips.items())[:4]]
    if summary.status != "completed":
        numbers.insert(0, f"{summary.status} at {summary.simulated_seconds:.3f} s")
    return "\n".join([*lines, ", ".join(numbers)])


def _delivered(summary: Summary) -> str | None:
    """Mean power, energy and capacity factor of all turbines together; None where nobody kept them."""
    turbines = [one for one in summary.statistics.get("energy", {}).values() if one["mean_power_mw"] is not None]
    if not turbines:
        return None
    power, energy = (sum(one[key] for one in turbines) for key in ("mean_power_mw", "energy_mwh"))
    rated = sum(one["rated_power_mw"] for one in turbines)
    return f"mean power {power:.4g} MW, energy {energy:.4g} MWh, capacity factor {100.0 * power / rated:.1f} %"

"""summary.json: how a run ended and what it cost, for people and programs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gustform_cli.writing import write_text

# Counters of the runtime that everybody's summary has; zero when the run never began.
_COUNTERS = (
    "steps",
    "residual_evaluations",
    "jacobian_evaluations",
    "factorisations",
    "error_test_failures",
)
_MORE = (
    "refactorisations",
    "nonlinear_iterations",
    "nonlinear_failures",
    "root_evaluations",
    "events",
    "restarts",
    "initial_iterations",
    "rows",
)
SOLVER_FIGURES = (*_COUNTERS, *_MORE)
_ALWAYS = ("status", "simulated_seconds", "wall_seconds", "build_seconds", "compiled_types", "unknowns")


def write_summary(summary: Summary, folder: Path) -> Path:
    """Write summary.json into a folder; GF7001 if it cannot be written."""
    return write_text(folder / "summary.json", json.dumps(summary.as_dict(), indent=2) + "\n")


def solver_figures(statistics: Mapping[str, int | float]) -> dict[str, int]:
    """The counters of the runtime that go into the summary."""
    figures = {name: int(statistics.get(name, 0)) for name in _COUNTERS}
    figures.update({name: int(statistics[name]) for name in _MORE if name in statistics})
    return figures


@dataclass(frozen=True)
class Summary:
    """status: completed, interrupted or failed. Times in s; `frequency` and `events` only where there is a grid
    frequency. `trips`: when which turbine tripped. `statistics`: further keys, statistics, energy and limits."""

    status: str
    message: str | None
    simulated_seconds: float
    wall_seconds: float
    build_seconds: float
    compiled_types: int
    unknowns: int
    solver: dict[str, int] = field(default_factory=dict)
    frequency: dict[str, float | None] | None = None
    events: Sequence[Mapping[str, Any]] = ()
    trips: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    statistics: Mapping[str, Any] = field(default_factory=dict)

    @property
    def real_time_factor(self) -> float:
        """Simulated over waited time."""
        return self.simulated_seconds / self.wall_seconds if self.wall_seconds > 0.0 else 0.0

    def as_dict(self) -> dict[str, Any]:
        """The keys of summary.json, flat but for `frequency`, `events`, `trips`, `warnings` and what statistics say."""
        result: dict[str, Any] = {
            "status": self.status,
            "simulated_seconds": self.simulated_seconds,
            "wall_seconds": self.wall_seconds,
            "real_time_factor": self.real_time_factor,
            "build_seconds": self.build_seconds,
            "compiled_types": self.compiled_types,
            "unknowns": self.unknowns,
            **self.solver,
        }
        if self.frequency is not None:
            result["frequency"] = self.frequency
        if self.events:
            result["grid_events"] = [dict(event) for event in self.events]
        result.update(self.statistics)
        if self.trips:
            result["trips"] = dict(self.trips)
        if self.message is not None:
            result["message"] = self.message
        if self.warnings:
            result["warnings"] = list(self.warnings)
        return result

    @classmethod
    def from_dict(cls, keys: Mapping[str, Any]) -> Summary:
        """The summary that `as_dict` gave these keys."""
        left = dict(keys)
        left.pop("real_time_factor")
        solver = {name: left.pop(name) for name in SOLVER_FIGURES if name in left}
        known = {name: left.pop(name) for name in _ALWAYS}
        return cls(
            **known,
            solver=solver,
            frequency=left.pop("frequency", None),
            events=left.pop("grid_events", ()),
            trips=left.pop("trips", {}),
            message=left.pop("message", None),
            warnings=tuple(left.pop("warnings", ())),
            statistics=left,
        )

"""A system started from its steady state and followed in double precision, at times of the test's choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gustform.language.system import System
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_codegen.link import Linked
from gustform_codegen.table import SystemTable
from gustform_runtime import Simulation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ready:
    """A linked system with its steady state as start."""

    linked: Linked
    table: SystemTable
    free: Mapping[str, float] = field(default_factory=dict)

    @property
    def numbers(self) -> dict[str, int]:
        """Global unknown by name."""
        return {self.linked.unknown_name(k): k for k in range(self.table.n_unknowns)}

    def moved(self, changes: Mapping[str, float]) -> Ready:
        """The same system with some unknowns moved off their start by so much."""
        start = self.table.start.copy()
        for name, change in changes.items():
            start[self.numbers[name]] += change
        return replace(self, table=replace(self.table, start=start))

    def follow(self, channels: Sequence[str], times: Array, **options: float) -> dict[str, Array]:
        """Channels at the times, by name; "y" and "yp" are all unknowns and their derivatives, a row for each time."""
        selected, _ = self.linked.select(list(channels))
        rows, y, yp = [], [], []
        with Simulation(self.table.with_channels(selected).to_bytes()) as simulation:
            for name, value in options.items():
                simulation.set_option(name, value)
            simulation.initialise(0.0)
            for time in times:
                simulation.advance(float(time))
                rows.append(simulation.channels())
                _, now, slope = simulation.state()
                y.append(now)
                yp.append(slope)
        table = np.array(rows)
        return {c.name: table[:, k] for k, c in enumerate(selected)} | {"y": np.array(y), "yp": np.array(yp)}


def ready(system: System, cache: KernelCache) -> Ready:
    """Compiled, linked and at rest."""
    linked = build(system, cache).linked
    steady = steady_state(linked)
    return Ready(linked, steady.table, steady.free)

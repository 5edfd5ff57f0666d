"""A shipped scenario as a linked system at its steady state, for tests and benchmarks that need no result files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gustform_cli
from gustform_cli.assemble import Assembled
from gustform_cli.model import Model, link, load
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SystemTable
from gustform_runtime import Simulation

SCENARIOS = Path(gustform_cli.__file__).parent / "scenarios"

Reader = Callable[[int, int], tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class Case:
    """A scenario ready to run: everything up to and including the steady state."""

    assembled: Assembled
    model: Model
    table: SystemTable

    @property
    def until(self) -> float:
        return float(self.assembled.scenario.run.until)

    def wind(self, until: float) -> tuple[float, NDArray[np.float64]]:
        """(spacing in s, samples of every input slot) of uniform wind series that last until `until`."""
        dt = self.table.series[0].dt
        count = int(until / dt) + 3
        values = np.tile(self.table.input_value, (count, 1))
        for series in self.table.series:
            assert series.dt == dt
            if series.value is not None:
                samples = series.value[:count]
            else:
                samples = self.reader(series.name)(0, count)[1]
            for slot in series.slots:
                values[:, slot] = samples
        return dt, values

    def reader(self, name: str) -> Reader:
        return self.assembled.readers[name]

    def simulation(self, channels: tuple[str, ...] = (), **options: float) -> Simulation:
        """The runtime on this case, with readers and options set; the caller closes it."""
        selected, _ = self.model.built.linked.select(channels) if channels else ([], {})
        simulation = Simulation(self.table.with_channels(selected).to_bytes())
        for name, value in options.items():
            simulation.set_option(name, value)
        for number, series in enumerate(self.table.series):
            if series.value is None:
                simulation.set_series_reader(number, self.reader(series.name))
        return simulation

    def run(
        self, channels: tuple[str, ...], every: float, until: float | None = None, **options: float
    ) -> tuple[NDArray[np.float64], dict[str, NDArray[Any]], dict[str, int | float]]:
        """Times, rows by channel name, statistics."""
        times: list[NDArray[np.float64]] = []
        rows: list[NDArray[np.float32]] = []

        def keep(block_times: NDArray[np.float64], block: NDArray[np.float32]) -> None:
            times.append(block_times.copy())
            rows.append(block.copy())

        with self.simulation(channels, **options) as simulation:
            simulation.set_sink(every, keep)
            simulation.initialise(0.0)
            simulation.advance(self.until if until is None else until)
            statistics = simulation.statistics()
        table = np.concatenate(rows)
        return np.concatenate(times), {name: table[:, k] for k, name in enumerate(channels)}, statistics


def open_case(name: str, *overrides: str) -> Case:
    """The shipped scenario `name` ("load_step_8ms") with `--set` overrides."""
    assembled = load(SCENARIOS / f"{name}.yaml", overrides)
    model = link(assembled)
    return Case(assembled, model, steady_state(model.built.linked).table)

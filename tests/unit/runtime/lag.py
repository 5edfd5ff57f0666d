"""A first-order lag driven by one series: the smallest system with a state, an input and something that happens."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from gustform.language import Component, Input, Output, Parameter, Variable
from gustform.language.system import Change, Constant, Series, System
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.table import SystemTable
from gustform_runtime import Simulation, include_dir

Array = NDArray[np.float64]


class Lag(Component):
    """T dx/dt = u - x. Source: any textbook."""

    T = Parameter("s", "time constant", default=0.5, above=0.0)
    u = Input("m/s", "wind")
    x = Variable("m/s", "wind, delayed")
    lost = Output("m/s", "what the delay takes")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), self.u - self.x)
        self.eq(self.lost, self.u - self.x)


@functools.cache
def _cache() -> KernelCache:
    return KernelCache(include_dir())


def lag_table(
    source: Series | Constant, *changes: Change, names: tuple[str, ...] = ("lag.x", "lag.lost")
) -> SystemTable:
    """The table of a lag that starts at rest."""
    system = System()
    system.add("lag", Lag())
    system.bind("lag.u", source)
    for change in changes:
        system.schedule.append(change)
    linked = build(system, _cache()).linked
    channels, _ = linked.select(names)
    return linked.table.with_channels(channels)


def values_of(simulation: Simulation, times: Array) -> Array:
    """The wind that the equations of a lag see at `times`: T x' - u + x at rest, whatever sign the row has."""
    rest = np.zeros(1)
    row = [simulation.residual(t, rest, rest)[0] for t in times]
    slope = simulation.residual(0.0, rest, np.ones(1))[0] - simulation.residual(0.0, rest, rest)[0]
    return np.asarray(-0.5 * np.array(row) / slope, dtype=np.float64)

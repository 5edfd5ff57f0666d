"""The smallest DC-link capacitor that a design can live with, and how its shaft is damped.

With filter, inner loops and stator (fidelity dq) in constant wind: the largest C that does not do is bracketed with the
smallest that does, by halving their ratio. A capacitor does when the system is stable in the small and a 20 MW load
step keeps the DC voltage within its band. The steady state does not depend on C, so a case is built once and only this
number of its table is another.

In rms the loops behind the control are infinitely fast, and C could be a hundredth without anybody noticing: it is the
delay of these loops that the capacitor has to bridge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gustform_cli.model import Model
from gustform_cli.run import Run
from gustform_cli.study.tradeoff_case import TURBINE, Scalars, built, outcome
from gustform_cli.sweep.case import Outcome, Task
from gustform_codegen.linear import Lineariser
from gustform_codegen.modes import UNSTABLE, Mode, modes
from gustform_codegen.table import SystemTable

BAND = 0.05  # pu, of the DC voltage either way
SMALLEST, LARGEST = 0.5e-3, 128e-3  # F, that are looked at
RATIO = 1.05  # of the bracket in the end
V_DC = f"{TURBINE}.v_dc"
_CAPACITANCE = "dc_link.C"
_TWIST = f"{TURBINE}.drive.phi"

UNITS = {
    "capacitor_f": "F", "v_dc_min_pu": "pu", "v_dc_max_pu": "pu", "torsion_hz": "Hz", "torsion_damping": "1",
    "stable": "1", "least_damping": "1",
}  # fmt: skip


def measure(task: Task) -> Outcome:
    """The smallest capacitor of a case; NaN where even the largest does not do. The rest is for the capacitor that the
    scenario has."""
    return outcome(task, _measured, UNITS)


def _measured(task: Task) -> tuple[Scalars, float]:
    links = DcLinks(*built(task))
    low, high = links.band(links.nominal)
    found = links.modes(links.nominal)
    torsion = max(found, key=lambda mode: dict(mode.participation).get(_TWIST, 0.0))
    damped = [mode.damping for mode in found if mode.damping is not None and mode.frequency > 0.0]
    return {
        "capacitor_f": smallest(links),
        "v_dc_min_pu": low,
        "v_dc_max_pu": high,
        "torsion_hz": torsion.frequency,
        "torsion_damping": torsion.damping or 0.0,
        "stable": float(links.stable(links.nominal)),
        "least_damping": min(damped),
    }, links.solved


@dataclass
class DcLinks:
    """One model with any capacitor, F."""

    model: Model
    table: SystemTable
    solved: float = 0.0  # s, spent in runs

    def __post_init__(self) -> None:
        linked = self.model.built.linked
        self._type, self._instance = linked.index_of[TURBINE]
        paths = [parameter.path for parameter in linked.types[self._type].unit.parameters]
        self._column = paths.index(_CAPACITANCE)
        self._lineariser = Lineariser(linked, [], find_flats=False)

    @property
    def nominal(self) -> float:
        """The scenario's."""
        return float(self.table.types[self._type].parameters[self._instance, self._column])

    def with_capacitor(self, C: float) -> SystemTable:
        """The table with another capacitor."""
        types = list(self.table.types)
        parameters = types[self._type].parameters.copy()
        parameters[self._instance, self._column] = C
        types[self._type] = replace(types[self._type], parameters=parameters)
        return replace(self.table, types=types)

    def does(self, C: float) -> bool:
        """Whether a capacitor is large enough."""
        if not self.stable(C):
            return False
        low, high = self.band(C)
        return 1.0 - low <= BAND and high - 1.0 <= BAND

    def stable(self, C: float) -> bool:
        """Whether no oscillation grows. Real eigenvalues do not count: in the governor's dead band nothing holds the
        frequency but the turbine, and at maximum power it drifts, which is no matter of the capacitor."""
        return not any(mode.kind == UNSTABLE and mode.frequency > 0.0 for mode in self.modes(C))

    def modes(self, C: float) -> list[Mode]:
        """The modes before the step."""
        return modes(self._lineariser.at(self.with_capacitor(C))).listed

    def band(self, C: float) -> tuple[float, float]:
        """Lowest and highest DC voltage in the load step, pu; the run ends once it has left the band."""
        column = [channel.name for channel in self.model.channels].index(V_DC)
        seen: list[float] = []

        def watch(_: NDArray[np.float64], rows: NDArray[np.float32]) -> None:
            seen.extend((float(rows[:, column].min()), float(rows[:, column].max())))
            if max(abs(v - 1.0) for v in seen) > BAND:
                run.request_stop()

        with Run(self.model, self.with_capacitor(C), None, [watch]) as run:
            ended = run.execute()
        self.solved += ended.summary.wall_seconds
        if ended.error is not None:
            return 0.0, math.inf  # the voltage has run away so far that no step of the solver succeeds
        return min(seen), max(seen)


def smallest(links: DcLinks, least: float = SMALLEST, most: float = LARGEST) -> float:
    """The smallest capacitor that does, F: the upper end of the last bracket. `least` if that does already; NaN if
    `most` does not."""
    if not links.does(most):
        return float("nan")
    if links.does(least):
        return least
    while most / least > RATIO:
        middle = math.sqrt(least * most)
        least, most = (least, middle) if links.does(middle) else (middle, most)
    return most

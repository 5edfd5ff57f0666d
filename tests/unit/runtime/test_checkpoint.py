"""Checkpoints of shipped scenarios: the resumed run is the uninterrupted one, bit for bit, and what that costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform_runtime import Keep, RunError, Simulation, Statistics, Status
from tests.support.case import Case, open_case
from tests.unit.runtime.lag import Array

EVERY = 0.05


class Run:
    """A simulation of a case with rows, statistics and a checkpoint at each multiple of `interval`."""

    def __init__(self, case: Case) -> None:
        names = tuple(c.name for c in case.model.channels)
        self.rows: list[NDArray[np.float64]] = []
        self.statistics = Statistics([Keep(0, segment=64, exponents=(4.0,)), Keep(len(names) - 1)], len(names), 0.02)
        self.simulation = case.simulation(names, series_block=64)
        self.simulation.set_sink(EVERY, lambda t, rows: self.rows.append(np.column_stack([t, rows])))
        self.simulation.set_statistics(self.statistics, 1.0)
        self.simulation.initialise(0.0)

    def go(self, times: Array) -> list[bytes]:
        states = []
        for time in times:
            assert self.simulation.advance(float(time)) is Status.OK
            self.simulation.checkpoint()
            states.append(self.simulation.checkpoint_bytes())
        return states

    def table(self) -> Array:
        return np.concatenate(self.rows) if self.rows else np.empty((0, 0))


@pytest.mark.parametrize(
    ("name", "until", "interval"),
    [("turbulent_10min", 60.0, 7.3), ("load_step_8ms", 90.0, 11.0), ("load_step_8ms", 31.0, 10.0)],
)
def test_a_resumed_run_is_the_uninterrupted_one(name: str, until: float, interval: float, tmp_path: Path) -> None:
    """30 s is the time of the load step: the checkpoint at an event is taken before it."""
    case = open_case(name, f"run.until={until} s")
    times = np.append(np.arange(interval, until, interval), until)
    whole = Run(case)
    states = whole.go(times)
    rows = whole.table()
    for k in range(len(times) - 1):
        part = Run(case)
        if k % 2:
            path = tmp_path / "run.gustck"
            path.write_bytes(states[k])
            part.simulation.restore(path)
        else:
            part.simulation.restore(states[k])
        before = int(part.simulation.statistics()["rows"])
        # The last checkpoint holds every unknown, the statistics and the counters of the solver.
        assert part.go(times[k + 1 :])[-1] == states[-1]
        assert np.array_equal(part.table(), rows[before:])
        assert part.statistics.save() == whole.statistics.save()


def test_a_checkpoint_costs_some_steps_and_keeps_the_accuracy() -> None:
    """21 starts in 100 s of turbulence: each takes some short steps until the order is up again."""
    case = open_case("turbulent_10min", "run.until=100 s")
    steps, final = [], []
    for count in (1, 21):
        with case.simulation() as simulation:
            simulation.initialise(0.0)
            for time in np.linspace(0.0, 100.0, count + 1)[1:]:
                simulation.advance(float(time))
                if count > 1:
                    simulation.checkpoint()
            steps.append(int(simulation.statistics()["steps"]))
            final.append(simulation.state()[1])
    # Measured: 2 to 9 each.
    assert steps[1] - steps[0] < 21 * 20
    nominal = case.table.nominal
    assert np.max(np.abs(final[1] - final[0]) / nominal) < 1e-4  # 100 rtol, as any two runs with other steps


def test_what_cannot_be_taken_up_says_why(tmp_path: Path) -> None:
    case = open_case("load_step_8ms")
    run = Run(case)
    run.go(np.array([1.0]))
    state = run.simulation.checkpoint_bytes()
    with case.simulation() as other:
        with pytest.raises(RunError, match="after initialise") as caught:
            other.restore(state)
        assert caught.value.code == Status.BAD_ORDER
        with pytest.raises(RunError, match="no checkpoint"):
            other.checkpoint_bytes()
        other.initialise(0.0)
        with pytest.raises(RunError, match="FOREIGN_CHECKPOINT"):
            other.restore(state)
        with pytest.raises(RunError, match="CHECKPOINT_UNREADABLE"):
            other.restore(tmp_path / "none")
        with pytest.raises(RunError, match="checksum"):
            run.simulation.restore(state[:-1] + bytes([state[-1] ^ 1]))
        with pytest.raises(RunError, match="CHECKPOINT_FAILED"):
            other.checkpoint(tmp_path / "no" / "folder")
        other.advance(1.0)  # none of these did any harm
    # Another value of a parameter is another model.
    changed = Run(open_case("load_step_8ms", "components.wt.aggregate=9"))
    with pytest.raises(RunError, match="another model"):
        changed.simulation.restore(state)


def test_a_file_is_replaced_in_one_go(tmp_path: Path) -> None:
    case = open_case("load_step_8ms")
    path = tmp_path / "run.gustck"
    with case.simulation() as simulation:
        simulation.initialise(0.0)
        for time in (1.0, 2.0):
            simulation.advance(time)
            simulation.checkpoint(path)
            assert path.read_bytes() == simulation.checkpoint_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["run.gustck"]
    with case.simulation() as simulation:
        simulation.initialise(0.0)
        simulation.restore(path)
        assert simulation.time == 2.0
        assert isinstance(simulation, Simulation)

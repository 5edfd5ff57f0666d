"""The Python binding itself: errors, callbacks that raise, lifetime, threads."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from pathlib import Path

import numpy as np
import pytest

from gustform.language.system import Change, Constant, Series
from gustform_runtime import Keep, RunError, Simulation, Statistics, Status, bindings
from gustform_runtime.bindings import library
from tests.unit.runtime.lag import Array, lag_table

STEADY = lag_table(Constant(8.0)).to_bytes()
READ = lag_table(Series("wind", 8.0, dt=0.1, on_end="error")).to_bytes()


def test_a_table_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="GUSTTAB1") as caught:
        Simulation(b"no table")
    assert caught.value.code == Status.BAD_CONTAINER
    assert str(caught.value).startswith("BAD_CONTAINER: ")
    with pytest.raises(RunError, match="cannot be opened"):
        Simulation(tmp_path / "none.gust")
    path = tmp_path / "lag.gust"
    path.write_bytes(STEADY)
    with Simulation(path) as simulation:
        assert simulation.channel_names() == ["lag.x", "lag.lost"]
        assert simulation.channel_units() == ["m/s", "m/s"]


def test_calls_come_in_order() -> None:
    with Simulation(STEADY) as simulation:
        with pytest.raises(RunError, match="initialise the simulation"):
            simulation.advance(1.0)
        with pytest.raises(RunError, match="there is no option"):
            simulation.set_option("rtoll", 1.0)
        with pytest.raises(RunError, match="rtol must be from"):
            simulation.set_option("rtol", -1.0)
        with pytest.raises(RunError, match="there is no series 0"):
            simulation.set_series_reader(0, lambda first, count: (np.empty(0), np.empty(0)))
        with pytest.raises(RunError, match="interval greater than 0"):
            simulation.set_sink(0.0, lambda t, rows: None)
        simulation.initialise(0.0)
        with pytest.raises(RunError, match="before initialise"):
            simulation.set_option("rtol", 1e-6)
        with pytest.raises(RunError, match="cannot advance"):
            simulation.advance(-1.0)
        with pytest.raises(RunError, match="y must hold 1 values"):
            simulation.residual(0.0, np.zeros(2), np.zeros(1))
        assert simulation.advance(1.0) is Status.OK
    with pytest.raises(RunError, match="closed"):
        simulation.advance(2.0)
    simulation.close()  # twice does no harm


def test_every_option_has_a_sentence() -> None:
    options = {option.name: option for option in Simulation.options()}
    assert options["rtol"].default == 1e-6
    assert all(option.description for option in options.values())
    assert "series_tolerance" in options


class OwnError(Exception):
    pass


def test_what_a_callback_raises_comes_out_again() -> None:
    def broken_reader(first: int, count: int) -> tuple[Array, Array]:
        raise OwnError("reader")

    with Simulation(READ) as simulation:
        simulation.set_series_reader(0, broken_reader)
        with pytest.raises(OwnError, match="reader"):
            simulation.initialise(0.0)

    def broken_sink(times: Array, rows: object) -> None:
        raise OwnError("sink")

    with Simulation(STEADY) as simulation:
        simulation.set_sink(0.1, broken_sink)
        simulation.initialise(0.0)
        with pytest.raises(OwnError, match="sink"):
            simulation.advance(1.0)

    def too_many(first: int, count: int) -> tuple[Array, Array]:
        return np.zeros(count + 1), np.zeros(count + 1)

    with Simulation(READ) as simulation:
        simulation.set_series_reader(0, too_many)
        with pytest.raises(ValueError, match="delivered an array of shape"):
            simulation.initialise(0.0)


def test_a_reader_may_end() -> None:
    def short(first: int, count: int) -> tuple[Array, Array]:
        values = np.full(30, 8.0)[first : first + count]
        return values, values

    with Simulation(READ) as simulation:
        simulation.set_series_reader(0, short)
        simulation.initialise(0.0)
        assert simulation.advance(10.0) is Status.END_OF_DATA
        assert simulation.time == pytest.approx(2.9)
        assert '"wind" ends at 2.9 s' in simulation.message


def test_blocks_are_the_receivers_to_keep() -> None:
    blocks: list[tuple[Array, object]] = []
    changes = [Change(1.0, "lag.T", 2.0)]
    with Simulation(lag_table(Series("wind", 8.0, time=np.array([0.0, 0.5, 9.0]), value=np.array([0.0, 8.0, 8.0]),
                                     on_end="hold"), *changes).to_bytes()) as simulation:  # fmt: skip
        simulation.set_sink(0.25, lambda t, rows: blocks.append((t, rows)), block_rows=4)
        simulation.initialise(0.0)
        simulation.advance(3.0)
        assert simulation.statistics()["events"] == 1
    times = np.concatenate([t for t, _ in blocks])
    assert times.tolist() == (0.25 * np.arange(13)).tolist()
    assert [t.size for t, _ in blocks] == [4, 4, 4, 1]


def test_everything_is_freed_with_the_last_reference() -> None:
    """Callbacks refer to the simulation and it to them: a cycle that the collector must be able to break."""
    simulation = Simulation(STEADY)
    simulation.set_sink(0.1, lambda t, rows: None)
    statistics = Statistics([Keep(0)], 2, 0.1)
    simulation.set_statistics(statistics, 0.0)
    simulation.initialise(0.0)
    gone = weakref.ref(simulation)
    kept = weakref.ref(statistics)
    del statistics
    gc.collect()
    assert kept() is not None  # C still writes to it
    simulation.advance(1.0)
    del simulation
    gc.collect()
    assert gone() is None
    assert kept() is None


def resident() -> int:
    """Memory of this process, bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096


def test_a_thousand_simulations_leave_nothing() -> None:
    table = lag_table(Series("wind", 8.0, dt=0.1, value=8.0 + np.sin(np.arange(700.0)), on_end="hold")).to_bytes()

    def once() -> None:
        with Simulation(table) as simulation:
            simulation.set_sink(1.0, lambda t, rows: None)
            simulation.initialise(0.0)
            simulation.advance(60.0)
            simulation.checkpoint()

    for _ in range(50):
        once()
    gc.collect()
    before, handles = resident(), len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(1000):
        once()
    gc.collect()
    assert len(list(Path("/proc/self/fd").iterdir())) == handles
    # One leaked simulation would be some 50 kB: 1000 of them 50 MB.
    assert resident() - before < 5e6


def test_the_interpreter_is_free_while_a_simulation_runs() -> None:
    """Another thread counts while advance() runs, and stops it."""
    with Simulation(STEADY) as simulation:
        simulation.set_option("max_step", 1e-4)
        simulation.initialise(0.0)
        counted: list[float] = []

        def watch() -> None:
            # Many looks while one call into C is under way: each one needs the interpreter.
            while len(counted) < 200 or counted[-1] <= counted[0]:
                counted.append(simulation.time)
                time.sleep(0)
            simulation.request_stop()

        watcher = threading.Thread(target=watch)
        watcher.start()
        status = simulation.advance(1e9)
        watcher.join()
        assert status is Status.STOP_REQUESTED
        assert counted[-1] > counted[0]
        # It can go on afterwards.
        assert simulation.advance(simulation.time + 1.0) is Status.OK


def test_two_simulations_run_side_by_side() -> None:
    """The same result from threads as one after the other: nothing is shared but the library."""
    table = lag_table(Series("wind", 8.0, dt=0.1, value=8.0 + np.sin(np.arange(700.0)), on_end="hold")).to_bytes()
    results: dict[int, float] = {}

    def run(number: int) -> None:
        with Simulation(table) as simulation:
            simulation.initialise(0.0)
            simulation.advance(60.0)
            results[number] = float(simulation.state()[1][0])

    run(-1)
    threads = [threading.Thread(target=run, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(results.values())) == 1


def test_a_library_of_another_version_is_not_misread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bindings, "Status", list(Status)[:-1])
    with pytest.raises(ImportError, match="FOREIGN_CHECKPOINT"):
        bindings._check_statuses(library())

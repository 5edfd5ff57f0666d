"""The plant on the bus, sample by sample, against the simulation that runs the same C beside its equations."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest

from gustform_cli.figures import draw
from gustform_cli.hil.compare import compare
from gustform_cli.hil.plant import message_set, plant
from gustform_cli.hil.rigs import SCENARIO
from gustform_cli.interrupt import Interrupt
from gustform_cli.run_data import RunData
from gustform_cli.simulate import Outcome, simulate
from gustform_hil.bus import Bus
from gustform_hil.client import Client, Command, Operator
from gustform_hil.codec import Codec
from gustform_hil.process import UNHURRIED, Bridge
from gustform_hil.rig_files import RigFiles
from gustform_hil.trace import read_trace
from tests.support.rigs import SCHEDULE
from tests.support.waiting import PATIENCE, wait_for

STEPS = 20_000
SAMPLED = ["wt.control.sampled=1ms", "wt.control.delay=1"]
FLOAT32 = 2.0**-24  # relative: half a unit in the last place


def settings(seconds: float, every: str) -> list[str]:
    """The load step within the run, all channels in double precision."""
    at = min(5.0, 0.5 * seconds)
    return [f"run.until={seconds}s", f"events.0.at={at}s", f"output.every={every}", "output.precision=float64"]


@dataclass(frozen=True)
class OnTheBus:
    outcome: Outcome
    log: Path | None
    told: list[dict[str, object]]
    seconds: float


def on_the_bus(
    rig: RigFiles, interface: str, folder: Path, overrides: list[str], log: Path | None = None, bus: str = "fd"
) -> OnTheBus:
    with Bridge(rig.bridge, interface, "sync", UNHURRIED) as bridge:
        begin = time.perf_counter()
        outcome = plant(
            SCENARIO,
            folder,
            overrides,
            Interrupt(),
            message_set(bus, None, None),
            interface,
            log=log,
            start=True,
            figure=False,
        )
        seconds = time.perf_counter() - begin
    return OnTheBus(outcome, log, bridge.events, seconds)


def same_bits(one: Path, other: Path, but: tuple[str, ...] = ()) -> int:
    """Numbers that are there, all of them the same in both files, except for channels that end on `but`."""
    count = 0
    with h5py.File(one) as a, h5py.File(other) as b:
        names = [name for name, node in a.items() if isinstance(node, h5py.Dataset)]
        assert names == [name for name, node in b.items() if isinstance(node, h5py.Dataset)]
        for name in (name for name in names if not name.endswith(but)):
            assert a[name].dtype == np.float64, name
            assert a[name][()].tobytes() == b[name][()].tobytes(), name
            count += a[name].size
    return count


def test_twenty_thousand_steps_have_the_bits_of_the_simulation(rig: RigFiles, interface: str, tmp_path: Path) -> None:
    overrides = settings(STEPS * 1e-3, "1ms")
    there = on_the_bus(rig, interface, tmp_path / "bus", overrides)
    assert there.outcome.error is None
    here = simulate(SCENARIO, tmp_path / "here", [*overrides, *SAMPLED], Interrupt(), figure=False)
    assert same_bits(there.outcome.result, here.result) > 50 * STEPS  # 50 channels and more, a row each sample
    end = there.told[-1]
    assert (end["event"], end["steps"], end["held"], end["missed"]) == ("end", STEPS, 0, 0)
    states = [event["state"] for event in there.told if event["event"] == "state"]
    assert states == ["INIT", "READY", "RUN", "READY"]
    print(f"{STEPS} steps in {there.seconds:.1f} s, {1e6 * there.seconds / STEPS:.0f} us each")


def test_a_controller_with_its_schedule_has_the_bits_of_the_simulation(
    rig_for: Callable[[str], RigFiles], interface: str, tmp_path: Path
) -> None:
    """It reads the wind from the bus and looks its operating point up by itself, on the rig as in the simulation."""
    overrides = [
        *settings(3.0, "1ms"),
        SCHEDULE,
        "wind.wt={type: ramp, from: 8 m/s, to: 9 m/s, at: 0.5 s, duration: 2 s}",
    ]
    there = on_the_bus(rig_for("scheduled"), interface, tmp_path / "bus", overrides)
    assert there.outcome.error is None
    here = simulate(SCENARIO, tmp_path / "here", [*overrides, *SAMPLED], Interrupt(), figure=False)
    told = (".omega_del", ".beta_del")  # by the library; the bus does not carry them
    assert same_bits(there.outcome.result, here.result, told) > 50 * 3000
    with h5py.File(there.outcome.result) as bus, h5py.File(here.result) as simulated:
        for name in ("wt.schedule.omega_del", "wt.schedule.beta_del"):
            assert np.isnan(bus[name][()]).all()
            assert np.ptp(simulated[name][()]) > 1e-3


@pytest.fixture(scope="module")
def logged(rig: RigFiles, interface: str, tmp_path_factory: pytest.TempPathFactory) -> OnTheBus:
    folder = tmp_path_factory.mktemp("logged")
    return on_the_bus(rig, interface, folder, settings(1.0, "1ms"), folder / "bus.log")


def test_a_log_is_the_simulation(logged: OnTheBus) -> None:
    assert logged.log is not None
    trace = read_trace(logged.log, Codec(message_set("fd", None, None)))
    with RunData(logged.outcome.result, every_row=True) as run:
        found = compare(trace, run, "wt")
    assert (found.lost, found.damaged, found.missing) == (0, 0, ())
    names = {pair.compared.quantity for pair in found.pairs}
    assert {
        "v_dc",
        "omega_r",
        "P_pmsg",
        "Q_gsc",
        "Q_msc",
        "omega_gsc",
        "V_gsc",
        "omega_msc",
        "V_msc",
        "beta_ref",
    } <= names
    for pair in found.pairs:
        assert len(pair.time) >= 998  # of a thousand samples
        if pair.compared.quantity in trace.references:
            assert pair.compared.largest == 0.0, pair.compared  # a float32, held
        else:
            assert pair.compared.largest <= FLOAT32 * np.max(np.abs(pair.simulated)), pair.compared


def test_candump_of_can_utils_writes_the_same(rig: RigFiles, interface: str, tmp_path: Path) -> None:
    """The log of somebody else on the bus, in candump's format, gives the same curves."""
    with (tmp_path / "candump.log").open("wb") as file:
        other = subprocess.Popen(["candump", "-L", "-r", str(4 << 20), interface], stdout=file)
        try:
            listeners = Path("/proc/net/can/rcvlist_all")
            wait_for(lambda: f"({interface}: no entry)" not in listeners.read_text())
            done = on_the_bus(rig, interface, tmp_path, settings(0.3, "1ms"), tmp_path / "own.log")
            time.sleep(1.0)  # it has a queue, and reads on
        finally:
            other.terminate()
            other.wait()
    assert done.outcome.error is None
    codec = Codec(message_set("fd", None, None))
    own, others = (read_trace(tmp_path / name, codec) for name in ("own.log", "candump.log"))
    assert own.measurements.keys() == others.measurements.keys()
    assert (own.lost, others.lost) == (0, 0)
    for mine, theirs in ((own.references, others.references), (own.measurements, others.measurements)):
        for name, series in mine.items():
            assert np.array_equal(series.sample, theirs[name].sample), name
            assert np.array_equal(series.values, theirs[name].values), name


def test_an_mf4_log_of_a_classic_bus(rig_for: object, interface: str, tmp_path: Path) -> None:
    assert callable(rig_for)
    # The classic set has periods of 2 ms; a result of every sample is compared within its quantisation.
    overrides = settings(0.1, "2ms")
    done = on_the_bus(rig_for("classic"), interface, tmp_path, overrides, tmp_path / "bus.mf4", bus="classic")
    assert done.outcome.error is None
    codec = Codec(message_set("classic", None, None))
    trace = read_trace(tmp_path / "bus.mf4", codec)
    half = {s.quantity: 0.51 * s.scale for m in codec.messages.messages for s in m.signals if s.quantity}
    with RunData(done.outcome.result, every_row=True) as run:
        found = compare(trace, run, "wt", [f"{name}={half[name]}" for name in (*trace.measurements, *trace.references)])
    assert found.good, [pair.compared for pair in found.pairs if not pair.compared.good]


def last_state(bridge: Bridge) -> object:
    """The last one that it has told."""
    return [event["state"] for event in bridge.events if event["event"] == "state"][-1]


@contextmanager
def when(bridge: Bridge, state: str, action: Callable[[], None]) -> Iterator[None]:
    """Do something from a thread, half a second after the bridge has come to a state."""

    def watch() -> None:
        wait_for(lambda: any(event.get("state") == state for event in bridge.events))
        time.sleep(0.5)
        action()

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        thread.join()


def test_interrupted_everything_is_readable_and_nothing_is_commanded(
    rig: RigFiles, interface: str, tmp_path: Path
) -> None:
    """The command in a process of its own; the bridge comes later than the plant."""
    line = [
        sys.executable,
        "-m",
        "gustform_cli",
        "hil",
        "plant",
        str(SCENARIO),
        "--interface",
        interface,
        "--no-figure",
    ]
    line += ["--until", "600s", "--out", str(tmp_path), "--log", str(tmp_path / "bus.log"), "--start"]
    process = subprocess.Popen(line, text=True, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stderr is not None
    assert any("waiting for the bridge" in words for words in process.stderr)
    with Bridge(rig.bridge, interface, "sync", UNHURRIED) as bridge:
        with when(bridge, "RUN", lambda: process.send_signal(signal.SIGINT)):
            output, words = process.communicate(timeout=2.0 * PATIENCE)
        wait_for(lambda: last_state(bridge) in ("READY", "SAFE"))
    assert process.returncode == 130, words
    assert "interrupted" in output
    with RunData(tmp_path / "result.nc") as run:
        assert run.attribute("status") == "interrupted"
    trace = read_trace(tmp_path / "bus.log", Codec(message_set("fd", None, None)))
    assert trace.start is not None
    assert (trace.lost, trace.damaged) == (0, 0)


def test_the_bridge_is_stopped_before_the_figure_is_drawn(
    rig: RigFiles, interface: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawing takes seconds: a bridge that still ran would hear nothing of its plant, and end in SAFE."""
    drawn: list[object] = []

    def after_the_run(result: Path, figure: Path) -> Path:
        wait_for(lambda: last_state(bridge) != "RUN")
        drawn.append(last_state(bridge))
        return draw(result, figure)

    monkeypatch.setattr("gustform_cli.figures.draw", after_the_run)
    chosen = message_set("fd", None, None)
    with Bridge(rig.bridge, interface, "sync", UNHURRIED) as bridge:
        outcome = plant(SCENARIO, tmp_path, settings(0.1, "10ms"), Interrupt(), chosen, interface, start=True)
    assert drawn == ["READY"]
    assert outcome.figure is not None
    assert outcome.figure.is_file()


def test_the_plant_waits_for_an_operator_and_ends_at_an_emergency_stop(
    rig: RigFiles, interface: str, tmp_path: Path
) -> None:
    messages = message_set("fd", None, None)
    with Bus(interface) as bus, Bridge(rig.bridge, interface, "sync", UNHURRIED) as bridge:
        operator = Operator(Client(bus, Codec(messages)))
        states_at_start: list[object] = []

        def start() -> None:
            states_at_start.extend(event.get("state") for event in bridge.events)
            operator.press(Command.START)

        with when(bridge, "READY", start), when(bridge, "RUN", operator.emergency_stop):
            outcome = plant(
                SCENARIO, tmp_path, ["run.until=600s"], Interrupt(), messages, interface, start=False, figure=False
            )
    assert "RUN" not in states_at_start
    assert outcome.error is not None
    assert outcome.error.code == "GF8079"
    assert "EMERGENCY_STOP" in outcome.error.message
    with RunData(outcome.result) as run:
        assert run.attribute("status") == "failed"
    assert bridge.events[-1]["steps"] > 0


def test_without_a_bridge_it_can_be_interrupted(interface: str, tmp_path: Path) -> None:
    def interrupt_what_sends() -> None:
        if other.receive(PATIENCE) is not None:
            os.kill(os.getpid(), signal.SIGINT)

    messages = message_set("fd", None, None)
    with Bus(interface) as other, Interrupt() as interrupt:
        thread = threading.Thread(target=interrupt_what_sends)
        thread.start()
        outcome = plant(SCENARIO, tmp_path, ["run.until=600s"], interrupt, messages, interface, figure=False)
        thread.join()
    assert outcome.summary.status == "interrupted"
    assert outcome.summary.simulated_seconds < 0.01

"""A thousand times bus-off, emergency stop or a full queue at an instant that a seed chooses."""

from __future__ import annotations

import random
from collections import Counter
from contextlib import ExitStack

from gustform_cli.hil.faults import bench_of
from gustform_hil.bench import PATIENCE, Bench, Tick
from gustform_hil.bus import BUS_OFF
from gustform_hil.client import Command, State
from gustform_hil.faults import SILENCE, fault_names
from gustform_hil.flood import Flood
from gustform_hil.rig_files import RigFiles

TRIALS = 1000
STATE_CYCLE = 11  # periods until the bridge has told its state again
TOLD = {"bus_off": "BUS_OFF", "emergency_stop": "EMERGENCY_STOP", "enobufs": "SEND"}


def test_no_old_command_and_no_way_out_but_a_reset(rig: RigFiles, interface: str) -> None:
    chance = random.Random(20261122)
    done: Counter[str] = Counter()
    with bench_of(rig, interface) as bench:
        for _ in range(TRIALS):
            kind = chance.choice(sorted(TOLD))
            _trial(bench, chance, kind)
            done[kind] += 1
        assert bench.violations == []
    assert done.total() == TRIALS
    assert min(done.values()) > TRIALS / 4  # a seed that tries all three


def _trial(bench: Bench, chance: random.Random, kind: str) -> None:
    bench.run()
    for _ in range(chance.randrange(8)):
        _current(bench, bench.tick(), enabled=True)
    between = chance.random() < 0.5  # before the measurements, or between them and Sync
    with ExitStack() as stack:

        def send(bench: Bench) -> None:
            if between:
                bench.client.put(bench.measure())
            _fire(bench, kind, stack)
            if not between:
                bench.client.put(bench.measure())

        _current(bench, bench.tick(send), enabled=False)
        for _ in range(chance.randrange(1, 4)):
            _current(bench, bench.tick(), enabled=False)
    bench.patience = PATIENCE
    for _ in range(2):
        _current(bench, bench.tick(), enabled=False)  # what a full queue held back would come now
    bench.until(State.SAFE, STATE_CYCLE)  # its word on it was lost where the queue was full; nothing is sent twice
    assert TOLD[kind] in fault_names(bench.client.heard.faults)

    bench.operator.repeat(Command.START)
    bench.operator.press(chance.choice((Command.START, Command.STOP)))
    bench.operator.repeat(Command.RESET)
    for _ in range(2):
        _current(bench, bench.tick(), enabled=False)
    assert bench.state == State.SAFE, kind
    bench.reset()  # until it is READY


def _fire(bench: Bench, kind: str, stack: ExitStack) -> None:
    if kind == "bus_off":
        bench.client.bus.send(BUS_OFF, bytes(8), fd=False, error=True)
    elif kind == "emergency_stop":
        bench.operator.emergency_stop()
    else:
        bench.patience = SILENCE
        stack.enter_context(Flood(bench.client.bus))


def _current(bench: Bench, tick: Tick, *, enabled: bool) -> None:
    """A command answers this very period's sample; where none may be given, none is."""
    if tick.references is None:
        assert not enabled
        return
    assert tick.references.enabled == enabled
    if enabled:
        assert bench.age(tick) == 0

"""Twelve faults of a bus, injected period by period into a bridge that runs, and what it made of each.

A fault begins in the period before Sync n: its time to SAFE is counted from Sync n - 1 on, which is the longest that
it can have been, to the period in which the references were blocked. Whatever happens, every command sent must be in
its range, none may be enabled from then on, and start alone must not lead out of SAFE.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace

from gustform_hil.bench import Bench, Tick
from gustform_hil.bus import BUS_OFF
from gustform_hil.client import Command, Frame, State
from gustform_hil.flood import Flood
from gustform_hil.message_set import Part

LIMIT = 3  # periods of the bus, to SAFE: 3 ms at 1 kHz
SILENCE = 0.03  # s of wall time for an answer where none is to be expected
_PERIODS = 12  # a fault lasts, unless it says otherwise
_AFTER = 30  # ordinary periods after it

# Bits of gustform_bridge/faults.h by name.
FAULT_NAMES = (
    *("TIMEOUT", "COUNTER", "CRC", "LENGTH", "MULTIPLEXER", "NOT_FINITE", "RANGE", "PLAUSIBILITY", "STALE"),
    *("MASQUERADE", "BUS_OFF", "SEND", "FINGERPRINT", "EMERGENCY_STOP", "CONVERTER", "CONTROLLER", "DEADLINE"),
    *("WATCHDOG", "HEARTBEAT"),
)


def fault_names(bits: int) -> list[str]:
    """What the bridge says led to SAFE."""
    return [name for bit, name in enumerate(FAULT_NAMES) if bits >> bit & 1]


@dataclass(frozen=True)
class Outcome:
    """What became of one fault. `detected`: it was not taken for a good sample, or led to SAFE. `to_safe_ms`: bus
    time; None where it was tolerated. `wall_ms`: the same by this computer's clock, from the first frame of the fault
    to the arrival of the first blocked references. `good`: as specified."""

    fault: str
    detected: bool
    to_safe_ms: float | None
    tolerated: bool
    wall_ms: float | None
    periods: int | None  # of the bus
    expected: str
    faults: list[str]
    violations: list[str]

    @property
    def good(self) -> bool:
        if not self.detected or self.violations:
            return False
        if self.expected == "tolerated":
            return self.tolerated
        return self.periods is not None and self.periods <= LIMIT and self.expected in self.faults


@dataclass
class Fault:
    """One of them. `send`: in place of the measurements, in period k of the fault; `expected`: the bit of the bridge
    that must be among those told, or "tolerated"; `periods`: how long it lasts."""

    name: str
    expected: str
    send: Callable[[Bench, int], None]
    periods: int = _PERIODS
    around: Callable[[Bench], AbstractContextManager[object]] = lambda bench: nullcontext()


def inject(bench: Bench, fault: Fault) -> Outcome:
    """One fault into a running bridge, and a way back to RUN."""
    bench.run()
    before = len(bench.violations)
    watch = _Watch(bench)
    rejected = False
    with ExitStack() as stack:
        stack.enter_context(fault.around(bench))
        watch.begin = time.time()
        for k in range(fault.periods):
            tick = bench.tick(lambda bench, k=k: fault.send(bench, k))  # type: ignore[misc]
            rejected = rejected or _rejected(bench, tick)
            watch.see(tick)
    for _ in range(_AFTER):
        watch.see(bench.tick())
    safe = bench.state == State.SAFE
    names = fault_names(bench.client.heard.faults) if safe else []
    if safe:
        _stays(bench)
    periods = None if watch.blocked is None else watch.blocked + 1
    outcome = Outcome(
        fault.name,
        rejected or safe,
        None if periods is None else periods * bench.converter.period * 1e3,
        watch.blocked is None and not safe,
        watch.wall_ms,
        periods,
        fault.expected,
        names,
        bench.violations[before:],
    )
    bench.run()
    return outcome


class _Watch:
    """From when on the references of a fault are blocked; an enabled one after that is a violation."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._ticks = 0
        self.begin = 0.0
        self.blocked: int | None = None  # period of the fault
        self.wall_ms: float | None = None

    def see(self, tick: Tick) -> None:
        references = tick.references
        if references is None or not references.enabled:
            if self.blocked is None:
                self.blocked = self._ticks
                self.wall_ms = None if references is None else 1e3 * (references.time - self.begin)
        elif self.blocked is not None:
            later = self._ticks - self.blocked
            self._bench.violations.append(f"sample {tick.sample}: enabled {later} periods after SAFE")
        self._ticks += 1


def _rejected(bench: Bench, tick: Tick) -> bool:
    """Whether the sample of this period was not acted on: what was sent answers an older one."""
    return tick.references is not None and bench.age(tick) > 0


def _stays(bench: Bench) -> None:
    """Neither time, nor start, nor a repeated frame of the operator leads out of SAFE."""
    for command in (Command.START, Command.STOP):
        bench.operator.press(command)
        bench.ticks(3)
    bench.operator.repeat(Command.RESET)
    tick = bench.ticks(3)
    if bench.state != State.SAFE or (tick.references is not None and tick.references.enabled):
        bench.violations.append("SAFE was left without a reset")


def wrong_from_the_start(bench: Bench, periods: int = 200) -> list[str]:
    """With a fingerprint of another database, a bridge that has just begun must neither get ready nor start."""
    bench.converter.fingerprint ^= 1
    for number in range(periods):
        if number % 50 == 49:
            bench.operator.press(Command.START)
        tick = bench.tick()
        ready = bench.state in (State.READY, State.RUN)
        if ready or (tick.references is not None and tick.references.enabled):
            bench.violations.append(f"sample {tick.sample}: ready for a converter with another database")
    return bench.violations


# ---- the twelve -----------------------------------------------------------------------------------------------------


def faults(bench: Bench, seed: int = 1) -> list[Fault]:
    """The twelve."""
    nonsense = "NOT_FINITE" if bench.first.real else "RANGE"
    return [
        Fault("loss", "tolerated", _lost, periods=2),
        Fault("burst_loss", "TIMEOUT", _lost),
        Fault("bit_flip", "CRC", _flipped(random.Random(seed))),
        Fault("stale_repeat", "STALE", _repeated),
        Fault("counter_jump", "COUNTER", _jumped),
        Fault("nan_valid_crc", nonsense, _not_a_number),
        Fault("wrong_length", "LENGTH", _shortened),
        Fault("masquerade", "MASQUERADE", _masqueraded),
        Fault("delay", "STALE", _delayed(2)),
        Fault("bus_off_frame", "BUS_OFF", _bus_off),
        Fault("wrong_fingerprint", "FINGERPRINT", _wrong_fingerprint),
        Fault("enobufs_flood", "SEND", _ordinary, around=_flooded),
    ]


@contextmanager
def _flooded(bench: Bench) -> Iterator[None]:
    """The bridge cannot send, so its answers are not waited for at length."""
    patience, bench.patience = bench.patience, SILENCE
    try:
        with Flood(bench.client.bus):
            yield
    finally:
        bench.patience = patience


def _ordinary(bench: Bench, k: int) -> None:
    bench.client.put(bench.measure())


def _lost(bench: Bench, k: int) -> None:
    bench.measure()  # counted by the sender, and gone


def _flipped(random_: random.Random) -> Callable[[Bench, int], None]:
    def send(bench: Bench, k: int) -> None:
        damaged = []
        for frame in bench.measure():
            data = bytearray(frame.data)
            bit = random_.randrange(8 * len(data))
            data[bit // 8] ^= 1 << bit % 8
            damaged.append(replace(frame, data=bytes(data)))
        bench.client.put(damaged)

    return send


def _repeated(bench: Bench, k: int) -> None:
    """The last good sample again and again: a gateway that is stuck."""
    bench.client.put(bench.measured)


def _jumped(bench: Bench, k: int) -> None:
    if k == 0:
        bench.client.skip(Part.MEASUREMENTS, 7)
    _ordinary(bench, k)


def _not_a_number(bench: Bench, k: int) -> None:
    """NaN in the first quantity, under a good CRC. An integer has none: there, one beyond its range."""
    first = bench.first
    largest = (1 << (first.length - (1 if first.signed else 0))) - 1
    value = math.nan if first.real else largest * first.scale + first.offset
    values = {**bench.measurements, first.quantity: value, "sample": bench.converter.sample}
    bench.client.put(bench.client.frames(Part.MEASUREMENTS, values, cut=False))


def _shortened(bench: Bench, k: int) -> None:
    shorter = []
    for frame in bench.measure():
        length = 32 if frame.fd and len(frame.data) > 32 else len(frame.data) - 1
        shorter.append(replace(frame, data=frame.data[: min(length, 8) if length < 12 else length]))
    bench.client.put(shorter)


def _masqueraded(bench: Bench, k: int) -> None:
    """Somebody else commands, with a good CRC and enabled."""
    bench.client.send(Part.REFERENCES, {"enable": 1, "sample": bench.converter.sample})
    _ordinary(bench, k)


def _delayed(periods: int) -> Callable[[Bench, int], None]:
    """A gateway on the way keeps each frame for some periods."""
    queue: list[list[Frame]] = []

    def send(bench: Bench, k: int) -> None:
        if k == 0:
            queue.clear()
        queue.append(bench.measure())
        if len(queue) > periods:
            bench.client.put(queue.pop(0))

    return send


def _bus_off(bench: Bench, k: int) -> None:
    if k == 0:
        bench.client.bus.send(BUS_OFF, bytes(8), fd=False, error=True)
    _ordinary(bench, k)


def _wrong_fingerprint(bench: Bench, k: int) -> None:
    if k == 0:
        told = bench.client.codec.messages.fingerprint ^ 1
        bench.client.send(Part.CONVERTER_FINGERPRINT, {"fingerprint": told})
    _ordinary(bench, k)

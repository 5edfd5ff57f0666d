"""The other side of the bridge: converter and operator, spoken from Python.

A `Client` sends and reads parts of the message set, protected and checked end to end. A `Converter` on top of it is
one node of the bus in the order of the bridge's clock: each period what is cyclic, set points, the measurements of a
sample, then Sync. An `Operator` presses the buttons.

GF8077 the bridge does not answer
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

from gustform.language.errors import GustformError
from gustform_hil.bus import Bus
from gustform_hil.codec import Codec
from gustform_hil.decoding import Received, decode, names_of
from gustform_hil.message_set import Field, Message, Part

if TYPE_CHECKING:
    import can

ANSWER = 2.0  # s of wall time for an answer; a bridge that runs needs less than a millisecond
Values = Mapping[str, float]


class State(IntEnum):
    """Of the bridge."""

    INIT = 0
    READY = 1
    RUN = 2
    SAFE = 3


class Command(IntEnum):
    """Of the operator."""

    NONE = 0
    START = 1
    STOP = 2
    RESET = 3


class ConverterState(IntEnum):
    """What the converter says of itself."""

    OFF = 0
    READY = 1
    RUNNING = 2
    TRIPPED = 3


@dataclass(frozen=True)
class Frame:
    """Bytes for the bus."""

    identifier: int
    data: bytes
    fd: bool
    extended: bool = False


@dataclass(frozen=True)
class References:
    """All pieces of the commands for one sample."""

    sample: int
    enabled: bool
    values: dict[str, float]
    time: float


@dataclass
class Heard:
    """The last that the bridge has said of itself, and how many frames were bad."""

    state: State | None = None
    faults: int = 0
    errors: int = 0
    fingerprint: int | None = None
    heartbeats: int = 0
    bad: Counter[str] = field(default_factory=Counter)


class Client:
    """Sends and reads parts of the message set over a bus; counts each message's frames."""

    def __init__(self, bus: Bus, codec: Codec) -> None:
        self.bus, self.codec = bus, codec
        self.heard = Heard()
        self._counters: Counter[str] = Counter()
        self._pieces: dict[int, dict[int, Received]] = {}
        self._names = names_of(codec.messages)
        self._parts = {part: codec.messages.pieces(part) for part in Part}
        self._n_pieces = len(self._parts[Part.REFERENCES])

    def frames(self, part: Part, values: Values, *, cut: bool = True) -> list[Frame]:
        """The frames of a part with their next counters; nothing is sent. `cut`: values out of range are cut to it."""
        made = []
        for message in self._parts[part]:
            count = self._counters[message.name]
            self._counters[message.name] += 1
            data = self.codec.encode(message, self._signals(message, values), count, cut=cut)
            made.append(Frame(message.id, data, message.fd, message.extended))
        return made

    def _signals(self, message: Message, values: Values) -> dict[str, float]:
        """Values by the names of the signals; what is not given is sent as safe, numbers of samples begin again."""
        names = self._names[message.name]
        given = {s.name: values.get(names[s.name], s.safe) for s in message.signals if s.name in names}
        sample = message.signal(Field.SAMPLE)
        if sample is not None:
            given[sample.name] %= sample.high + 1
        return given

    def skip(self, part: Part, frames: int = 1) -> None:
        """Count frames as if they had been sent: what a loss looks like from the other side."""
        for message in self._parts[part]:
            self._counters[message.name] += frames

    def put(self, frames: list[Frame]) -> bool:
        """Send frames; False if the queue was full for one of them."""
        sent = [self.bus.send(frame.identifier, frame.data, fd=frame.fd, extended=frame.extended) for frame in frames]
        return all(sent)

    def send(self, part: Part, values: Values) -> bool:
        """Send all pieces of a part."""
        return self.put(self.frames(part, values))

    def receive(self, timeout: float) -> Received | can.Message | None:
        """The next frame: decoded if it belongs to the message set, as it is if not; None after `timeout` s."""
        frame = self.bus.receive(timeout)
        if frame is None:
            return None
        found = decode(self.codec, self._names, frame)
        if found is None:
            return frame
        self._note(found)
        return found

    def _note(self, found: Received) -> None:
        if found.problem is not None:
            self.heard.bad[found.problem.name] += 1
        elif found.message.part == Part.CONTROLLER_STATE:
            self.heard.state = State(int(found.values["state"]))
            self.heard.faults = int(found.values["faults"])
            self.heard.errors = int(found.values["errors"])
        elif found.message.part == Part.CONTROLLER_HEARTBEAT:
            self.heard.heartbeats += 1
        elif found.message.part == Part.CONTROLLER_FINGERPRINT:
            self.heard.fingerprint = int(found.values["fingerprint"])

    def references(self, found: Received | can.Message | None) -> References | None:
        """The commands of a sample, when this frame is the last piece of them."""
        if not isinstance(found, Received) or found.problem is not None or found.message.part != Part.REFERENCES:
            return None
        sample = int(found.values["sample"])
        pieces = self._pieces.setdefault(sample, {})
        pieces[found.message.piece] = found
        if len(pieces) < self._n_pieces:
            return None
        self._pieces = {}
        values: dict[str, float] = {}
        for piece in pieces.values():
            values |= piece.values
        enabled = values.pop("enable") == 1.0
        del values["sample"]
        return References(sample, enabled, values, found.time)

    def drain(self) -> Iterator[Received | can.Message]:
        """What has come in and was not read yet."""
        while (found := self.receive(0.0)) is not None:
            yield found


class Converter:
    """The converter's node. `tick` is one period of bus time: cyclic frames, set points, measurements, Sync."""

    def __init__(self, client: Client, fingerprint: int | None = None) -> None:
        """`fingerprint`: told to the bridge in place of the database's own."""
        self.client = client
        self.sample = 0  # of the next tick
        self.state = ConverterState.READY
        messages = client.codec.messages
        self.fingerprint = messages.fingerprint if fingerprint is None else fingerprint
        self._ticks = 0
        self._set_points: dict[str, float] | None = None
        sync = messages.pieces(Part.SYNC)[0]
        self.period = sync.cycle * 1e-6  # s
        self._modulus = _samples(sync)
        self.answered = _samples(messages.pieces(Part.REFERENCES)[0])
        cyclic = (Part.CONVERTER_STATE, Part.CONVERTER_HEARTBEAT, Part.CONVERTER_FINGERPRINT, Part.SET_POINTS)
        self._every = {m.part: max(1, round(m.cycle / sync.cycle)) for m in messages.messages if m.part in cyclic}

    def due(self, part: Part) -> bool:
        """Whether a cyclic part is to be sent in this period."""
        every = self._every.get(part)
        return every is not None and self._ticks % every == 0

    def cyclic(self) -> None:
        """State, heartbeat and fingerprint, when it is their time."""
        if self.due(Part.CONVERTER_FINGERPRINT):
            self.introduce()
        elif self.due(Part.CONVERTER_HEARTBEAT):
            self.client.send(Part.CONVERTER_HEARTBEAT, {"uptime": int(self._ticks * self.period)})
        if self.due(Part.CONVERTER_STATE):
            self.client.send(Part.CONVERTER_STATE, {"state": self.state})

    def introduce(self) -> None:
        """As after a start: a sign of life, and which database this side has."""
        for part, values in (
            (Part.CONVERTER_HEARTBEAT, {"uptime": int(self._ticks * self.period)}),
            (Part.CONVERTER_FINGERPRINT, {"fingerprint": self.fingerprint}),
        ):
            if part in self._every:
                self.client.send(part, values)

    def announce(self, state: ConverterState) -> None:
        """A new state, told at once."""
        if state != self.state:
            self.state = state
            self.client.send(Part.CONVERTER_STATE, {"state": state})

    def set_points(self, values: Values) -> None:
        """The operating point: at once when it changes, else when it is its time."""
        if not values:
            return
        if dict(values) != self._set_points or self.due(Part.SET_POINTS):
            self._set_points = dict(values)
            self.client.send(Part.SET_POINTS, values)

    def tick(self, measurements: Values, set_points: Values | None = None) -> int:
        """One period; the number of its sample."""
        self.cyclic()
        self.set_points(set_points or {})
        self.client.send(Part.MEASUREMENTS, {**measurements, "sample": self.sample})
        return self.sync()

    def sync(self) -> int:
        """Sync alone, the end of a period; the number of its sample."""
        sample = self.sample
        self.client.send(Part.SYNC, {"sample": sample})
        self.sample = (sample + 1) % self._modulus
        self._ticks += 1
        return sample

    def answer(self, sample: int, check: Callable[[], None] | None = None, patience: float = ANSWER) -> References:
        """Wait for the references that the tick of `sample` made the bridge send. Others are read on the way.

        GF8077 if none come; `check` may raise something better first.
        """
        deadline = time.monotonic() + patience
        while True:
            found = self.client.receive(max(0.0, deadline - time.monotonic()))
            if found is None:
                if check is not None:
                    check()
                raise GustformError(
                    "GF8077",
                    f"the bridge must answer to sample {sample}; it has not for {patience:g} s",
                    hint="gust-bridge --interface IF --clock sync, on the same interface and with the same database",
                )
            references = self.client.references(found)
            if references is not None and references.sample == sample % self.answered:
                return references


def _samples(message: Message) -> int:
    """How many numbers of samples there are before they begin again."""
    sample = message.signal(Field.SAMPLE)
    assert sample is not None, "the mapping has been checked"
    return int(sample.high) + 1


class Operator:
    """The operator's node. Each press has a nonce of its own."""

    def __init__(self, client: Client, nonce: int = 1) -> None:
        self.client = client
        self.nonce = nonce

    def press(self, command: Command) -> None:
        """A new command."""
        self.nonce = (self.nonce + 1) % 65536
        self.repeat(command)

    def repeat(self, command: Command) -> None:
        """The last nonce again: a frame that was repeated, not a button that was pressed."""
        self.client.send(Part.OPERATOR_COMMAND, {"command": command, "nonce": self.nonce})

    def emergency_stop(self) -> None:
        """The red button."""
        self.client.send(Part.EMERGENCY_STOP, {"command": 1})

"""Whether a message set fits a bus: load and worst-case response times at given bit rates, and refusal if it does not.

The deadline of a message is the distance of two of its frames: the next one shall not find the last one still waiting.
Messages on events have none in the database; theirs is assumed, and the report says so. All messages of a database
count, whether a mapping uses them or not: they share the bus.

GF8120 bit rate; GF8121 bus overloaded; GF8122 deadline missed; GF8123 time of an option; GF8124 length of a frame;
GF8125 sender of an option.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from gustform.language.errors import GustformError
from gustform_hil.frame_time import FD_LENGTHS, BitRates, frame_bits
from gustform_hil.message_set import MessageSet, Part
from gustform_hil.response_time import Bus, Traffic, load, response_times

NOMINAL_RATES = (125_000, 250_000, 500_000, 1_000_000)
DATA_RATES = (1_000_000, 2_000_000, 4_000_000, 5_000_000, 8_000_000)
EVENT_DISTANCE = Fraction(10, 1000)
# Those of bridge.c that take turns.
_SLOW = (
    Part.CONTROLLER_STATE,
    Part.PARAMETER_RESPONSE,
    Part.CONTROLLER_HEARTBEAT,
    Part.CONTROLLER_FINGERPRINT,
)
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Frame:
    """What the bus sees of a message. `distance`, s: of two frames, at least; `event`: not cyclic, so it is assumed;
    `paced`, s: of any two of those frames of its sender that are paced, None if it is not."""

    name: str
    senders: tuple[str, ...]
    identifier: int
    extended: bool
    fd: bool
    length: int
    distance: Fraction
    event: bool
    paced: Fraction | None = None

    @property
    def sender(self) -> str:
        """As text."""
        return ", ".join(self.senders)

    @property
    def urgency(self) -> tuple[int, int, int]:
        """Smaller wins the arbitration: the first 11 bits, then 11-bit before 29-bit, then the rest."""
        if self.extended:
            return self.identifier >> 18, 1, self.identifier & 0x3FFFF
        return self.identifier, 0, 0


@dataclass(frozen=True)
class Assumptions:
    """About senders and wire: every frame may be queued `jitter` s late; one error per `error_interval` s, or none. The
    senders of each of `queues` share an interface with a plain queue; all others offer what is most urgent."""

    jitter: Fraction = _ZERO
    error_interval: Fraction | None = None
    queues: tuple[frozenset[str], ...] = ()


@dataclass(frozen=True)
class Row:
    """One message, times in seconds; `response` None: none can be given."""

    frame: Frame
    time: Fraction
    response: Fraction | None

    @property
    def deadline(self) -> Fraction:
        """The next frame."""
        return self.frame.distance

    @property
    def fits(self) -> bool:
        """Whether it is on time."""
        return self.response is not None and self.response <= self.deadline


@dataclass(frozen=True)
class Budget:
    """A message set at two bit rates, most urgent message first."""

    name: str
    rates: BitRates
    assumptions: Assumptions
    load: Fraction
    rows: tuple[Row, ...]

    @property
    def fits(self) -> bool:
        """Whether every message is on time."""
        return all(row.fits for row in self.rows)

    @property
    def fd(self) -> bool:
        """Whether there is a second bit rate."""
        return any(row.frame.fd for row in self.rows)


def budget(name: str, frames: Sequence[Frame], rates: BitRates, assumptions: Assumptions | None = None) -> Budget:
    """Times of all messages. GF8120 for rates that no bus has, GF8125 for queues of unknown senders."""
    _check_rates(rates)
    assumed = assumptions or Assumptions()
    _check_queues(frames, assumed.queues)
    ordered = sorted(frames, key=lambda frame: frame.urgency)
    traffic = [
        Traffic(
            name=f.name,
            time=_time(f, rates),
            period=f.distance,
            deadline=f.distance,
            jitter=assumed.jitter,
            queue=_queue(f, assumed.queues),
            sender=f.sender,
            paced=f.paced,
        )
        for f in ordered
    ]
    bus = Bus(Fraction(1, rates.nominal), assumed.error_interval)
    rows = (
        Row(frame, t.time, response)
        for frame, t, response in zip(ordered, traffic, response_times(traffic, bus), strict=True)
    )
    return Budget(name, rates, assumed, load(traffic), tuple(rows))


def _queue(frame: Frame, queues: Sequence[frozenset[str]]) -> str | None:
    """The plain queue that a frame waits in, by a name."""
    return next(("+".join(sorted(queue)) for queue in queues if not queue.isdisjoint(frame.senders)), None)


def _check_queues(frames: Sequence[Frame], queues: Sequence[frozenset[str]]) -> None:
    known = {sender for f in frames for sender in f.senders}
    named = [sender for queue in queues for sender in sorted(queue)]
    for sender in named:
        if sender not in known or named.count(sender) > 1:
            what = "is no sender of the database" if sender not in known else "can have one queue only"
            raise GustformError(
                "GF8125", f"{sender!r} {what}; there are {', '.join(sorted(known))}", hint="--fifo CTRL"
            )


def _time(frame: Frame, rates: BitRates) -> Fraction:
    # An FD frame has one of a few lengths: what is shorter is filled up.
    length = next(n for n in FD_LENGTHS if n >= frame.length) if frame.fd else frame.length
    return frame_bits(length, fd=frame.fd, extended=frame.extended, identifier=frame.identifier).time(rates)


def _check_rates(rates: BitRates) -> None:
    if not 10_000 <= rates.nominal <= 1_000_000:
        raise GustformError(
            "GF8120",
            f"the bit rate must be 10 kbit/s to 1 Mbit/s; got {rate_text(rates.nominal)}",
            hint="--bitrate 500k",
        )
    if not rates.nominal <= rates.data <= 8_000_000:
        raise GustformError(
            "GF8120",
            f"the data bit rate must be at least the bit rate and at most 8 Mbit/s; got {rate_text(rates.data)}",
            hint="--data-bitrate 2M",
        )


def refuse(found: Budget) -> None:
    """GF8121 if the bus is overloaded, GF8122 for the message that is furthest behind its deadline."""
    if found.fits:
        return
    hint = _way_out(found)
    if found.load >= 1:
        first = next(row.frame.name for row in found.rows if row.response is None)
        raise GustformError(
            "GF8121",
            f"{found.name} needs {float(found.load):.1%} of a bus at {rates_text(found)}: {first} and all that are less"
            " urgent may wait for ever",
            hint=hint,
        )
    late = max(
        (row for row in found.rows if not row.fits),
        key=lambda row: Fraction(10**9) if row.response is None else row.response / row.deadline,
    )
    takes = "for ever" if late.response is None else f"{_ms(late.response)} ms"
    raise GustformError(
        "GF8122",
        f"{late.frame.name} of {found.name} may take {takes} at {rates_text(found)}; its deadline is"
        f" {_ms(late.deadline)} ms",
        hint=hint,
    )


def _way_out(found: Budget) -> str:
    """The lowest usual bit rates above the present ones that fit; else how much longer all cycles must be."""
    frames = [row.frame for row in found.rows]
    for nominal in (n for n in NOMINAL_RATES if n >= found.rates.nominal):
        for data in (d for d in DATA_RATES if d >= max(found.rates.data, nominal)) if found.fd else (nominal,):
            if budget(found.name, frames, BitRates(nominal, data), found.assumptions).fits:
                text = f"--bitrate {short_rate(nominal)}"
                return f"{text} --data-bitrate {short_rate(data)}" if found.fd else text
    for factor in (2, 3, 4, 5, 10, 20, 50, 100):
        slower = [replace(f, distance=f.distance * factor) for f in frames]
        if budget(found.name, slower, found.rates, found.assumptions).fits:
            return f"cycle times that are {factor} times as long"
    return "fewer messages"


def rate_text(rate: int) -> str:
    """As people say it: 500 kbit/s, 2 Mbit/s."""
    return f"{rate / 1e6:g} Mbit/s" if rate >= 1_000_000 else f"{rate / 1e3:g} kbit/s"


def short_rate(rate: int) -> str:
    """As the options take it: 500k, 2M."""
    return f"{rate / 1e6:g}M" if rate >= 1_000_000 else f"{rate / 1e3:g}k"


def rates_text(found: Budget) -> str:
    """One rate, or both where there are FD frames."""
    text = rate_text(found.rates.nominal)
    return f"{text}, data {rate_text(found.rates.data)}" if found.fd else text


def _ms(seconds: Fraction) -> str:
    return f"{float(seconds * 1000):.3f}"


def frames_of(
    messages: Sequence[Any],
    event_distance: Fraction = EVENT_DISTANCE,
    cycles: Mapping[str, Fraction] | None = None,
    paced: Mapping[str, Fraction] | None = None,
) -> list[Frame]:
    """What the bus sees of the messages of a cantools database: `event_distance`, s, is that of messages on events,
    `cycles` are those that a mapping gives in place of the database's, `paced` see `paced_by_the_bridge`. GF8124."""
    cycles, paced = cycles or {}, paced or {}
    return [_frame(message, event_distance, cycles.get(message.name), paced.get(message.name)) for message in messages]


def paced_by_the_bridge(messages: MessageSet) -> dict[str, Fraction]:
    """What a gust-bridge sends besides references: one of these messages in each of its periods, which is in s."""
    references = messages.find(Part.REFERENCES)
    slow = [message.name for part in _SLOW for message in messages.pieces(part)]
    return {} if references is None else dict.fromkeys(slow, Fraction(references.cycle, 1_000_000))


def _frame(message: Any, event_distance: Fraction, mapped: Fraction | None, paced: Fraction | None) -> Frame:
    cycle = Fraction(message.cycle_time or 0) / 1000 if mapped is None else mapped
    if not message.is_fd and message.length > 8:
        raise GustformError(
            "GF8124",
            f"{message.name} has {message.length} bytes and is no FD frame; a classic one has at most 8",
            hint="VFrameFormat StandardCAN_FD",
        )
    return Frame(
        name=message.name,
        senders=tuple(message.senders) or ("anyone",),
        identifier=message.frame_id,
        extended=message.is_extended_frame,
        fd=message.is_fd,
        length=message.length,
        distance=cycle or event_distance,
        event=not cycle,
        paced=paced,
    )

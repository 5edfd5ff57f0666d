"""A message set as data: what a CAN database and its mapping say, checked, ready for C, Python and the budget.

The numbers of parts and fields are those of gustform_bridge/messages.h. Values are in the unit of the controller:
where the database has volts and the controller per unit, the mapping's base is already in scale, offset and range.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

MOST_SIGNALS = 32  # of one message: GUST_MESSAGE_SIGNALS


class Part(IntEnum):
    """What a message is for."""

    SYNC = 0
    MEASUREMENTS = 1
    REFERENCES = 2
    SET_POINTS = 3
    CONTROLLER_STATE = 4
    CONVERTER_STATE = 5
    OPERATOR_COMMAND = 6
    EMERGENCY_STOP = 7
    PARAMETER_REQUEST = 8
    PARAMETER_RESPONSE = 9
    CONTROLLER_HEARTBEAT = 10
    CONVERTER_HEARTBEAT = 11
    CONTROLLER_FINGERPRINT = 12
    CONVERTER_FINGERPRINT = 13


class Field(IntEnum):
    """What a signal means within its part."""

    QUANTITY = 0
    E2E_CRC = 1
    E2E_COUNTER = 2
    SAMPLE = 3
    ENABLE = 4
    STATE = 5
    FAULTS = 6
    ERRORS = 7
    COMMAND = 8
    NONCE = 9
    OPERATION = 10
    PARAMETER = 11
    VALUE = 12
    RESULT = 13
    UPTIME = 14
    FINGERPRINT = 15


E2E_FIELDS = frozenset({Field.E2E_CRC, Field.E2E_COUNTER})


@dataclass(frozen=True)
class E2E:
    """End-to-end protection: AUTOSAR profile 1, 2 or 5, header first in the frame; 0: none."""

    profile: int = 0
    data_id: int = 0
    id_list: bytes = b""  # the 16 data ids of profile 2

    @property
    def modulo(self) -> int:
        """What the counter counts modulo; 1 without protection."""
        return {1: 15, 2: 16, 5: 256}.get(self.profile, 1)

    @property
    def crc_bits(self) -> int:
        """Length of the CRC, which begins at bit 0."""
        return {1: 8, 2: 8, 5: 16}.get(self.profile, 0)

    @property
    def counter_bits(self) -> int:
        """Length of the counter, which follows the CRC."""
        return {1: 4, 2: 4, 5: 8}.get(self.profile, 0)


@dataclass(frozen=True)
class Signal:
    """One signal of a message: where it lies, what it means and what it may be."""

    name: str
    field: Field
    quantity: str  # "v_dc", "omega_gsc"; "" for other fields
    unit: str
    start: int  # as in the DBC: bit number of the least bit (Intel) or of the most significant one (Motorola)
    length: int
    motorola: bool
    signed: bool
    real: bool  # IEEE 754, 32 or 64 bits
    scale: float  # value = raw * scale + offset
    offset: float
    low: float  # values that the signal can carry and the range allows, exactly as decoding gives them
    high: float
    safe: float  # sent for NaN, and in SAFE
    multiplexed: int = -1  # value of the multiplexer it is there for; -1: always
    choices: Mapping[int, str] = dataclasses.field(default_factory=dict)
    comment: str = ""


@dataclass(frozen=True)
class Message:
    """One message of the set."""

    name: str
    id: int
    extended: bool
    fd: bool
    length: int
    part: Part
    piece: int
    cycle: int  # us; 0: on events
    e2e: E2E
    signals: tuple[Signal, ...]
    multiplexer: int = -1  # number of the signal that is the multiplexer; -1: none
    multiplexer_values: tuple[int, ...] = ()
    senders: tuple[str, ...] = ()
    comment: str = ""

    def signal(self, field: Field, quantity: str | None = None) -> Signal | None:
        """The first signal with this field (and quantity, unless None)."""
        for signal in self.signals:
            if signal.field == field and quantity in (None, signal.quantity):
                return signal
        return None

    def active(self, multiplexer: int | None) -> Iterator[Signal]:
        """The signals that are there with this value of the multiplexer."""
        return (s for s in self.signals if s.multiplexed in (-1, multiplexer))


@dataclass(frozen=True)
class MessageSet:
    """All messages, by ascending identifier."""

    name: str  # a C identifier: prefix of the generated code
    messages: tuple[Message, ...]

    @cached_property
    def by_name(self) -> Mapping[str, Message]:
        """Messages by their name in the database."""
        return {m.name: m for m in self.messages}

    @cached_property
    def by_id(self) -> Mapping[tuple[int, bool], Message]:
        """Messages by identifier and whether it is an extended one."""
        return {(m.id, m.extended): m for m in self.messages}

    def find(self, part: Part, piece: int = 0) -> Message | None:
        """The message of a part, None if the set has none."""
        return next((m for m in self.messages if m.part == part and m.piece == piece), None)

    def pieces(self, part: Part) -> tuple[Message, ...]:
        """All messages of a part, in the order of their pieces."""
        return tuple(sorted((m for m in self.messages if m.part == part), key=lambda m: m.piece))

    @cached_property
    def fingerprint(self) -> int:
        """CRC-32 of what both sides must agree on; names, comments and cycle times are not part of it."""
        return zlib.crc32(canonical(self).encode())


def canonical(messages: MessageSet) -> str:
    """The text behind the fingerprint: identifiers, layouts, scaling, ranges, units, meanings, E2E."""
    lines = ["gustform message set 1"]
    for m in messages.messages:
        kind = ("extended" if m.extended else "standard") + (" fd" if m.fd else " classic")
        lines.append(f"message {m.id:x} {kind} {m.length} {m.part.name} {m.piece}")
        lines.append(f"e2e {m.e2e.profile} {m.e2e.data_id:x} {m.e2e.id_list.hex()}")
        lines.append("multiplexer " + " ".join(str(v) for v in m.multiplexer_values))
        for s in sorted(m.signals, key=lambda s: (s.multiplexed, s.start)):
            kind = "real" if s.real else "signed" if s.signed else "unsigned"
            order = "motorola" if s.motorola else "intel"
            numbers = " ".join(repr(float(x)) for x in (s.scale, s.offset, s.low, s.high))
            meaning = f"{s.multiplexed} {s.field.name} {s.quantity} {s.unit}"
            lines.append(f"signal {s.start} {s.length} {order} {kind} {numbers} {meaning}")
    return "\n".join(lines)

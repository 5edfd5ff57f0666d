"""Frames from values and back, by cantools and autosar-e2e: what the C of the bridge is measured against.

The checks and their order are those of gustform_bridge/messages.h.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from gustform.language.errors import GustformError, did_you_mean
from gustform_hil.cantools_messages import plain_message
from gustform_hil.e2e import Protector
from gustform_hil.message_set import E2E_FIELDS, Message, MessageSet, Signal


class Problem(IntEnum):
    """Why a frame was refused: enum gust_decoded."""

    UNKNOWN_ID = 1
    WRONG_LENGTH = 2
    BAD_CRC = 3
    UNKNOWN_MULTIPLEXER = 4
    NOT_FINITE = 5
    OUT_OF_RANGE = 6


@dataclass(frozen=True)
class Decoded:
    """A frame as it was understood. Values by the names of the signals, none where there is a problem."""

    message: Message | None
    problem: Problem | None
    values: Mapping[str, float] = field(default_factory=dict)
    counter: int = 0


class Codec:
    """Encodes and decodes the messages of a set."""

    def __init__(self, messages: MessageSet) -> None:
        """Raises GF8000 if cantools or autosar-e2e is not installed."""
        self.messages = messages
        self._coders = {m.name: _Coder(m) for m in messages.messages}

    def encode(self, message: Message | str, values: Mapping[str, float], counter: int, *, cut: bool = True) -> bytes:
        """The bytes of a message, protected with `counter` (modulo what its profile counts).

        Values by the names of the signals; those of the E2E header are not needed. What is out of range is cut to it
        and NaN becomes the safe value, as in C; with `cut` False it is sent as it is, which no sound sender does.
        Raises GF8030 (no such message), GF8031 (a value is not given), GF8032 (a value cannot be carried).
        """
        return self._coder(message).encode(values, counter, cut)

    def cut(self, message: Message | str, values: Mapping[str, float]) -> dict[str, float]:
        """The values that `encode` would send, before they are rounded to what the bits carry."""
        coder = self._coder(message)
        return {s.name: limited(s, coder.value(s, values)) for s in coder.active(values) if s.field not in E2E_FIELDS}

    def protect(self, message: Message | str, data: bytearray, counter: int) -> None:
        """Write counter and CRC into bytes that may say anything, as only a faulty sender would."""
        self._coder(message).protector.protect(data, counter)

    def decode(
        self, identifier: int, data: bytes, *, fd: bool, extended: bool = False, remote: bool = False
    ) -> Decoded:
        """What a frame says, or why it says nothing."""
        message = self.messages.by_id.get((identifier, extended))
        if message is None:
            return Decoded(None, Problem.UNKNOWN_ID)
        if remote or fd != message.fd or len(data) != message.length:
            return Decoded(message, Problem.WRONG_LENGTH)
        return self._coders[message.name].decode(data)

    def _coder(self, message: Message | str) -> _Coder:
        name = message if isinstance(message, str) else message.name
        if name not in self._coders:
            raise GustformError(
                "GF8030", f"the message must be one of the set; got {name!r}", hint=did_you_mean(name, self._coders)
            )
        return self._coders[name]


def limited(signal: Signal, value: float) -> float:
    """The value cut to the range of its signal; NaN becomes the safe one."""
    return signal.safe if math.isnan(value) else min(max(value, signal.low), signal.high)


class _Coder:
    """One message. For each value of the multiplexer there is a plain message of cantools with what is there then."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self.protector = Protector(message.e2e)
        self.multiplexer = message.signals[message.multiplexer] if message.multiplexer >= 0 else None
        keys: Sequence[int | None] = message.multiplexer_values if self.multiplexer else (None,)
        self._signals = {key: tuple(message.active(key)) for key in keys}
        self._plain: dict[int | None, Any] = {
            key: plain_message(message, signals) for key, signals in self._signals.items()
        }
        self._first = plain_message(message, (self.multiplexer,)) if self.multiplexer else None

    def active(self, values: Mapping[str, float]) -> tuple[Signal, ...]:
        """The signals that are there with these values."""
        return self._signals[self._key(values)]

    def value(self, signal: Signal, values: Mapping[str, float]) -> float:
        """The value of a signal. Raises GF8031."""
        if signal.name not in values:
            raise GustformError("GF8031", f"{self.message.name} must have a value for {signal.name}; got none")
        return float(values[signal.name])

    def _key(self, values: Mapping[str, float]) -> int | None:
        if self.multiplexer is None:
            return None
        value = self.value(self.multiplexer, values)
        known = self.message.multiplexer_values
        if value not in known:
            raise GustformError(
                "GF8032",
                f"{self.message.name}.{self.multiplexer.name} must be one of {known}; got {value:g}",
                hint=str(known[0]),
            )
        return int(value)

    def encode(self, values: Mapping[str, float], counter: int, cut: bool) -> bytes:
        key = self._key(values)
        raw: dict[str, float] = {}
        for signal in self._signals[key]:
            if signal.field in E2E_FIELDS:
                raw[signal.name] = 0
                continue
            value = self.value(signal, values)
            raw[signal.name] = self._raw(signal, limited(signal, value) if cut else value)
        data = bytearray(self._plain[key].encode(raw, scaling=False, padding=False, strict=False))
        self.protector.protect(data, counter)
        return bytes(data)

    def _raw(self, signal: Signal, value: float) -> float:
        scaled = value if signal.scale == 1 and signal.offset == 0 else (value - signal.offset) / signal.scale
        if signal.real:
            # Without a cut also what no float can hold: as infinity, which is what a conversion in C makes of it.
            beyond = signal.length == 32 and math.isfinite(scaled) and abs(scaled) >= _BEYOND_FLOAT
            return math.copysign(math.inf, scaled) if beyond else scaled
        if not math.isfinite(scaled):
            text = f"{self.message.name}.{signal.name} must be finite to be carried by an integer; got {value}"
            raise GustformError("GF8032", text)
        code = _rounded(scaled)
        least = -(1 << (signal.length - 1)) if signal.signed else 0
        if not 0 <= code - least < 1 << signal.length:
            text = f"{self.message.name}.{signal.name} must fit into {signal.length} bits; got {value:g}"
            raise GustformError("GF8032", text)
        return code

    def decode(self, data: bytes) -> Decoded:
        message = self.message
        if not self.protector.good(data):
            return Decoded(message, Problem.BAD_CRC)
        counter = self.protector.counter(data)
        key: int | None = None
        if self._first is not None and self.multiplexer is not None:
            key = int(self._first.decode(data, decode_choices=False)[self.multiplexer.name])
            if key not in self._plain:
                return Decoded(message, Problem.UNKNOWN_MULTIPLEXER, counter=counter)
        found = self._plain[key].decode(data, decode_choices=False)
        checked = [s for s in self._signals[key] if s.field not in E2E_FIELDS]
        if not all(math.isfinite(found[s.name]) for s in checked):
            return Decoded(message, Problem.NOT_FINITE, counter=counter)
        if not all(s.low <= found[s.name] <= s.high for s in checked):
            return Decoded(message, Problem.OUT_OF_RANGE, counter=counter)
        return Decoded(message, None, {name: float(value) for name, value in found.items()}, counter)


_BEYOND_FLOAT = 2.0**128 - 2.0**103  # half a step over the largest float: rounds to infinity


def _rounded(value: float) -> int:
    """The nearest integer, halves away from zero: C's round. Python's goes to the even one."""
    whole = math.trunc(value)
    return whole + (int(math.copysign(1, value)) if abs(value - whole) >= 0.5 else 0)

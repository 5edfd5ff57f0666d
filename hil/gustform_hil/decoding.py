"""Frames of a bus as what they say: values by quantity or by field, as the bench calls them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gustform_hil.codec import Codec, Problem
from gustform_hil.message_set import E2E_FIELDS, Message, MessageSet, Signal

if TYPE_CHECKING:
    import can


@dataclass(frozen=True)
class Received:
    """A frame of the message set. `values` are by quantity or by field, none where there is a `problem`."""

    message: Message
    values: dict[str, float]
    counter: int
    problem: Problem | None
    time: float


Names = Mapping[str, Mapping[str, str]]


def names_of(messages: MessageSet) -> Names:
    """By what the signals of each message are called here, without those of the E2E header."""
    return {m.name: {s.name: key_of(s) for s in m.signals if s.field not in E2E_FIELDS} for m in messages.messages}


def decode(codec: Codec, names: Names, frame: can.Message) -> Received | None:
    """A frame of the bus, or None if it is no data frame of the message set. `names` are those of names_of()."""
    if frame.is_error_frame or frame.is_remote_frame:
        return None
    extended = bool(frame.is_extended_id)
    decoded = codec.decode(frame.arbitration_id, bytes(frame.data), fd=frame.is_fd, extended=extended)
    if decoded.message is None:
        return None
    values = {}
    if decoded.problem is None:
        found = decoded.values
        values = {key: found[name] for name, key in names[decoded.message.name].items() if name in found}
    return Received(decoded.message, values, decoded.counter, decoded.problem, frame.timestamp)


def key_of(signal: Signal) -> str:
    """By what a value is called here: its quantity, or the field: "v_dc", "sample"."""
    return signal.quantity or signal.field.name.lower()

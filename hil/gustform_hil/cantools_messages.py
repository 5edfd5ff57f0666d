"""Messages of a checked set as messages of cantools, with nothing in them that was not checked.

Comments, units and value tables stay behind: cantools prints units into comments of its C as they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from gustform_hil.dbc import cantools
from gustform_hil.message_set import Message, MessageSet, Signal


def plain_message(message: Message, signals: Iterable[Signal]) -> Any:
    """A message of cantools with these signals, none of them multiplexed."""
    return _message(message, [_signal(s) for s in signals])


def database(messages: MessageSet) -> Any:
    """A database of cantools with the whole set, multiplexed where it is."""
    package = cantools()
    return package.database.can.Database(messages=[_multiplexed(m) for m in messages.messages], strict=True)


def _multiplexed(message: Message) -> Any:
    if message.multiplexer < 0:
        return plain_message(message, message.signals)
    name = message.signals[message.multiplexer].name
    signals = []
    for number, s in enumerate(message.signals):
        if number == message.multiplexer:
            signals.append(_signal(s, is_multiplexer=True))
        elif s.multiplexed >= 0:
            signals.append(_signal(s, multiplexer_ids=[s.multiplexed], multiplexer_signal=name))
        else:
            signals.append(_signal(s))
    return _message(message, signals)


def _message(message: Message, signals: list[Any]) -> Any:
    return cantools().database.can.Message(
        message.id,
        message.name,
        message.length,
        signals,
        is_extended_frame=message.extended,
        is_fd=message.fd,
        strict=True,
    )


def _signal(signal: Signal, **multiplexing: Any) -> Any:
    from cantools.database.conversion import BaseConversion

    return cantools().database.can.Signal(
        signal.name,
        signal.start,
        signal.length,
        byte_order="big_endian" if signal.motorola else "little_endian",
        is_signed=signal.signed,
        conversion=BaseConversion.factory(scale=signal.scale, offset=signal.offset, is_float=signal.real),
        minimum=signal.low,
        maximum=signal.high,
        **multiplexing,
    )

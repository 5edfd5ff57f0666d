"""End-to-end protection as a database states it: the attributes E2EProfile, E2EDataId, E2EDataIdList; its header."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gustform.language.errors import Place
from gustform_hil.dbc import Dbc
from gustform_hil.layout import bits
from gustform_hil.message_set import E2E, E2E_FIELDS, Field, Message, Signal
from gustform_hil.mistakes import Mistakes

_PROFILES = {"NONE": 0, "0": 0, "": 0, "P01": 1, "1": 1, "P02": 2, "2": 2, "P05": 5, "5": 5}


def from_attributes(message: Any, definitions: Mapping[str, Any], place: Place, mistakes: Mistakes) -> E2E:
    """What the attributes of a message of cantools say; adds GF8013."""
    text = str(_attribute(message, definitions, "E2EProfile") or "").upper()
    if text not in _PROFILES:
        mistakes.add("GF8013", f"E2EProfile of {message.name} must be NONE, P01, P02 or P05; got {text[:20]!r}", place)
        return E2E()
    profile = _PROFILES[text]
    if profile == 2:
        text = str(_attribute(message, definitions, "E2EDataIdList") or "")
        try:
            return E2E(2, 0, bytes.fromhex(text))
        except ValueError:
            return E2E(2)  # told by check_header, as a list of the wrong length
    if profile:
        value = _attribute(message, definitions, "E2EDataId")
        if not isinstance(value, int) or not 0 <= value <= 0xFFFF:
            text = f"E2EDataId of {message.name} must be a number from 0 to 65535; got {value!r}"
            mistakes.add("GF8013", text, place)
            return E2E(profile)
        return E2E(profile, value)
    return E2E()


def _attribute(message: Any, definitions: Mapping[str, Any], name: str) -> Any:
    attributes = message.dbc.attributes if message.dbc is not None else {}
    definition = definitions.get(name)
    if definition is None:
        return None
    value = attributes[name].value if name in attributes else definition.default_value
    choices = getattr(definition, "choices", None)
    if choices and isinstance(value, int) and 0 <= value < len(choices):
        return choices[value]
    return value


def check_header(message: Message, dbc: Dbc, mistakes: Mistakes) -> None:
    """The header first in the frame, nothing else in it; adds GF8013 and GF8014."""
    e2e, place = message.e2e, dbc.place(message.name)
    if e2e.profile not in (0, 1, 2, 5):
        mistakes.add("GF8013", f"{message.name} must have E2E profile 1, 2 or 5; got {e2e.profile}", place)
        return
    if e2e.profile == 2 and len(e2e.id_list) != 16:
        text = f"the data ids of {message.name} must be 16 bytes (32 hexadecimal digits); got {len(e2e.id_list)}"
        mistakes.add("GF8013", text, place, "E2EDataIdList in the database, or e2e: {profile: 2, data_ids: ...}")
    end = e2e.crc_bits + e2e.counter_bits
    if 8 * message.length < end:
        mistakes.add("GF8014", f"{message.name} must have room for its E2E header of {end} bits", place)
    if e2e.profile in (1, 2) and message.length > 32:
        text = f"{message.name} must be 32 bytes or shorter for a CRC of 8 bits; got {message.length}"
        mistakes.add("GF8013", text, place, "profile 5")
    expected = {Field.E2E_CRC: (0, e2e.crc_bits), Field.E2E_COUNTER: (e2e.crc_bits, e2e.counter_bits)}
    for signal in message.signals:
        where = dbc.place(message.name, signal.name)
        lies = bits(signal.start, signal.length, signal.motorola)
        if signal.field in E2E_FIELDS:
            first, length = expected[signal.field]
            if lies != list(range(first, first + length)) or _scaled(signal):
                text = (
                    f"{message.name}.{signal.name} must be {length} bits from bit {first} on, Intel, unsigned, unscaled"
                    f" (E2E profile {e2e.profile}); got {signal.length} bits from bit {signal.start} on"
                )
                mistakes.add("GF8014", text, where, "the profile that the message has" if length else "an E2EProfile")
        elif min(lies) < end:
            text = f"{message.name}.{signal.name} must begin after the E2E header of {end} bits; got bit {min(lies)}"
            mistakes.add("GF8014", text, where, "another start bit, or e2e: none in the mapping")


def _scaled(signal: Signal) -> bool:
    return signal.signed or signal.real or signal.scale != 1 or signal.offset != 0


def check_data_ids(messages: Sequence[Message], dbc: Dbc, mistakes: Mistakes) -> None:
    """Two messages with the same data ids could be taken for each other; adds GF8013."""
    seen: dict[tuple[int, int, bytes], str] = {}
    for message in messages:
        e2e = message.e2e
        if e2e.profile == 0:
            continue
        key = (e2e.profile, e2e.data_id, e2e.id_list)
        if key in seen:
            text = f"{message.name} must have a data id of its own; {seen[key]} has the same"
            mistakes.add("GF8013", text, dbc.place(message.name), "another E2EDataId or E2EDataIdList")
        seen.setdefault(key, message.name)

"""The generated C against cantools and autosar-e2e, for both shipped message sets and every message of them."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cantools.database
import hypothesis
import pytest
from hypothesis import strategies as st

from gustform_hil.codec import Codec, limited
from gustform_hil.database import BUSES, shipped, shipped_files
from gustform_hil.locate import bridge_folder
from gustform_hil.message_set import E2E_FIELDS, Field, Message, Part, Signal
from tests.support.message_library import ERROR, EXTENDED, FD, REMOTE, MessageLibrary, Status, flags_of

EXAMPLES = 40  # of each property and message; 34 messages
DENORMAL = 5e-324

EVERY = [(bus, message.name) for bus in BUSES for message in shipped(bus).messages]
every_message = pytest.mark.parametrize(("bus", "name"), EVERY, ids=[f"{bus}-{name}" for bus, name in EVERY])
few = hypothesis.settings(max_examples=EXAMPLES)


@dataclass(frozen=True)
class Set:
    """One message set three times: by cantools from the file, by our codec, in C."""

    direct: Any
    codec: Codec
    c: MessageLibrary

    def message(self, name: str) -> Message:
        return self.codec.messages.by_name[name]


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Set]:
    result = {}
    for bus in BUSES:
        database, _ = shipped_files(bus)
        direct = cantools.database.load_file(database, strict=True)
        messages = shipped(bus)
        result[bus] = Set(direct, Codec(messages), MessageLibrary(messages, tmp_path_factory.mktemp(bus)))
    return result


def values_of(signal: Signal) -> st.SearchStrategy[float]:
    """Values within the range, at its ends, on halves of codes, and everything that a double can be."""
    inside = st.floats(signal.low, signal.high)
    step = 1.0 if signal.real else abs(signal.scale) / 2
    halves = st.integers(-3, 70_000).map(lambda k: signal.low + k * step)
    ends = st.sampled_from(
        [signal.low, signal.high, math.nextafter(signal.low, -math.inf), math.nextafter(signal.high, math.inf)]
    )
    wild = st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, DENORMAL, -DENORMAL, 1e-40, -0.0])
    return st.one_of(inside, halves, ends, wild, st.floats())


def draw_values(data: st.DataObject, message: Message) -> dict[str, float]:
    operation = data.draw(st.sampled_from(message.multiplexer_values)) if message.multiplexer_values else None
    values = {}
    for signal in message.active(operation):
        if signal.field == Field.OPERATION:
            values[signal.name] = float(operation or 0)
        elif signal.field not in E2E_FIELDS:
            values[signal.name] = data.draw(values_of(signal), label=signal.name)
    return values


def same(one: float, other: float) -> bool:
    return struct.pack("<d", one) == struct.pack("<d", other)


@every_message
@few
@hypothesis.given(data=st.data())
def test_both_encode_the_same_bytes_and_each_decodes_the_other(
    sets: dict[str, Set], bus: str, name: str, data: st.DataObject
) -> None:
    s = sets[bus]
    message = s.message(name)
    values = draw_values(data, message)
    counter = data.draw(st.integers(0, 255), label="counter")

    theirs = s.codec.encode(message, values, counter)
    ours, cut = s.c.encode(message, values, counter)
    assert ours == theirs
    outside = {
        n for n, v in values.items() if not message_signal(message, n).low <= v <= message_signal(message, n).high
    }
    assert cut == outside, "exactly what is out of range, NaN included, is told"

    decoded = s.c.decode(message.id, theirs, flags_of(message))
    assert decoded.status == Status.DECODED
    assert decoded.counter == counter % message.e2e.modulo
    # cantools from the file itself, without anything of ours in between.
    expected = s.direct.get_message_by_name(name).decode(ours, decode_choices=False)
    assert {n: v for n, v in decoded.values.items() if n in expected} == expected
    assert all(v == 0.0 for n, v in decoded.values.items() if n not in expected), "of another operation"
    for signal in message.signals:
        if signal.name in values:
            wanted = limited(signal, values[signal.name])
            rounding = 0.5000001 * abs(signal.scale) if not signal.real else abs(wanted) * 2.0**-24 + 2.0**-150
            assert abs(decoded.values[signal.name] - wanted) <= rounding


def message_signal(message: Message, name: str) -> Signal:
    return next(s for s in message.signals if s.name == name)


@every_message
@few
@hypothesis.given(data=st.data())
def test_any_bytes_under_a_good_crc_are_judged_alike(
    sets: dict[str, Set], bus: str, name: str, data: st.DataObject
) -> None:
    s = sets[bus]
    message = s.message(name)
    text = bytearray(data.draw(st.binary(min_size=message.length, max_size=message.length)))
    for signal in message.signals:
        if signal.real and data.draw(st.booleans()):
            special = st.sampled_from([math.nan, math.inf, -math.inf, 1e-45, -0.0, signal.low, signal.high, 3.4e38])
            struct.pack_into("<f", text, signal.start // 8, data.draw(special))
    s.codec.protect(message, text, data.draw(st.integers(0, 255)))
    theirs = s.codec.decode(message.id, bytes(text), fd=message.fd)
    ours = s.c.decode(message.id, bytes(text), flags_of(message))
    assert ours.status == (theirs.problem or Status.DECODED)
    assert ours.counter == theirs.counter
    for signal_name, value in theirs.values.items():
        assert same(ours.values[signal_name], value)


@every_message
@few
@hypothesis.given(data=st.data())
def test_any_bytes_at_all_are_judged_alike(sets: dict[str, Set], bus: str, name: str, data: st.DataObject) -> None:
    s = sets[bus]
    message = s.message(name)
    text = data.draw(st.binary(max_size=64))
    flags = data.draw(st.integers(0, 7))
    theirs = s.codec.decode(
        message.id, text, fd=bool(flags & FD), extended=bool(flags & EXTENDED), remote=bool(flags & REMOTE)
    )
    ours = s.c.decode(message.id, text, flags)
    assert ours.status == (theirs.problem or Status.DECODED)
    assert ours.name == (theirs.message.name if theirs.message else "")


def safe(message: Message, operation: int = 0) -> dict[str, float]:
    return {s.name: float(operation) if s.field == Field.OPERATION else s.safe for s in message.signals}


@every_message
def test_no_flip_of_one_or_two_bits_passes(sets: dict[str, Set], bus: str, name: str) -> None:
    # The CRC-16 of profile 5 tells all of them (Hamming distance 4 up to 4095 bytes). In profile 2 a flip in the
    # counter takes another data id as well: the lists of the database are chosen so that none of these passes either.
    s = sets[bus]
    message = s.message(name)
    operations = message.multiplexer_values or (0,)
    bits = 8 * message.length
    for counter in (0, 1, 254, 255) if message.e2e.profile == 5 else range(message.e2e.modulo):
        for operation in operations if counter < 2 else operations[:1]:
            data = s.codec.encode(message, safe(message, operation), counter)
            flips = s.c.flips(message, data)
            assert flips == (bits, 0, bits * (bits - 1) // 2, 0)


@every_message
def test_lengths_and_kinds_that_are_not_the_messages_own(sets: dict[str, Set], bus: str, name: str) -> None:
    s = sets[bus]
    message = s.message(name)
    data = s.codec.encode(message, safe(message), 7)
    flags = flags_of(message)
    assert s.c.decode(message.id, data, flags).status == Status.DECODED
    for length in (0, 1, message.length - 1, message.length + 1, 64):
        if length != message.length:
            longer = (data + bytes(64))[:length]
            assert s.c.decode(message.id, longer, flags).status == Status.WRONG_LENGTH
    assert s.c.decode(message.id, data, flags ^ FD).status == Status.WRONG_LENGTH
    assert s.c.decode(message.id, data, flags | REMOTE).status == Status.WRONG_LENGTH
    assert s.c.decode(message.id, data, flags | ERROR).status == Status.UNKNOWN_ID
    assert s.c.decode(message.id, data, flags ^ EXTENDED).status == Status.UNKNOWN_ID
    assert s.c.decode(message.id | 1 << 28, data, flags).status == Status.UNKNOWN_ID


@pytest.mark.parametrize("bus", BUSES)
def test_frames_of_one_message_are_refused_as_another(sets: dict[str, Set], bus: str) -> None:
    s = sets[bus]
    messages = s.codec.messages.messages
    pairs = 0
    for one in messages:
        for counter in range(16):
            data = s.codec.encode(one, safe(one), counter)
            for other in messages:
                if other is not one and other.length == one.length:
                    assert s.c.decode(other.id, data, flags_of(other)).status == Status.BAD_CRC
                    pairs += 1
    assert pairs > 100


@pytest.mark.parametrize("bus", BUSES)
@pytest.mark.parametrize("name", ["ParameterRequest", "ParameterResponse"])
def test_unknown_operations(sets: dict[str, Set], bus: str, name: str) -> None:
    s = sets[bus]
    message = s.message(name)
    operation = message.signals[message.multiplexer]
    for code in range(1 << operation.length):
        values = {**safe(message), operation.name: float(code)}
        data, cut = s.c.encode(message, values, 1)
        known = code in message.multiplexer_values
        assert (cut is not None) == known
        if not known:
            # Under a good CRC, which no encoder of ours makes.
            text = bytearray(s.codec.encode(message, safe(message), 1))
            byte, bit = divmod(operation.start, 8)
            text[byte] = (text[byte] & ~((1 << operation.length) - 1 << bit)) & 0xFF | code << bit
            s.codec.protect(message, text, 1)
            assert s.c.decode(message.id, bytes(text), flags_of(message)).status == Status.UNKNOWN_MULTIPLEXER
        else:
            assert s.c.decode(message.id, data, flags_of(message)).values[operation.name] == code
    for wild in (math.nan, math.inf, -math.inf, -1.0, 0.5, 3.0, 1e300):
        assert s.c.encode(message, {**safe(message), operation.name: wild}, 1) == (b"", None)


def scaled_signals() -> Iterator[tuple[str, str, str]]:
    for message in shipped("classic").messages:
        for signal in message.signals:
            if signal.field == Field.QUANTITY:
                yield message.name, signal.name, "classic"


def test_every_code_of_every_scaled_signal_survives(sets: dict[str, Set]) -> None:
    # cantools' C without --use-round loses 28 % of the codes of one signal here.
    s = sets["classic"]
    refused = 65536 + Status.OUT_OF_RANGE
    count = 0
    for message_name, name, _ in scaled_signals():
        message = s.message(message_name)
        signal = message_signal(message, name)
        assert (signal.length, signal.start % 8, signal.motorola) == (16, 0, False)
        data = s.codec.encode(message, safe(message), 3)
        codes = s.c.codes(message, data, signal.start // 8)
        for code, after in enumerate(codes):
            raw = code - 65536 if signal.signed and code > 32767 else code
            inside = signal.low <= raw * signal.scale + signal.offset <= signal.high
            assert after == (code if inside else refused)
            count += inside
    assert count > 20 * 31_000, "a range uses most of its codes"


def test_not_all_codes_are_values(sets: dict[str, Set]) -> None:
    # Codes beyond the range are kept free: a sensor's error code is then told from a value.
    s = sets["classic"]
    for message_name, name, _ in scaled_signals():
        signal = message_signal(s.message(message_name), name)
        used = round((signal.high - signal.low) / abs(signal.scale)) + 1
        assert 50_000 <= used <= 64_001


@pytest.mark.parametrize("bus", BUSES)
def test_counters_ahead(sets: dict[str, Set], bus: str) -> None:
    s = sets[bus]
    message = s.message("Sync")
    modulo = message.e2e.modulo
    for last in range(modulo):
        for ahead in (0, 1, 2, 3, modulo - 1):
            assert s.c.ahead(message, last, (last + ahead) % modulo) == ahead


@pytest.mark.parametrize("bus", BUSES)
def test_parts_are_found(sets: dict[str, Set], bus: str) -> None:
    s = sets[bus]
    for part in Part:
        for piece in range(5):
            found = s.codec.messages.find(part, piece)
            assert s.c.find(part, piece) == (-1 if found is None else s.c.numbers[found.name])


@pytest.mark.parametrize("bus", BUSES)
def test_signals_are_found(sets: dict[str, Set], bus: str) -> None:
    s = sets[bus]
    names = {signal.quantity for m in s.codec.messages.messages for signal in m.signals} | {"v", "v_dcc", "none"}
    for message in s.codec.messages.messages:
        for field in Field:
            for quantity in (None, *sorted(names)):
                found = message.signal(field, quantity)
                expected = -1 if found is None else message.signals.index(found)
                assert s.c.signal(message, field, quantity) == expected


def enumerators(name: str) -> dict[str, int]:
    text = (bridge_folder() / "include" / "gustform_bridge" / "messages.h").read_text()
    body = re.search(rf"typedef enum {name} {{(.*?)}} {name};", text, re.DOTALL)
    assert body
    names = re.findall(r"\b(GUST_\w+)\b(?: = 0)?,?", re.sub(r"/\*.*?\*/", "", body[1], flags=re.DOTALL))
    return {entry: value for value, entry in enumerate(names)}


def test_numbers_are_those_of_the_header() -> None:
    parts = {f"GUST_PART_{part.name}": part.value for part in Part} | {"GUST_N_PARTS": len(Part)}
    fields = {f"GUST_FIELD_{field.name}": field.value for field in Field} | {"GUST_N_FIELDS": len(Field)}
    assert enumerators("gust_part") == parts
    assert enumerators("gust_field") == fields
    decoded = {f"GUST_{status.name}": status.value for status in Status}
    assert enumerators("gust_decoded") == decoded


def test_the_classic_set_quantises_as_it_says() -> None:
    # The comments state half a factor; measured as the largest error over the range at half codes and between.
    s = Codec(shipped("classic"))
    for message_name, name, _ in scaled_signals():
        message = s.messages.by_name[message_name]
        signal = message_signal(message, name)
        stated = re.search(r"quantised to (\S+)", signal.comment)
        assert stated
        assert float(stated[1]) == pytest.approx(signal.scale / 2)
        worst = 0.0
        for k in range(2000):
            value = signal.low + (signal.high - signal.low) * (k + 0.5) / 2000
            data = s.encode(message, {**safe(message), name: value}, 0)
            worst = max(worst, abs(s.decode(message.id, data, fd=False).values[name] - value))
        assert worst <= float(stated[1]) * (1 + 1e-6)

"""The C of a message set behind ctypes, compiled with the bridge's warnings and the undefined-behaviour sanitizer."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from gustform_hil.c_messages import write_c_messages
from gustform_hil.locate import bridge_folder
from gustform_hil.message_set import MOST_SIGNALS, Message, MessageSet

WARNINGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror"]
UNDEFINED = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]

FD, EXTENDED, REMOTE, ERROR = 1, 2, 4, 8  # enum gust_frame_flags


class Status(IntEnum):
    """enum gust_decoded"""

    DECODED = 0
    UNKNOWN_ID = 1
    WRONG_LENGTH = 2
    BAD_CRC = 3
    UNKNOWN_MULTIPLEXER = 4
    NOT_FINITE = 5
    OUT_OF_RANGE = 6


class CFrame(ctypes.Structure):
    """gust_frame"""

    _fields_ = (
        ("time", ctypes.c_uint64),
        ("id", ctypes.c_uint32),
        ("flags", ctypes.c_uint8),
        ("length", ctypes.c_uint8),
        ("data", ctypes.c_uint8 * 64),
    )


@dataclass(frozen=True)
class Decoded:
    """What C said of a frame; values of the signals that are there."""

    status: Status
    name: str
    values: Mapping[str, float]
    counter: int | None


def compiler() -> str:
    """The C compiler, which the set-up installs."""
    found = shutil.which("cc") or shutil.which("gcc")
    assert found, "no C compiler; tools/system_packages.sh --tests installs one"
    return found


def sources(messages: MessageSet, folder: Path) -> list[Path]:
    """The generated files and those of the bridge that they need."""
    generated = [file for file in write_c_messages(messages, folder) if file.suffix == ".c"]
    return [*generated, *(bridge_folder() / "src" / name for name in ("messages.c", "e2e.c"))]


def includes(folder: Path) -> list[str]:
    """Where the headers are."""
    return [f"-I{folder}", f"-I{bridge_folder() / 'include'}", f"-I{bridge_folder() / 'src'}"]


_SHIM = """
#include <string.h>
#include "e2e.h"
#include "gustform_bridge/messages.h"
int shim_decode(const gust_frame *frame, int *number, double *values, uint8_t *counter);
uint32_t shim_encode(int number, const double *values, uint8_t counter, gust_frame *frame);
uint8_t shim_ahead(int number, uint8_t last, uint8_t counter);
int shim_find(int part, uint8_t piece);
int shim_signal(int number, int field, const char *quantity);
const char *shim_unit(int number, int signal);
void shim_flips(const gust_frame *frame, uint64_t result[4]);
void shim_codes(const gust_frame *frame, int byte, uint32_t result[65536]);
int shim_decode(const gust_frame *frame, int *number, double *values, uint8_t *counter)
{
    const gust_message *message = NULL;
    const gust_decoded result = gust_message_decode(&gust_messages, frame, &message, values, counter);
    *number = message == NULL ? -1 : (int)(message - gust_messages.messages);
    return (int)result;
}
uint32_t shim_encode(int number, const double *values, uint8_t counter, gust_frame *frame)
{
    return gust_message_encode(&gust_messages.messages[number], values, counter, frame);
}
uint8_t shim_ahead(int number, uint8_t last, uint8_t counter)
{
    return gust_message_ahead(&gust_messages.messages[number], last, counter);
}
int shim_find(int part, uint8_t piece)
{
    const gust_message *message = gust_message_find(&gust_messages, (gust_part)part, piece);
    return message == NULL ? -1 : (int)(message - gust_messages.messages);
}
int shim_signal(int number, int field, const char *quantity)
{
    return gust_message_signal(&gust_messages.messages[number], (gust_field)field, quantity);
}
const char *shim_unit(int number, int signal)
{
    return gust_messages.messages[number].signals[signal].unit;
}
static gust_decoded decode(const gust_frame *frame, double *values)
{
    const gust_message *message = NULL;
    uint8_t counter = 0;
    return gust_message_decode(&gust_messages, frame, &message, values, &counter);
}
/* All flips of one bit and of two: how many there are, how many were not refused for the CRC. */
void shim_flips(const gust_frame *frame, uint64_t result[4])
{
    double values[GUST_MESSAGE_SIGNALS];
    gust_frame one = *frame;
    memset(result, 0, 4 * sizeof result[0]);
    for (int a = 0; a < 8 * frame->length; a++) {
        one.data[a / 8] ^= (uint8_t)(1U << (a % 8));
        result[0]++;
        result[1] += decode(&one, values) != GUST_BAD_CRC;
        for (int b = a + 1; b < 8 * frame->length; b++) {
            one.data[b / 8] ^= (uint8_t)(1U << (b % 8));
            result[2]++;
            result[3] += decode(&one, values) != GUST_BAD_CRC;
            one.data[b / 8] ^= (uint8_t)(1U << (b % 8));
        }
        one.data[a / 8] ^= (uint8_t)(1U << (a % 8));
    }
}
/* Every code of 16 bits at a byte: the code after decoding and encoding again, 65536 + status where it is refused. */
void shim_codes(const gust_frame *frame, int byte, uint32_t result[65536])
{
    for (uint32_t code = 0; code < 65536U; code++) {
        double values[GUST_MESSAGE_SIGNALS] = {0.0};
        const gust_message *message = NULL;
        uint8_t counter = 0;
        gust_frame one = *frame;
        one.data[byte] = (uint8_t)(code & 255U);
        one.data[byte + 1] = (uint8_t)(code >> 8);
        (void)gust_message_decode(&gust_messages, frame, &message, values, &counter);
        gust_e2e_protect(&message->e2e, one.data, one.length, counter);
        const gust_decoded status = gust_message_decode(&gust_messages, &one, &message, values, &counter);
        gust_frame again;
        result[code] = 65536U + (uint32_t)status;
        if (status != GUST_DECODED)
            continue;
        if (gust_message_encode(message, values, counter, &again) == 0U && memcmp(one.data, again.data, 64) == 0)
            result[code] = (uint32_t)again.data[byte] | (uint32_t)again.data[byte + 1] << 8;
    }
}
"""


class MessageLibrary:
    """Compiles the message set in a folder and speaks to it."""

    def __init__(self, messages: MessageSet, folder: Path, flags: Sequence[str] = ("-O1", *UNDEFINED)) -> None:
        self.messages = messages
        self.numbers = {m.name: number for number, m in enumerate(messages.messages)}
        shim = folder / "shim.c"
        shim.write_text(_SHIM)
        library = folder / "messages.so"
        files = [str(file) for file in (*sources(messages, folder), shim)]
        command = [compiler(), "-shared", "-fPIC", "-ffp-contract=off", *flags, *WARNINGS, *includes(folder), *files]
        done = subprocess.run([*command, "-o", str(library), "-lm"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        self.library = ctypes.CDLL(str(library))

    def encode(self, message: Message, values: Mapping[str, float], counter: int) -> tuple[bytes, set[str] | None]:
        """The frame's data, and the signals that were cut; None where the frame is not to be sent."""
        given = (ctypes.c_double * MOST_SIGNALS)()
        for number, signal in enumerate(message.signals):
            given[number] = values.get(signal.name, 0.0)
        frame = CFrame(length=99)
        number = self.numbers[message.name]
        flagged = int(ctypes.c_uint32(self.library.shim_encode(number, given, counter, ctypes.byref(frame))).value)
        assert frame.id == message.id
        assert frame.flags == (FD if message.fd else 0) | (EXTENDED if message.extended else 0)
        if frame.length == 0:
            assert flagged == 0xFFFFFFFF
            return b"", None
        assert flagged >> len(message.signals) == 0
        cut = {signal.name for number, signal in enumerate(message.signals) if flagged >> number & 1}
        return bytes(frame.data[: frame.length]), cut

    def decode(self, identifier: int, data: bytes, flags: int) -> Decoded:
        """What a frame says. Values and counter that C has not written are told apart from those it has."""
        frame = _frame(identifier, data, flags)
        values = (ctypes.c_double * MOST_SIGNALS)(*([math.nan] * MOST_SIGNALS))
        number, counter = ctypes.c_int(), ctypes.c_uint8(255)
        status = Status(
            self.library.shim_decode(ctypes.byref(frame), ctypes.byref(number), values, ctypes.byref(counter))
        )
        if number.value < 0:
            return Decoded(status, "", {}, None)
        message = self.messages.messages[number.value]
        if status != Status.DECODED:
            assert all(math.isnan(value) for value in values), "a value of a refused frame was written"
        written = {signal.name: values[k] for k, signal in enumerate(message.signals)}
        early = (Status.WRONG_LENGTH, Status.BAD_CRC)
        return Decoded(
            status,
            message.name,
            written if status == Status.DECODED else {},
            None if status in early else counter.value,
        )

    def ahead(self, message: Message, last: int, counter: int) -> int:
        """gust_message_ahead"""
        return int(self.library.shim_ahead(self.numbers[message.name], last, counter)) & 0xFF

    def signal(self, message: Message, field: int, quantity: str | None) -> int:
        """gust_message_signal; -1: none"""
        name = None if quantity is None else quantity.encode()
        return int(self.library.shim_signal(self.numbers[message.name], field, name))

    def flips(self, message: Message, data: bytes) -> tuple[int, int, int, int]:
        """Flips of one bit, how many of them passed; of two bits, how many of them passed."""
        result = (ctypes.c_uint64 * 4)()
        self.library.shim_flips(ctypes.byref(_frame(message.id, data, flags_of(message))), result)
        return result[0], result[1], result[2], result[3]

    def codes(self, message: Message, data: bytes, byte: int) -> list[int]:
        """Every code of the 16 bits at `byte` after decoding and encoding; 65536 + status where it is refused."""
        result = (ctypes.c_uint32 * 65536)()
        self.library.shim_codes(ctypes.byref(_frame(message.id, data, flags_of(message))), byte, result)
        return list(result)

    def find(self, part: int, piece: int) -> int:
        """gust_message_find, by number; -1: none"""
        return int(self.library.shim_find(part, piece))


def _frame(identifier: int, data: bytes, flags: int) -> CFrame:
    frame = CFrame(id=identifier, flags=flags, length=len(data))
    frame.data[: len(data)] = data
    return frame


def flags_of(message: Message) -> int:
    """gust_message.flags"""
    return (FD if message.fd else 0) | (EXTENDED if message.extended else 0)

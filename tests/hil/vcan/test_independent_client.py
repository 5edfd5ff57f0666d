"""python-can, cantools and autosar-e2e on one side of a real bus, the C of the message set on the other.

Nothing of gustform encodes or decodes on the Python side: cantools reads the DBC from its file, autosar-e2e protects
and checks by the attributes that stand in it.
"""

from __future__ import annotations

import os
import random
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import cantools.database
import e2e
import pytest

from gustform_hil.database import BUSES, shipped, shipped_files
from gustform_hil.layout import FD_LENGTHS
from tests.support.message_library import WARNINGS, compiler, includes, sources

HERE = Path(__file__).resolve().parent
INTERFACE = os.environ.get("GUSTFORM_VCAN_INTERFACES", "vcan0").split(",")[0]
PATIENCE = 20.0  # s, for what takes microseconds on an idle machine
ROUNDS = 40  # of every message, each with values of its own; more than two turns of a counter of profile 2
WRONG_LENGTH, BAD_CRC, NOT_FINITE, OUT_OF_RANGE = 2, 3, 5, 6  # enum gust_decoded


@dataclass
class Client:
    """A node of the bus made of public packages alone."""

    bus: can.BusABC
    database: Any

    def protect(self, message: Any, data: bytearray, counter: int) -> None:
        attributes = message.dbc.attributes
        if attributes["E2EProfile"].value == 3:  # P05
            data[2] = counter % 256
            e2e.p05.e2e_p05_protect(data, attributes["E2EDataId"].value, increment_counter=False)
        else:  # P02
            data[1] = data[1] & 0xF0 | counter % 16
            ids = bytes.fromhex(attributes["E2EDataIdList"].value)
            e2e.p02.e2e_p02_protect(data, ids, increment_counter=False)

    def checked(self, message: Any, data: bytes) -> int | None:
        """The counter, None if autosar-e2e does not accept the frame."""
        attributes = message.dbc.attributes
        if attributes["E2EProfile"].value == 3:
            return data[2] if e2e.p05.e2e_p05_check(data, attributes["E2EDataId"].value) else None
        ids = bytes.fromhex(attributes["E2EDataIdList"].value)
        return data[1] & 15 if e2e.p02.e2e_p02_check(data, ids) else None

    def ask(self, message: Any, data: bytes) -> can.Message:
        """Send a frame and take the answer."""
        frame = can.Message(
            arbitration_id=message.frame_id, is_extended_id=False, is_fd=message.is_fd,
            bitrate_switch=message.is_fd, data=data,
        )  # fmt: skip
        self.bus.send(frame, timeout=PATIENCE)
        answer = self.bus.recv(PATIENCE)
        assert answer is not None, "no answer"
        return answer

    def refused(self, message: Any, data: bytes) -> int:
        """Why the other side has refused a frame."""
        answer = self.ask(message, data)
        assert answer.arbitration_id == 0x7FF
        return int(answer.data[0])


@pytest.fixture(scope="module", params=BUSES)
def client(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    bus_name: str = request.param
    folder = tmp_path_factory.mktemp(bus_name)
    files = [str(HERE / "message_client.c"), *map(str, sources(shipped(bus_name), folder))]
    program = folder / "message_client"
    flags = ["-O0", "-ffp-contract=off", "-D_GNU_SOURCE", *WARNINGS, *includes(folder)]
    subprocess.run([compiler(), *flags, *files, "-o", str(program), "-lm"], check=True, timeout=120)
    database = cantools.database.load_file(shipped_files(bus_name)[0], strict=True)
    with (
        can.Bus(interface="socketcan", channel=INTERFACE, fd=bus_name == "fd") as bus,
        subprocess.Popen([str(program), INTERFACE], stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield Client(bus, database)
        bus.send(can.Message(arbitration_id=1, is_extended_id=False, is_remote_frame=True))
        assert process.wait(PATIENCE) == 0


def values_for(message: Any, rng: random.Random) -> dict[str, float]:
    """Random values of all signals; of float signals such that a float carries them."""
    values: dict[str, float] = {}
    for signal in message.signals:
        if signal.name in ("Crc", "Counter"):
            values[signal.name] = 0
        elif signal.conversion.is_float:
            value = rng.uniform(max(signal.minimum, -1e6), min(signal.maximum, 1e6))
            values[signal.name] = struct.unpack("<f", struct.pack("<f", value))[0]
        else:
            low, high = signal.conversion.scaled_to_raw(signal.minimum), signal.conversion.scaled_to_raw(signal.maximum)
            values[signal.name] = signal.conversion.raw_to_scaled(rng.randint(low, high), decode_choices=False)
    return values


def test_every_message_both_ways(client: Client) -> None:
    rng = random.Random(7)
    frames = 0
    for message in client.database.messages:
        for counter in range(ROUNDS):
            values = values_for(message, rng)
            if message.is_multiplexed():
                values["Operation"] = counter % 3
            data = bytearray(message.encode(values, strict=not message.is_multiplexed()))
            client.protect(message, data, counter)
            answer = client.ask(message, bytes(data))

            assert answer.arbitration_id == message.frame_id
            assert (answer.is_fd, answer.bitrate_switch) == (message.is_fd, message.is_fd)
            modulo = 256 if message.is_fd else 16
            assert client.checked(message, bytes(answer.data)) == (counter + 1) % modulo
            # The same values under the next counter: what our packages make of them is the same frame.
            client.protect(message, data, counter + 1)
            assert bytes(answer.data) == bytes(data)
            sent, heard = (message.decode(bytes(text), decode_choices=False) for text in (data, answer.data))
            assert sent == heard
            frames += 1
    assert frames == ROUNDS * len(client.database.messages)


def test_what_is_wrong_is_refused_for_its_reason(client: Client) -> None:
    rng = random.Random(8)
    for message in client.database.messages:
        values = values_for(message, rng) | ({"Operation": 1} if message.is_multiplexed() else {})
        data = bytearray(message.encode(values, strict=not message.is_multiplexed()))
        client.protect(message, data, 3)
        for bit in range(8 * len(data)):
            flipped = bytearray(data)
            flipped[bit // 8] ^= 1 << bit % 8
            assert client.refused(message, bytes(flipped)) == BAD_CRC
        shorter = max(length for length in FD_LENGTHS if length < len(data))  # others are filled up on the way
        assert client.refused(message, bytes(data[:shorter])) == WRONG_LENGTH


def test_not_a_number_and_out_of_range_under_a_good_crc(client: Client) -> None:
    tried = 0
    for message in client.database.messages:
        for signal in message.signals:
            if signal.conversion.is_float and signal.unit:
                for value, reason in ((float("nan"), NOT_FINITE), (2 * signal.maximum + 1, OUT_OF_RANGE)):
                    values = {s.name: 0 for s in message.signals} | {signal.name: value}
                    data = bytearray(message.encode(values, strict=False))
                    client.protect(message, data, 1)
                    assert client.refused(message, bytes(data)) == reason
                    tried += 1
            elif signal.unit and signal.length == 16:
                data = bytearray(message.length)
                raw = 0x7FFF if signal.is_signed else 0xFFFF  # codes that no value has
                data[signal.start // 8 : signal.start // 8 + 2] = raw.to_bytes(2, "little")
                client.protect(message, data, 1)
                assert client.refused(message, bytes(data)) == OUT_OF_RANGE
                tried += 1
    assert tried >= 20

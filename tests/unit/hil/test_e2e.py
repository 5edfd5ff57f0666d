"""End-to-end protection in C: known answers of the AUTOSAR documents, and the package autosar-e2e frame by frame."""

from __future__ import annotations

import ctypes
import itertools
import random
import subprocess
from collections.abc import Callable

import e2e
import pytest
from cantools.autosar import compute_profile2_crc, compute_profile5_crc

from gustform_hil.e2e import Protector
from gustform_hil.locate import bridge_folder
from gustform_hil.message_set import E2E
from tests.support.message_library import UNDEFINED, WARNINGS, compiler

# AUTOSAR Specification of CRC Routines (SWS_CRCLibrary), tables of examples: data, CRC-8 SAE J1850, CRC-8 H2F,
# CRC-16/CCITT-FALSE.
EXAMPLES = (
    ("00000000", 0x59, 0x12, 0x84C0),
    ("F20183", 0x37, 0xC2, 0xD374),
    ("0FAA0055", 0x79, 0xC6, 0x2023),
    ("00FF5511", 0xB8, 0x77, 0xB8F9),
    ("332255AABBCCDDEEFF", 0xCB, 0x11, 0xF53F),
    ("926B55", 0x8C, 0x33, 0x0745),
    ("FFFFFFFF", 0x74, 0x6C, 0x1D0F),
    (b"123456789".hex(), 0x4B, 0xDF, 0x29B1),  # check values of the polynomials
)


class CE2E(ctypes.Structure):
    """gust_e2e"""

    _fields_ = (("profile", ctypes.c_uint8), ("data_id", ctypes.c_uint16), ("list", ctypes.c_char_p))


def c_e2e(protection: E2E) -> CE2E:
    # A byte string may hold zeros: ctypes hands over its address, not a copy up to the first.
    return CE2E(protection.profile, protection.data_id, protection.id_list or None)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    file = tmp_path_factory.mktemp("e2e") / "e2e.so"
    folder = bridge_folder()
    command = [compiler(), "-shared", "-fPIC", "-O1", *UNDEFINED, *WARNINGS, f"-I{folder / 'include'}"]
    subprocess.run([*command, str(folder / "src" / "e2e.c"), "-o", str(file)], check=True)
    loaded = ctypes.CDLL(str(file))
    loaded.gust_e2e_good.restype = ctypes.c_bool
    loaded.gust_e2e_modulo.restype = ctypes.c_uint16
    loaded.gust_crc16_ccitt.restype = ctypes.c_uint16
    loaded.gust_crc8_j1850.restype = loaded.gust_crc8_h2f.restype = ctypes.c_uint8
    for name in ("gust_crc16_ccitt", "gust_crc8_j1850", "gust_crc8_h2f"):
        getattr(loaded, name).argtypes = (ctypes.c_uint, ctypes.c_char_p, ctypes.c_size_t)
    return loaded


def protected(library: ctypes.CDLL, protection: E2E, data: bytes, counter: int) -> bytes:
    buffer = ctypes.create_string_buffer(data, len(data))
    library.gust_e2e_protect(ctypes.byref(c_e2e(protection)), buffer, ctypes.c_size_t(len(data)), counter)
    return buffer.raw


def good(library: ctypes.CDLL, protection: E2E, data: bytes) -> int | None:
    counter = ctypes.c_uint8(77)
    fine = library.gust_e2e_good(
        ctypes.byref(c_e2e(protection)), data, ctypes.c_size_t(len(data)), ctypes.byref(counter)
    )
    assert fine or counter.value == 77, "the counter of a bad frame was written"
    return counter.value if fine else None


@pytest.mark.parametrize(("data", "j1850", "h2f", "ccitt"), EXAMPLES)
def test_crcs_give_the_known_answers(library: ctypes.CDLL, data: str, j1850: int, h2f: int, ccitt: int) -> None:
    text = bytes.fromhex(data)
    assert library.gust_crc8_j1850(0xFF, text, len(text)) ^ 0xFF == j1850
    assert library.gust_crc8_h2f(0xFF, text, len(text)) ^ 0xFF == h2f
    assert library.gust_crc16_ccitt(0xFFFF, text, len(text)) == ccitt


def test_profiles_give_the_known_answers(library: ctypes.CDLL) -> None:
    # AUTOSAR E2E Protocol Specification (PRS_E2EProtocol), example results of E2E_PxxProtect for 8 bytes of zeros:
    # profile 1 with data id 0x123 in both bytes, profile 2 with the list 01 ... 10, profile 5 with data id 0x1234.
    one, two, five = E2E(1, 0x123), E2E(2, 0, bytes(range(1, 17))), E2E(5, 0x1234)
    assert protected(library, one, bytes(8), 0).hex() == "cc00000000000000"
    assert protected(library, one, bytes(8), 1).hex() == "9101000000000000"
    assert [protected(library, two, bytes(8), k).hex() for k in (1, 2, 3)] == [
        "1b01000000000000",
        "9802000000000000",
        "3103000000000000",
    ]
    assert protected(library, five, bytes(8), 0).hex() == "1cca000000000000"


def reference(protection: E2E) -> tuple[Callable[[bytearray], None], Callable[[bytes], bool]]:
    """autosar-e2e: protect with the next counter, check."""
    if protection.profile == 1:
        return (
            lambda data: e2e.p01.e2e_p01_protect(data, protection.data_id),
            lambda data: e2e.p01.e2e_p01_check(bytearray(data), protection.data_id),
        )
    if protection.profile == 2:
        return (
            lambda data: e2e.p02.e2e_p02_protect(data, protection.id_list),
            lambda data: e2e.p02.e2e_p02_check(data, protection.id_list),
        )
    return (
        lambda data: e2e.p05.e2e_p05_protect(data, protection.data_id),
        lambda data: e2e.p05.e2e_p05_check(data, protection.data_id),
    )


LIST = bytes.fromhex("0CB5BAE86EE73CBC238B05E66AF400BB")  # with a zero, as a list may have


@pytest.mark.parametrize(
    ("protection", "lengths"),
    [
        (E2E(1, 0xBEEF), (2, 3, 8, 32)),
        (E2E(1, 0x0001), (8,)),
        (E2E(2, 0, LIST), (2, 3, 8, 32)),
        (E2E(5, 0x5100), (3, 4, 8, 12, 48, 64)),
        (E2E(5, 0xFFFF), (64,)),
    ],
)
def test_all_counters_as_the_public_package(library: ctypes.CDLL, protection: E2E, lengths: tuple[int, ...]) -> None:
    # The package counts by itself, so its own modulo is compared as well: once round and two further.
    step, check = reference(protection)
    rng = random.Random(1)
    for length in lengths:
        theirs = bytearray(rng.randbytes(length))
        ours = Protector(protection)
        ours.protect(theirs, protection.modulo - 1)
        for counter in range(protection.modulo + 2):
            step(theirs)
            if length > 3:  # what lies behind the header may be anything
                theirs[3] = rng.randrange(256)
                ours.protect(theirs, counter)
            mine = protected(library, protection, bytes(theirs), counter % 256)
            assert mine == bytes(theirs)
            assert check(mine)
            assert good(library, protection, bytes(theirs)) == counter % protection.modulo
            assert ours.counter(mine) == counter % protection.modulo


def test_cantools_agrees_where_it_knows_the_profile(library: ctypes.CDLL) -> None:
    # A third implementation (crccheck behind cantools.autosar).
    rng = random.Random(2)
    for counter in range(16):
        data = protected(library, E2E(2, 0, LIST), rng.randbytes(8), counter)
        assert compute_profile2_crc(data, LIST[counter]) == data[0]
    for counter in range(256):
        data = protected(library, E2E(5, 0x5123), rng.randbytes(48), counter)
        assert compute_profile5_crc(data, 0x5123) == data[0] | data[1] << 8


def test_a_counter_that_profile_1_does_not_know_is_refused(library: ctypes.CDLL) -> None:
    protection = E2E(1, 0x123)
    data = bytearray(8)
    data[1] = 15  # 0 ... 14 are counted; the CRC is right
    e2e.p01.e2e_p01_protect(data, 0x123, increment_counter=False)
    assert good(library, protection, bytes(data)) is None
    assert not Protector(protection).good(bytes(data))


@pytest.mark.parametrize("protection", [E2E(1, 5), E2E(2, 0, LIST), E2E(5, 5)])
def test_a_frame_too_short_for_its_header(library: ctypes.CDLL, protection: E2E) -> None:
    header = 3 if protection.profile == 5 else 2
    for length in range(header):
        data = bytes(range(7, 7 + length))
        assert protected(library, protection, data, 1) == data
        assert good(library, protection, data) is None


def test_without_a_profile_everything_passes(library: ctypes.CDLL) -> None:
    assert protected(library, E2E(), b"\x01\x02", 9) == b"\x01\x02"
    assert good(library, E2E(), b"") == 0
    assert [library.gust_e2e_modulo(ctypes.byref(c_e2e(E2E(p)))) for p in (0, 1, 2, 5)] == [1, 15, 16, 256]


def test_data_ids_tell_messages_apart(library: ctypes.CDLL) -> None:
    payload = bytes(range(48))
    for one, other in itertools.permutations((0x5100, 0x5110, 0x5101, 0x0151), 2):
        assert good(library, E2E(5, other), protected(library, E2E(5, one), payload, 3)) is None

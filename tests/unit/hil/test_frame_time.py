"""The longest frames: against published numbers, and against frames built and stuffed bit by bit."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gustform_hil.frame_time import FD_LENGTHS, BitRates, frame_bits


@pytest.mark.parametrize(
    ("fd", "length", "nominal", "data", "microseconds"),
    [
        (False, 8, 500_000, 500_000, 270),  # 135 bits, the number everyone quotes
        (True, 64, 500_000, 2_000_000, 407),
        (True, 64, 500_000, 5_000_000, 204),
        (True, 64, 1_000_000, 5_000_000, 170),
    ],
)
def test_known_times(fd: bool, length: int, nominal: int, data: int, microseconds: int) -> None:
    time = frame_bits(length, fd=fd).time(BitRates(nominal, data))
    assert round(time * 1_000_000) == microseconds


def test_bits_of_classic_frames() -> None:
    # Davis et al. 2007, (2) and (3): 55 + 10 s bits with 11, 80 + 10 s with 29 bits of identifier.
    for length in range(9):
        assert frame_bits(length, fd=False).nominal == 55 + 10 * length
        assert frame_bits(length, fd=False, extended=True).nominal == 80 + 10 * length
        assert frame_bits(length, fd=False).data == 0


def test_the_crc_grows_above_16_bytes() -> None:
    # ESI, DLC, data, stuff bits, then the stuff count and a CRC of 17 or 21 bits with 6 or 7 fixed stuff bits.
    assert frame_bits(16, fd=True).data == 1 + 4 + 128 + 33 + 4 + 17 + 6
    assert frame_bits(20, fd=True).data == 1 + 4 + 160 + 41 + 4 + 21 + 7


@pytest.mark.parametrize(("fd", "length"), [(False, 9), (False, -1), (True, 9), (True, 65)])
def test_a_length_that_no_frame_has(fd: bool, length: int) -> None:
    with pytest.raises(ValueError, match=r"no .* frame has"):
        frame_bits(length, fd=fd)


def stuffed(bits: list[int]) -> list[int]:
    """After five equal bits an opposite one, which begins the next run."""
    sent: list[int] = []
    run = 0
    for bit in bits:
        run = run + 1 if sent and sent[-1] == bit else 1
        sent.append(bit)
        if run == 5:
            sent.append(1 - bit)
            run = 1
    return sent


def crc15(bits: list[int]) -> list[int]:
    """x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1."""
    register = 0
    for bit in bits:
        carry = bit ^ (register >> 14)
        register = (register << 1) & 0x7FFF
        if carry:
            register ^= 0x4599
    return number(register, 15)


def number(value: int, width: int) -> list[int]:
    return [(value >> k) & 1 for k in reversed(range(width))]


def classic_frame(identifier: int, data: bytes) -> list[int]:
    body = [0, *number(identifier, 11), 0, 0, 0, *number(len(data), 4)]
    body += [bit for byte in data for bit in number(byte, 8)]
    return stuffed(body + crc15(body)) + [1, 0, 1] + [1] * 7 + [1] * 3


def fd_frame(identifier: int, data: bytes) -> tuple[int, int]:
    """How many bits go out at the nominal and at the data rate, the CRC being any: its stuff bits are fixed."""
    arbitration = [0, *number(identifier, 11), 0, 0, 1, 0, 1]
    rest = [0, *number(FD_LENGTHS.index(len(data)), 4), *(bit for byte in data for bit in number(byte, 8))]
    slow = len(stuffed(arbitration))
    fast = len(stuffed(arbitration + rest)) - slow
    if stuffed(arbitration + rest)[-1] == 1 - (arbitration + rest)[-1] and len(set((arbitration + rest)[-5:])) == 1:
        fast -= 1  # the fixed stuff bit takes the place of a dynamic one behind the last bit
    check = number(0, 4 + (17 if len(data) <= 16 else 21))
    field: list[int] = []
    for k, bit in enumerate(check):
        field += [1, bit] if k % 4 == 0 else [bit]
    return slow + 1 + 2 + 7 + 3, fast + len(field)


# Four and four equal bits: with the stuff bit before them they are five.
WORST = [bytes([(0xF0F0 >> k) & 0xFF]) for k in range(8)]


@given(st.integers(0, 0x7FF), st.one_of(st.binary(max_size=8), st.sampled_from(WORST).map(lambda b: b * 8)))
def test_no_classic_frame_is_longer(identifier: int, data: bytes) -> None:
    assert len(classic_frame(identifier, data)) <= frame_bits(len(data), fd=False).nominal


@given(st.integers(0, 0x7FF), st.sampled_from(FD_LENGTHS), st.data())
def test_no_fd_frame_is_longer(identifier: int, length: int, draw: st.DataObject) -> None:
    worst = st.sampled_from(WORST).map(lambda b: b * length)
    data = draw.draw(st.one_of(st.binary(min_size=length, max_size=length), worst))
    slow, fast = fd_frame(identifier, data)
    bound = frame_bits(length, fd=True)
    rates = BitRates(500_000, 2_000_000)
    assert Fraction(slow, rates.nominal) + Fraction(fast, rates.data) <= bound.time(rates)
    assert slow + fast <= bound.nominal + bound.data


def test_the_bounds_are_nearly_reached() -> None:
    """What the format fixes, and the CRC, keep real frames a few stuff bits below the bound, no more."""
    identifiers = (0x000, 0x07F, 0x0F8, 0x780, 0x7FF)
    classic = max(len(classic_frame(i, byte * 8)) for i in identifiers for byte in WORST)
    assert frame_bits(8, fd=False).nominal - 6 <= classic
    fd = max(sum(fd_frame(i, byte * 64)) for i in identifiers for byte in WORST)
    bound = frame_bits(64, fd=True)
    assert bound.nominal + bound.data - 6 <= fd

"""How long a frame can take on the wire: bits by ISO 11898-1:2015, stuffed as badly as data can make them.

Classic frame, 11-bit identifier, s bytes: start 1, identifier 11, RTR, IDE, r0, DLC 4, data 8 s, CRC 15 are stuffed:
after five equal bits comes an opposite one, and it counts towards the next five; n bits get at most floor((n - 1)/4).
CRC delimiter, acknowledge 2, end 7 and intermission 3 are not.

FD frame: up to BRS (17 bits with an 11-bit identifier) at the nominal rate; ESI, DLC 4, data, and the CRC field at the
data rate; CRC delimiter, acknowledge, end and intermission at the nominal rate again. Stuffed as above up to the end of
the data. The CRC field has the stuff count (3 bits and parity) and a CRC of 17 bits, above 16 bytes 21, with a fixed
stuff bit before it and after each fourth bit. The bits in which the rate changes count as slow ones, and as many stuff
bits as fit into the slow part are counted there: never too short.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

_END = 1 + 2 + 7 + 3  # CRC delimiter, acknowledge with its delimiter, end of frame, intermission
_STUFF_COUNT = 4
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


@dataclass(frozen=True)
class BitRates:
    """Bits per second: of the arbitration, and of the data of FD frames."""

    nominal: int
    data: int


@dataclass(frozen=True)
class FrameBits:
    """Bits of the longest frame at the nominal and at the data rate; `stuffed` of them are dynamic stuff bits."""

    nominal: int
    data: int
    stuffed: int

    def time(self, rates: BitRates) -> Fraction:
        """Seconds on the bus, intermission included."""
        return Fraction(self.nominal, rates.nominal) + Fraction(self.data, rates.data)


def frame_bits(length: int, *, fd: bool, extended: bool = False) -> FrameBits:
    """The longest frame with `length` bytes of data."""
    if length not in (FD_LENGTHS if fd else range(9)):
        raise ValueError(f"no {'FD' if fd else 'classic'} frame has {length} bytes")
    return _fd(length, extended) if fd else _classic(length, extended)


def _most_stuffed(bits: int) -> int:
    return (bits - 1) // 4


def _classic(length: int, extended: bool) -> FrameBits:
    # Extended: SRR, IDE and 18 more bits of the identifier, and r1.
    covered = 1 + 11 + 1 + 1 + 1 + 4 + 8 * length + 15 + (20 if extended else 0)
    stuffed = _most_stuffed(covered)
    return FrameBits(covered + stuffed + _END, 0, stuffed)


def _fd(length: int, extended: bool) -> FrameBits:
    # Start, identifier, RRS, IDE, FDF, res, BRS; extended: SRR and 18 more bits of the identifier.
    arbitration = 1 + 11 + 1 + 1 + 1 + 1 + 1 + (19 if extended else 0)
    covered = arbitration + 1 + 4 + 8 * length
    stuffed = _most_stuffed(covered)
    slow = _most_stuffed(arbitration)
    checked = _STUFF_COUNT + (17 if length <= 16 else 21)
    fixed = 1 + checked // 4
    return FrameBits(
        nominal=arbitration + slow + _END,
        data=1 + 4 + 8 * length + (stuffed - slow) + checked + fixed,
        stuffed=stuffed,
    )

"""How long a frame can take on the wire: bits by ISO 11898-1:2015, stuffed as badly as data can make them.

Classic frame, 11-bit identifier, s bytes: start 1, identifier 11, RTR, IDE, r0, DLC 4, data 8 s, CRC 15 are stuffed:
after five equal bits comes an opposite one, and it counts towards the next five; n bits get at most floor((n - 1)/4).
CRC delimiter, acknowledge 2, end 7 and intermission 3 are not.

FD frame: up to BRS (17 bits with an 11-bit identifier) at the nominal rate; ESI, DLC 4, data, and the CRC field at the
data rate; CRC delimiter, acknowledge, end and intermission at the nominal rate again. Stuffed as above up to the end of
the data. The CRC field has the stuff count (3 bits and parity) and a CRC of 17 bits, above 16 bytes 21, with a fixed
stuff bit before it and after each fourth bit. The bits in which the rate changes count as slow ones.

Without an identifier every stuffed bit may be anything, the bound that is quoted. With one, what the format and the
identifier fix is what it is, and only data, CRC and ESI are as bad as can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

_END = 1 + 2 + 7 + 3  # CRC delimiter, acknowledge with its delimiter, end of frame, intermission
_STUFF_COUNT = 4
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)

Bits = Sequence[int | None]  # None: any
_Runs = dict[tuple[int, int], int]  # (last bit, how many of it) -> most stuff bits until there


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


def frame_bits(length: int, *, fd: bool, extended: bool = False, identifier: int | None = None) -> FrameBits:
    """The longest frame with `length` bytes of data: with this identifier, or with any."""
    if length not in (FD_LENGTHS if fd else range(9)):
        raise ValueError(f"no {'FD' if fd else 'classic'} frame has {length} bytes")
    slow = _arbitration(fd, extended, identifier)
    rest: Bits = [*([None] if fd else []), *_number(_code(length, fd), 4), *[None] * (8 * length)]
    if not fd:
        covered = [*slow, *rest, *[None] * 15]
        stuffed = _most_stuffed(covered if identifier is not None else [None] * len(covered))
        return FrameBits(len(covered) + stuffed + _END, 0, stuffed)
    if identifier is None:
        slow, rest = [None] * len(slow), [None] * len(rest)
    stuffed, early = _most_stuffed([*slow, *rest]), _most_stuffed(slow)
    checked = _STUFF_COUNT + (17 if length <= 16 else 21)
    return FrameBits(
        nominal=len(slow) + early + _END,
        data=len(rest) + (stuffed - early) + checked + 1 + checked // 4,
        stuffed=stuffed,
    )


def _arbitration(fd: bool, extended: bool, identifier: int | None) -> list[int | None]:
    """Start of frame up to BRS, or up to the bit before the DLC."""
    number = _number(identifier, 29 if extended else 11)
    # RTR or RRS, IDE; extended: SRR and IDE behind 11 bits, RTR or RRS behind the other 18.
    head: list[int | None] = [0, *number[:11], 1, 1, *number[11:], 0] if extended else [0, *number, 0, 0]
    if fd:
        return [*head, 1, 0, 1]  # FDF, res, BRS
    return [*head, 0, 0] if extended else [*head, 0]  # r1, r0


def _number(value: int | None, width: int) -> list[int | None]:
    return [None if value is None else (value >> k) & 1 for k in reversed(range(width))]


def _code(length: int, fd: bool) -> int:
    return FD_LENGTHS.index(length) if fd else length


def _most_stuffed(bits: Bits) -> int:
    """The most stuff bits that any choice of the free ones gives: bit by bit over the runs that can be under way."""
    runs: _Runs = {(-1, 0): 0}
    for fixed in bits:
        longer: _Runs = {}
        for (last, length), count in runs.items():
            for bit in (0, 1) if fixed is None else (fixed,):
                run, stuffed = (bit, length + 1 if bit == last else 1), count
                if run[1] == 5:
                    run, stuffed = (1 - bit, 1), count + 1
                longer[run] = max(longer.get(run, 0), stuffed)
        runs = longer
    return max(runs.values())

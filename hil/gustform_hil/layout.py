"""Bits of a signal within its frame, and the values that it can carry."""

from __future__ import annotations

import math
import struct

# Lengths of a frame's data that CAN FD knows.
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)

# How far an end of a range may miss a code, in codes, and still mean it: 0.1 is no sum of powers of two.
_NEAR = 1e-6


def bits(start: int, length: int, motorola: bool) -> list[int]:
    """Numbers of the bits, 8 * byte + bit, from the least significant one on."""
    if not motorola:
        return list(range(start, start + length))
    numbers = [start]
    while len(numbers) < length:
        last = numbers[-1]
        numbers.append(last - 1 if last % 8 else last + 15)
    return numbers[::-1]


def codes(length: int, signed: bool) -> tuple[int, int]:
    """Least and largest raw value of an integer."""
    return (-(1 << (length - 1)), (1 << (length - 1)) - 1) if signed else (0, (1 << length) - 1)


def integer_range(
    low: float, high: float, scale: float, offset: float, least: int, largest: int
) -> tuple[float, float] | None:
    """The values of the codes at the ends of [low, high], exactly as decoding gives them. None: no code is inside.

    A value that was cut to them is within the range for whoever decodes it, which the ends of the DBC themselves need
    not be: with a factor of 0.5 a range up to 100.3 ends at 100.
    """
    ends = sorted(((low - offset) / scale, (high - offset) / scale))
    first = max(least, math.ceil(ends[0] - _NEAR))
    last = min(largest, math.floor(ends[1] + _NEAR))
    if first > last:
        return None
    values = sorted((float(first * scale + offset), float(last * scale + offset)))
    return values[0], values[1]


def real_range(low: float, high: float, scale: float, offset: float, length: int) -> tuple[float, float] | None:
    """The same for IEEE 754: the outermost values within [low, high] that the bits carry. None: there is none."""
    ends = sorted(((low - offset) / scale, (high - offset) / scale))
    first, last = _inward(ends[0], length, +1), _inward(ends[1], length, -1)
    values = sorted((first * scale + offset, last * scale + offset))
    return (values[0], values[1]) if first <= last and all(map(math.isfinite, values)) else None


def _inward(value: float, length: int, direction: int) -> float:
    """The value that the bits carry nearest to `value`, not beyond it."""
    if length == 64:
        return value
    most = 3.4028234663852886e38  # largest float
    value = max(-most, min(most, value))
    carried: float = struct.unpack("<f", struct.pack("<f", value))[0]
    if (carried - value) * direction >= 0.0:
        return carried
    return _neighbour(carried, direction)


def _neighbour(value: float, direction: int) -> float:
    """The next float up or down."""
    if value == 0.0:
        return direction * 2.0**-149
    code = struct.unpack("<i", struct.pack("<f", value))[0]
    code += 1 if (value > 0.0) == (direction > 0) else -1
    result: float = struct.unpack("<f", struct.pack("<i", code))[0]
    return result

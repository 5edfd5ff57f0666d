"""The container format of a system table: named arrays in one file that C reads without any library.

Layout (little-endian): magic "GUSTTAB1", u32 version, u32 number of sections; per section 80 bytes: name[56],
u32 dtype (1 f64, 2 i32, 3 u8, 4 i64), u32 0, u64 count, u64 offset (64-byte aligned); then the data.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError

MAGIC = b"GUSTTAB1"
VERSION = 1
_DTYPES: dict[int, np.dtype[Any]] = {
    1: np.dtype("<f8"), 2: np.dtype("<i4"), 3: np.dtype("u1"), 4: np.dtype("<i8"),
}  # fmt: skip
_CODES = {dtype.str: code for code, dtype in _DTYPES.items()}
_ENTRY = struct.Struct("<56sIIQQ")
_ALIGN = 64

Sections = dict[str, NDArray[Any]]


def strings(items: list[str]) -> NDArray[np.uint8]:
    """NUL-terminated UTF-8 strings in one array."""
    return np.frombuffer("".join(item + "\0" for item in items).encode(), dtype=np.uint8)


def read_strings(section: NDArray[Any]) -> list[str]:
    """The inverse of `strings`."""
    return section.tobytes().decode().split("\0")[:-1]


def pack(sections: Sections) -> bytes:
    """The file's bytes."""
    position = 16 + _ENTRY.size * len(sections)
    head = [MAGIC, struct.pack("<II", VERSION, len(sections))]
    body: list[bytes] = []
    end = position
    for name, array in sections.items():
        code = _CODES[array.dtype.str]
        encoded = name.encode()
        if len(encoded) > 55:
            raise ValueError(f"section name {name!r} is too long")
        start = -(-end // _ALIGN) * _ALIGN
        data = np.ascontiguousarray(array).tobytes()
        body += [b"\0" * (start - end), data]
        head.append(_ENTRY.pack(encoded, code, 0, array.size, start))
        end = start + len(data)
    return b"".join(head + body)


def unpack(data: bytes) -> Sections:
    """The arrays in a file's bytes; GF7001 when they are not a system table."""

    def refuse(why: str) -> GustformError:
        return GustformError("GF7001", f"not a system table: {why}", hint="a file written by gustform")

    if data[:8] != MAGIC:
        raise refuse(f"it begins with {data[:8]!r}")
    if len(data) < 16:
        raise refuse("its header is cut off")
    version, count = struct.unpack_from("<II", data, 8)
    if version != VERSION:
        raise refuse(f"version {version}, this program reads {VERSION}")
    sections: Sections = {}
    for k in range(count):
        if 16 + (k + 1) * _ENTRY.size > len(data):
            raise refuse("its list of sections is cut off")
        name, code, _, size, offset = _ENTRY.unpack_from(data, 16 + k * _ENTRY.size)
        if code not in _DTYPES or offset + size * _DTYPES[code].itemsize > len(data):
            raise refuse(f"section {k} lies outside the file")
        try:
            label = name.rstrip(b"\0").decode()
        except UnicodeDecodeError:
            raise refuse(f"the name of section {k} is not text") from None
        sections[label] = np.frombuffer(data, dtype=_DTYPES[code], count=size, offset=offset)
    return sections

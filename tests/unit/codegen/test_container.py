"""The container of a system table: what goes in comes out, and nothing that is cut off or forged is believed."""

from __future__ import annotations

import contextlib
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gustform.language.errors import GustformError
from gustform_codegen.container import Sections, pack, read_strings, strings, unpack

names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=13)
sections = st.dictionaries(
    names,
    st.sampled_from(["<f8", "<i4", "u1", "<i8"]).flatmap(lambda t: arrays(t, st.integers(0, 20))),
    max_size=6,
)


@settings(max_examples=30)
@given(sections)
def test_round_trip(content: Sections) -> None:
    data = pack(content)
    found = unpack(data)
    assert list(found) == list(content)
    for name, array in content.items():
        assert found[name].dtype == array.dtype
        assert found[name].tobytes() == array.tobytes()  # NaN and -0.0 to the bit
    assert pack(found) == data


@given(st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"))))
def test_strings_round_trip(items: list[str]) -> None:
    assert read_strings(strings(items)) == items


def example() -> bytes:
    return pack({"counts": np.arange(8, dtype=np.int32), "start": np.linspace(0, 1, 5), "name": strings(["a", "b"])})


def test_the_layout_is_the_one_that_c_reads() -> None:
    data = example()
    assert data[:8] == b"GUSTTAB1"
    assert struct.unpack_from("<II", data, 8) == (1, 3)
    name, dtype, reserved, count, offset = struct.unpack_from("<56sIIQQ", data, 16 + 80)
    assert (name.rstrip(b"\0"), dtype, reserved, count) == (b"start", 1, 0, 5)
    assert offset % 64 == 0
    assert struct.unpack_from("<5d", data, offset) == (0.0, 0.25, 0.5, 0.75, 1.0)


def test_sections_are_aligned_and_do_not_overlap() -> None:
    data = pack({f"s{k}": np.zeros(k, dtype=np.uint8) for k in range(70)})
    end = 16 + 80 * 70
    for k in range(70):
        _, _, _, count, offset = struct.unpack_from("<56sIIQQ", data, 16 + 80 * k)
        assert offset % 64 == 0
        assert offset >= end or count == 0
        end = max(end, offset + count)


def refused(data: bytes) -> str:
    with pytest.raises(GustformError) as refusal:
        unpack(data)
    assert refusal.value.code == "GF7001"
    return str(refusal.value)


def test_every_prefix_is_refused() -> None:
    data = example()
    for length in range(len(data)):
        assert "not a system table" in refused(data[:length])


def forged(position: int, form: str, *values: Any) -> bytes:
    data = bytearray(example())
    struct.pack_into(form, data, position, *values)
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "it begins with b''"),
        (b"CDF\x01 something else entirely", "it begins with b'CDF"),
        (forged(8, "<I", 2), "version 2, this program reads 1"),
        (forged(12, "<I", 2**32 - 1), "section 3 lies outside the file"),  # what follows the list is no entry
        (pack({})[:12] + struct.pack("<I", 5), "list of sections is cut off"),
        (forged(16 + 56, "<I", 9), "section 0 lies outside the file"),  # a type that does not exist
        (forged(16 + 64, "<Q", 2**62), "section 0 lies outside the file"),
        (forged(16 + 72, "<Q", 2**63), "section 0 lies outside the file"),
        (forged(16 + 80, "<2s", b"\xff\xfe"), "the name of section 1 is not text"),
    ],
)
def test_forged_headers_are_refused(data: bytes, message: str) -> None:
    assert message in refused(data)


@settings(max_examples=200)
@given(st.data())
def test_random_damage_is_refused_or_harmless(data: st.DataObject) -> None:
    damaged = bytearray(example())
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(GustformError):  # anything else is a crash
        unpack(bytes(damaged))


def test_names_that_do_not_fit_are_a_defect_of_the_writer() -> None:
    with pytest.raises(ValueError, match="too long"):
        pack({"x" * 56: np.zeros(1)})
    assert list(unpack(pack({"x" * 55: np.zeros(1)}))) == ["x" * 55]

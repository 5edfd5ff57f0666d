"""The budget of the shipped message sets, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

from gustform.language.errors import GustformError
from gustform_hil.budget import Assumptions, Frame, budget, frames_of, refuse
from gustform_hil.dbc import read_dbc
from gustform_hil.frame_time import BitRates
from gustform_hil.locate import can_folder

SLOW, FAST = BitRates(500_000, 2_000_000), BitRates(1_000_000, 5_000_000)
CLASSIC = BitRates(1_000_000, 1_000_000)


def shipped(name: str) -> list[Frame]:
    return frames_of(read_dbc(can_folder() / f"gustform_{name}.dbc").database.messages)


def frame(name: str, identifier: int, length: int = 8, cycle_ms: int = 10, extended: bool = False) -> Frame:
    return Frame(name, ("A",), identifier, extended, False, length, Fraction(cycle_ms, 1000), event=False)


@pytest.mark.parametrize(("name", "rates"), [("fd", SLOW), ("fd", FAST), ("classic", CLASSIC)])
def test_the_shipped_sets_fit(name: str, rates: BitRates) -> None:
    found = budget(name, shipped(name), rates)
    refuse(found)
    assert found.fits
    assert found.load < 1


def test_the_classic_set_does_not_fit_half_a_megabit() -> None:
    with pytest.raises(GustformError, match=r"GF8121: classic needs 11\d\.\d% of a bus") as refused:
        refuse(budget("classic", shipped("classic"), BitRates(500_000, 500_000)))
    assert refused.value.hint == "--bitrate 1M"


def test_a_missed_deadline_names_message_response_deadline_and_a_way_out() -> None:
    # Some 265 us a frame at 500 kbit/s: behind D, which has just begun, A and B, C ends after 4 frames.
    frames = [frame(name, k, cycle_ms=1) for k, name in enumerate("ABC", start=1)] + [frame("D", 9, cycle_ms=100)]
    with pytest.raises(
        GustformError, match=r"GF8122: C of x may take 1\.0\d\d ms at 500 kbit/s; .* is 1\.000 ms"
    ) as late:
        refuse(budget("x", frames, SLOW))
    assert late.value.hint == "--bitrate 1M"
    with pytest.raises(GustformError, match="GF8121") as over:
        refuse(budget("x", [frame(f"M{k}", k, cycle_ms=1) for k in range(9)], BitRates(1_000_000, 1_000_000)))
    assert over.value.hint == "cycle times that are 2 times as long"


def test_what_is_more_urgent_on_the_wire() -> None:
    # 0x100 in front of all that begins with its 11 bits; then by the other 18.
    frames = [
        frame("C", 0x100 << 18 | 1, extended=True),
        frame("D", 0x101),
        frame("A", 0x100),
        frame("B", 0x100 << 18, extended=True),
    ]
    assert [row.frame.name for row in budget("x", frames, CLASSIC).rows] == list("ABCD")


def test_an_fd_frame_is_filled_up_to_a_length_that_there_is() -> None:
    base = replace(frame("A", 0x100), fd=True)
    by_length = {n: budget("x", [replace(base, length=n)], SLOW).rows[0].time for n in (33, 47, 48, 49, 64)}
    assert by_length[33] == by_length[47] == by_length[48] < by_length[49] == by_length[64]


def test_jitter_and_errors_make_it_later() -> None:
    def worst(assumptions: Assumptions) -> Fraction:
        response = budget("x", shipped("fd"), FAST, assumptions).rows[3].response
        assert response is not None
        return response

    plain = worst(Assumptions())
    assert worst(Assumptions(jitter=Fraction(1, 10_000))) >= plain + Fraction(1, 10_000)
    # One error: 31 bits of an error frame, and the longest frame once more.
    longest = budget("x", shipped("fd"), FAST).rows[2].time
    assert worst(Assumptions(error_interval=Fraction(1))) == plain + 31 * Fraction(1, 1_000_000) + longest


@pytest.mark.parametrize("rates", [(5_000, 5_000), (2_000_000, 2_000_000), (500_000, 250_000), (500_000, 10_000_000)])
def test_rates_that_no_bus_has(rates: tuple[int, int]) -> None:
    with pytest.raises(GustformError, match="GF8120"):
        budget("x", [frame("A", 1)], BitRates(*rates))

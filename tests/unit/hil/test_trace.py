"""A log as curves: samples that are counted on where numbers wrap, losses, damage, and where a run begins and ends."""

from __future__ import annotations

import can
import numpy as np
import pytest

from gustform_hil.client import Client, Frame
from gustform_hil.codec import Codec
from gustform_hil.database import shipped
from gustform_hil.message_set import Part
from gustform_hil.trace import Trace, trace


class Recorder:
    """Frames of both sides of a bus, in their order, as a log has them."""

    def __init__(self, bus: str) -> None:
        self.codec = Codec(shipped(bus))
        self.client = Client(None, self.codec)  # type: ignore[arg-type]  # nothing is sent
        self.frames: list[can.Message] = []

    def add(self, part: Part, values: dict[str, float]) -> list[Frame]:
        made = self.client.frames(part, values)
        self.keep(made)
        return made

    def keep(self, made: list[Frame]) -> None:
        for one in made:
            self.frames.append(
                can.Message(arbitration_id=one.identifier, data=one.data, is_fd=one.fd, is_extended_id=False)
            )

    def period(self, sample: int, *, enabled: bool, v_dc: float, answer: int | None = None) -> None:
        self.add(Part.MEASUREMENTS, {"sample": sample, "v_dc": v_dc, "omega_r": 1.1})
        self.add(Part.SYNC, {"sample": sample})
        answered = sample if answer is None else answer
        self.add(
            Part.REFERENCES, {"sample": answered, "enable": 1.0 if enabled else 0.0, "omega_gsc": 1.0 + v_dc / 1000}
        )

    @property
    def trace(self) -> Trace:
        return trace(self.frames, self.codec, "frames")


def v_dc(sample: int) -> float:
    return 1.0 + 0.001 * (sample % 40)


def recorded(bus: str, first: int, run: range, last: int) -> Recorder:
    recorder = Recorder(bus)
    recorder.add(Part.SYNC, {"sample": first})  # a log tells its samples from its first Sync on
    for sample in range(first, last):
        recorder.period(sample, enabled=sample in run, v_dc=v_dc(sample))
    return recorder


@pytest.mark.parametrize("bus", ["fd", "classic"])
@pytest.mark.parametrize("first", [0, 9, 2**31 - 30, 2**32 - 200])
def test_a_run_is_what_was_enabled(bus: str, first: int) -> None:
    # The classic set's samples have 4 bits: they wrap six times here.
    found = recorded(bus, first, range(first + 20, first + 120), first + 125).trace
    assert found.start == first + 20
    assert (found.samples, found.lost, found.damaged) == (126, 0, 0)
    series = found.measurements["v_dc"]
    assert series.sample.tolist() == list(range(first + 20, first + 120))
    assert series.values == pytest.approx([v_dc(k) for k in series.sample], abs=2.1e-5)  # 16 bits over 0 ... 2.6
    assert found.references["omega_gsc"].sample.tolist() == series.sample.tolist()
    assert found.idle >= {"P_gsc", "wind", "i_d_gsc"}
    assert not found.idle & {"v_dc", "omega_r", "omega_gsc"}


def test_never_started() -> None:
    found = recorded("fd", 0, range(0), 30).trace
    assert found.start is None
    assert found.references == {}


@pytest.mark.parametrize("bus", ["fd", "classic"])
def test_lost_and_damaged_samples_are_counted(bus: str) -> None:
    whole = recorded(bus, 0, range(5, 60), 60)
    n = len(whole.codec.messages.pieces(Part.MEASUREMENTS)) + 1 + len(whole.codec.messages.pieces(Part.REFERENCES))
    del whole.frames[30 * n + 1]  # a piece of the measurements of sample 30
    whole.frames[40 * n - 2].data[-1] ^= 4  # a piece of the references of sample 39
    found = whole.trace
    assert (found.lost, found.damaged) == (1, 1)
    assert 30 not in found.measurements["v_dc"].sample
    assert len(found.measurements["v_dc"].sample) == 54


def test_the_run_ends_where_commands_are_blocked() -> None:
    recorder = recorded("fd", 0, range(10, 50), 80)
    for sample in range(80, 120):  # a second run
        recorder.period(sample, enabled=True, v_dc=1.9)
    found = recorder.trace
    assert found.measurements["v_dc"].sample.tolist() == list(range(10, 50))
    assert np.max(found.measurements["v_dc"].values) < 1.1


def test_a_held_command_belongs_to_the_sample_it_answers() -> None:
    recorder = recorded("fd", 0, range(10), 10)
    recorder.add(Part.SYNC, {"sample": 10})  # its measurements were lost
    recorder.add(Part.REFERENCES, {"sample": 9, "enable": 1.0, "omega_gsc": 1.0 + v_dc(9) / 1000})
    recorder.period(11, enabled=True, v_dc=v_dc(11))
    found = recorder.trace
    assert found.references["omega_gsc"].sample.tolist() == [*range(10), 11]
    assert found.lost == 1


def test_frames_of_others_and_error_frames_are_left_alone() -> None:
    recorder = recorded("fd", 0, range(2, 8), 10)
    strangers = [
        can.Message(arbitration_id=0x7FE, data=bytes(8), is_extended_id=False),
        can.Message(arbitration_id=0x100, data=bytes(8), is_extended_id=True),
        can.Message(arbitration_id=0x40, data=bytes(8), is_extended_id=False, is_error_frame=True),
        can.Message(arbitration_id=0x100, is_extended_id=False, is_remote_frame=True),
    ]
    recorder.frames[5:5] = strangers
    assert recorder.trace.damaged == 0

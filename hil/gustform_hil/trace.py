"""A log of the bus as curves: each quantity over the number of its sample.

Numbers of samples that wrap, as those of the classic set do after 15, are counted on by the Syncs between.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gustform_hil.codec import Codec
from gustform_hil.decoding import decode, names_of
from gustform_hil.log import read_log
from gustform_hil.message_set import Field, Message, Part

if TYPE_CHECKING:
    import can

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """One quantity: samples, increasing, and its values there."""

    sample: NDArray[np.int64]
    values: Floats


@dataclass(frozen=True)
class Trace:
    """What a log holds of its first run: from the first sample that was answered with enabled references, `start`
    (None: there was no such one), to the last one before they were blocked. `idle`: quantities that never left the
    value of least harm, which is sent for what nobody measures or commands."""

    name: str
    period: float  # s
    measurements: dict[str, Series]
    references: dict[str, Series]
    idle: frozenset[str]
    start: int | None
    samples: int  # Syncs
    lost: int  # samples without all of their measurements
    damaged: int  # frames of the message set that failed a check


def read_trace(file: Path, codec: Codec) -> Trace:
    """Of a log file. GF8075."""
    return trace(read_log(file), codec, file.name)


def trace(frames: Iterable[can.Message], codec: Codec, name: str) -> Trace:
    """Of frames in their order."""
    collector = _Collector(codec)
    for frame in frames:
        collector.add(frame)
    return collector.trace(name)


class _Collector:
    def __init__(self, codec: Codec) -> None:
        self._codec = codec
        self._names = names_of(codec.messages)
        self._sync = codec.messages.pieces(Part.SYNC)[0]
        quantities = [s for m in codec.messages.messages for s in m.signals if s.field == Field.QUANTITY]
        self._safe = {s.quantity: float(np.float32(s.safe)) if s.real else s.safe for s in quantities}
        self._now = 0  # number of the period, not wrapped: that of the next Sync
        self._syncs = 0
        self._damaged = 0
        self._measured: dict[int, dict[str, float]] = {}
        self._answered: dict[int, dict[str, float]] = {}

    def add(self, frame: can.Message) -> None:
        found = decode(self._codec, self._names, frame)
        if found is None:
            return
        if found.problem is not None:
            self._damaged += 1
            return
        part, values = found.message.part, found.values
        if self._syncs == 0 and part != Part.SYNC:
            return  # of a sample whose full number is not known yet
        if part == Part.SYNC:
            self._now = self._unwrapped(found.message, values) + 1
            self._syncs += 1
        elif part == Part.MEASUREMENTS:
            sample = self._unwrapped(found.message, values)
            self._measured.setdefault(sample, {}).update(values)
        elif part == Part.REFERENCES:
            sample = self._unwrapped(found.message, values)
            self._answered.setdefault(sample, {}).update(values)

    def _unwrapped(self, message: Message, values: dict[str, float]) -> int:
        """The sample that is nearest to the period reached and has this number."""
        signal = message.signal(Field.SAMPLE)
        assert signal is not None, "the mapping has been checked"
        modulus = int(signal.high) + 1
        number = int(values.pop("sample"))
        if self._syncs == 0 and message.part == Part.SYNC:
            return number
        ahead = (number - self._now) % modulus
        return self._now + (ahead if ahead <= modulus // 2 else ahead - modulus)

    def trace(self, name: str) -> Trace:
        enabled = {sample: values.pop("enable", 0.0) == 1.0 for sample, values in self._answered.items()}
        start = min((sample for sample, on in enabled.items() if on), default=None)
        end = min((s for s, on in enabled.items() if not on and start is not None and s > start), default=None)
        within = range(0) if start is None else range(start, max(enabled) + 1 if end is None else end)
        measured = {sample: values for sample, values in self._measured.items() if sample in within}
        commanded = {sample: values for sample, values in self._answered.items() if sample in within}
        complete = max((len(values) for values in measured.values()), default=0)
        whole = {sample: values for sample, values in measured.items() if len(values) == complete}
        measurements, references = _series(whole), _series(commanded)
        idle = {key for key, series in (measurements | references).items() if np.all(series.values == self._safe[key])}
        return Trace(
            name,
            self._sync.cycle * 1e-6,
            measurements,
            references,
            frozenset(idle),
            start,
            self._syncs,
            len(within) - len(whole),
            self._damaged,
        )


def _series(rows: dict[int, dict[str, float]]) -> dict[str, Series]:
    if not rows:
        return {}
    order = sorted(rows)
    names = sorted(set().union(*rows.values()), key=list(rows[order[0]]).index)
    samples = np.array(order, dtype=np.int64)
    result = {}
    for name in names:
        values = np.array([rows[sample].get(name, np.nan) for sample in order])
        known = ~np.isnan(values)
        result[name] = Series(samples[known], values[known])
    return result

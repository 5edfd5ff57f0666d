"""Statistics of stored channels, read block by block: moments, histogram and spectral density.

What a run computed while it went on is in its summary; these are for any result, over the rows that were stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import h5py

Floats = NDArray[np.float64]

_BLOCK_ROWS = 65_536
_LOOKED_AT = 100_000  # rows, for turbulence
_REVERSALS = 30  # fewer are a step, a ramp or a gust


@dataclass(frozen=True)
class Moments:
    """Over all rows and instances. `integral` is over time and summed over instances."""

    mean: float
    std: float
    low: float
    high: float
    integral: float

    @property
    def spread(self) -> float:
        """From the smallest to the largest value."""
        return self.high - self.low


def moments(data: h5py.Dataset, time: h5py.Dataset) -> Moments:
    """Moments of a channel. Values that are no numbers count nowhere."""
    rows, shift = 0, math.nan
    first = second = integral = 0.0
    low, high = math.inf, -math.inf
    for begin, end in _blocks(data.shape[0]):
        values = np.asarray(data[begin:end], np.float64)
        known = values[np.isfinite(values)]
        if known.size:
            if math.isnan(shift):
                shift = float(known[0])  # near the mean, so that the squares below lose no digits
            first += float((known - shift).sum())
            second += float(((known - shift) ** 2).sum())
            rows += known.size
            low, high = min(low, float(known.min())), max(high, float(known.max()))
        # One row of the block before, so that no interval is lost between them.
        before = max(0, begin - 1)
        summed = np.asarray(data[before:end], np.float64).reshape(end - before, -1).sum(axis=1)
        steps = np.diff(np.asarray(time[before:end], np.float64))
        integral += float((0.5 * (summed[1:] + summed[:-1]) * steps).sum())
    if not rows:
        return Moments(math.nan, math.nan, math.nan, math.nan, math.nan)
    mean = first / rows
    return Moments(shift + mean, math.sqrt(max(0.0, second / rows - mean * mean)), low, high, integral)


def turbulent(data: h5py.Dataset) -> bool:
    """Whether a wind turns often: what is left of a step, a ramp or a gust is no turbulence."""
    rows = min(data.shape[0], _LOOKED_AT)
    values = np.asarray(data[:rows], np.float64).reshape(rows, -1)[:, :1].ravel()
    moved = np.sign(np.diff(values))
    moved = moved[moved != 0.0]
    return int((moved[1:] != moved[:-1]).sum()) > _REVERSALS


def histogram(data: h5py.Dataset, low: float, high: float, bins: int) -> tuple[Floats, Floats]:
    """Edges and the share of rows (and instances) between them."""
    edges = np.linspace(low, high, bins + 1)
    counts = np.zeros(bins)
    for begin, end in _blocks(data.shape[0]):
        values = np.asarray(data[begin:end], np.float64)
        counts += np.histogram(values[np.isfinite(values)], edges)[0]
    return edges, counts / max(1.0, counts.sum())


def spectrum(data: h5py.Dataset, every: float, segment: int) -> tuple[Floats, Floats]:
    """One-sided spectral density after Welch, unit^2/Hz: Hann window, half overlap, means taken off.

    `every`: spacing of the rows, s; `segment`: rows of a piece. Of several instances it is the mean of theirs.
    """
    window = np.hanning(segment + 1)[:-1]
    scale = 2.0 * every / float((window**2).sum())
    power, pieces = np.zeros(segment // 2 + 1), 0
    for begin in range(0, data.shape[0] - segment + 1, segment // 2):
        piece = np.asarray(data[begin : begin + segment], np.float64).reshape(segment, -1)
        piece = piece - piece.mean(axis=0)
        power += (np.abs(np.fft.rfft(piece * window[:, None], axis=0)) ** 2).mean(axis=1)
        pieces += 1
    density = scale * power / max(1, pieces)
    # Frequency 0, and half the sampling frequency, stand once in a two-sided density.
    density[0] /= 2.0
    if segment % 2 == 0:
        density[-1] /= 2.0
    return np.asarray(np.fft.rfftfreq(segment, every), np.float64), density


def octaves(frequency: Floats, density: Floats, per_octave: int = 12) -> tuple[Floats, Floats]:
    """The density averaged over bands of equal width on a logarithmic axis; narrower ones keep their one value."""
    frequency, density = frequency[1:], density[1:]
    band = np.floor(per_octave * np.log2(frequency / frequency[0])).astype(np.int64)
    weight = np.bincount(band)
    there = weight > 0
    return (
        np.bincount(band, frequency)[there] / weight[there],
        np.bincount(band, density)[there] / weight[there],
    )


def _blocks(rows: int) -> Iterator[tuple[int, int]]:
    return ((begin, min(begin + _BLOCK_ROWS, rows)) for begin in range(0, rows, _BLOCK_ROWS))

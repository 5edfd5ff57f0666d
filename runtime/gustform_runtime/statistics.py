"""Statistics of rows as they come, in constant memory: gust_stats.h as a Python class."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gustform_runtime.bindings import CyclesResult, MomentsResult, StatsChannel, library
from gustform_runtime.errors import RunError, Status

Doubles = NDArray[np.float64]
Counts = NDArray[np.int64]

_MESSAGE_SIZE = 1024
RAINFLOW = "ASTM E1049-85 5.4.4 (three points), remaining ranges as half cycles"


@dataclass(frozen=True)
class Keep:
    """What is kept of one column of a row; count, mean, deviation and extremes always are.

    `edges`: of a histogram, ascending. `segment`: samples in a segment of a spectrum, a power of two. `exponents`: the
    m of rainflow sums of n_i R_i^m. `ranges`: how many bins of `range_width` the histogram of rainflow ranges has.
    """

    column: int
    edges: Sequence[float] | Doubles = ()
    segment: int = 0
    exponents: Sequence[float] = ()
    ranges: int = 0
    range_width: float = 0.0


@dataclass(frozen=True)
class Moments:
    """Of the finite samples; NaN where there are none. `deviation` is the root of the mean square off the mean."""

    count: int
    not_finite: int
    mean: float
    deviation: float
    minimum: float
    t_minimum: float
    maximum: float
    t_maximum: float


@dataclass(frozen=True)
class Histogram:
    """Samples between edges, as numpy.histogram counts them, and outside."""

    count: Counts
    below: int
    above: int


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density, unit^2/Hz, as scipy.signal.welch averages it over `segments`."""

    frequency: Doubles
    density: Doubles
    segments: int


@dataclass(frozen=True)
class Cycles:
    """Rainflow cycles: sums of n_i R_i^m for each exponent, cycles in each bin of ranges (the last: above all bins)."""

    damage: Doubles
    cycles: Doubles
    full: int
    half: int
    forced: int
    largest: float

    def equivalent(self, exponents: Sequence[float], n: float) -> Doubles:
        """Damage-equivalent load: the range that does the same damage in `n` cycles (1 Hz equivalent: seconds)."""
        return np.asarray((self.damage / n) ** (1.0 / np.asarray(exponents)), dtype=np.float64)


def _array(numbers: ArrayLike) -> Doubles:
    return np.ascontiguousarray(numbers, dtype=np.float64)


def _address(array: Doubles | Counts) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


class Statistics:
    """Statistics of some columns of rows that come `interval` seconds apart.

    Rows come by add(), or from a simulation that was given the object (Simulation.set_statistics). Results can be asked
    for at any time; results[k] belong to keep[k]. One thread at a time.
    """

    def __init__(self, keep: Sequence[Keep], n_columns: int, interval: float) -> None:
        """Statistics of rows of `n_columns` values."""
        self._library = library()
        self._handle = ctypes.c_void_p()
        self.keep = tuple(keep)
        self.n_columns = n_columns
        self.interval = interval
        arrays = [(_array(k.edges), _array(k.exponents)) for k in self.keep]  # alive until they have been copied
        channels = (StatsChannel * max(len(self.keep), 1))(
            *(
                StatsChannel(k.column, edges.size, edges.ctypes.data, k.segment, exponents.size,
                             exponents.ctypes.data, k.ranges, k.range_width)
                for k, (edges, exponents) in zip(self.keep, arrays, strict=True)
            )
        )  # fmt: skip
        message = ctypes.create_string_buffer(_MESSAGE_SIZE)
        code = self._library.gust_stats_create(
            channels, len(self.keep), n_columns, interval, ctypes.byref(self._handle), message, _MESSAGE_SIZE
        )
        if code != Status.OK:
            raise RunError(Status(code), message.value.decode(errors="replace"))

    def close(self) -> None:
        """Free everything. Not while a simulation that feeds it still runs."""
        self._library.gust_stats_destroy(ctypes.byref(self._handle))

    def __del__(self) -> None:
        if hasattr(self, "_handle"):
            self.close()

    @property
    def handle(self) -> ctypes.c_void_p:
        """For Simulation."""
        if self._handle.value is None:
            raise RunError(Status.BAD_ORDER, "the statistics have been closed")
        return self._handle

    def _check(self, code: int, what: str) -> None:
        if code != Status.OK:
            raise RunError(Status(code), what)

    def add(self, times: ArrayLike, rows: ArrayLike) -> None:
        """Add rows[n, n_columns] at times[n], s."""
        time, values = _array(times), _array(rows)
        if values.ndim == 1 and self.n_columns == 1:
            values = values[:, np.newaxis]
        if time.ndim != 1 or values.shape != (time.size, self.n_columns):
            raise RunError(
                Status.BAD_ARGUMENT,
                f"{time.size} times need rows of shape ({time.size}, {self.n_columns}); got {values.shape}",
            )
        code = self._library.gust_stats_add(self.handle, time.size, _address(time), _address(values))
        self._check(code, "rows could not be added")

    def moments(self, channel: int = 0) -> Moments:
        """Count, mean, deviation, extremes with their times."""
        found = MomentsResult()
        code = self._library.gust_stats_moments(self.handle, channel, ctypes.byref(found))
        self._check(code, f"there is no channel {channel}")
        return Moments(**{field.name: getattr(found, field.name) for field in fields(Moments)})

    def histogram(self, channel: int = 0) -> Histogram:
        """Counts between the edges."""
        count = np.zeros(max(len(self._kept(channel).edges) - 1, 0), dtype=np.int64)
        below, above = ctypes.c_int64(), ctypes.c_int64()
        code = self._library.gust_stats_histogram(
            self.handle, channel, _address(count), ctypes.byref(below), ctypes.byref(above)
        )
        self._check(code, f"channel {channel} keeps no histogram")
        return Histogram(count, below.value, above.value)

    def spectrum(self, channel: int = 0) -> Spectrum:
        """Welch's power spectral density."""
        segment = self._kept(channel).segment
        density, segments = np.zeros(segment // 2 + 1), ctypes.c_int64()
        code = self._library.gust_stats_spectrum(self.handle, channel, _address(density), ctypes.byref(segments))
        self._check(code, f"channel {channel} keeps no spectrum")
        frequency: Doubles = np.fft.rfftfreq(segment, self.interval).astype(np.float64)
        return Spectrum(frequency, density, segments.value)

    def cycles(self, channel: int = 0) -> Cycles:
        """Rainflow counts of all rows so far, what is still open as half cycles."""
        kept = self._kept(channel)
        damage, cycles, found = np.zeros(len(kept.exponents)), np.zeros(kept.ranges + 1), CyclesResult()
        code = self._library.gust_stats_cycles(
            self.handle, channel, _address(damage), _address(cycles), ctypes.byref(found)
        )
        self._check(code, f"channel {channel} counts no cycles")
        return Cycles(damage, cycles, found.full, found.half, found.forced, found.largest)

    def _kept(self, channel: int) -> Keep:
        if not 0 <= channel < len(self.keep):
            raise RunError(Status.BAD_ARGUMENT, f"there is no channel {channel}: there are {len(self.keep)}, from 0")
        return self.keep[channel]

    def save(self) -> bytes:
        """The state; restore() of another object with the same settings takes it up."""
        size = self._library.gust_stats_size(self.handle)
        buffer, used = ctypes.create_string_buffer(size), ctypes.c_size_t()
        code = self._library.gust_stats_save(self.handle, buffer, size, ctypes.byref(used))
        self._check(code, "the state could not be saved")
        return buffer.raw[: used.value]

    def restore(self, state: bytes) -> None:
        """Go on from a state that save() gave."""
        code = self._library.gust_stats_restore(self.handle, state, len(state))
        self._check(code, "not a sound state of statistics with these settings")

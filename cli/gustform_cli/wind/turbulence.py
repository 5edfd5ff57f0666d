"""A turbulent wind series of any length, made block by block.

Independent periodic segments of N samples, each a Fourier sum with random amplitudes and phases whose variance in
every frequency bin is the integral of the spectrum over that bin, overlap by half and are joined with sine and
cosine windows. sin^2 + cos^2 = 1, so the variance is the same at every moment. Block k needs segments k and k + 1
only, and a segment follows from the seed and its number: nothing depends on how long the run is, on what was read
before, or on a state that would have to be carried along.

What lies above the Nyquist frequency is left out (0.3 % of the standard deviation at 20 Hz and 10 m/s).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gustform_cli.wind.kaimal import Kaimal
from gustform_cli.wind.rotor import rotor_effective

# A segment covers at least this long, s, so that the slow end of the spectrum (some 200 s) is resolved.
_SEGMENT_SECONDS = 600.0
# The rotor equations know no standstill wind; Gaussian turbulence on a low mean would get there.
LOWEST_SPEED = 0.5


@lru_cache(maxsize=8)  # the turbines of a farm have the same
def _amplitudes(spectrum: Kaimal, size: int, step: float, radius: float | None) -> NDArray[np.complex128]:
    """For each frequency of a segment the rms of its harmonic, m/s, with the phase that the rotor's filter adds."""
    frequency = np.fft.rfftfreq(size, step).astype(np.float64)
    half_bin = 0.5 * frequency[1]
    upper = spectrum.variance_below(np.minimum(frequency + half_bin, frequency[-1]))
    lower = spectrum.variance_below(np.maximum(frequency - half_bin, 0.0))
    amplitude: NDArray[np.complex128] = np.sqrt(upper - lower).astype(np.complex128)
    if radius is not None:
        amplitude *= rotor_effective(frequency, radius, spectrum.mean)
    return amplitude


@lru_cache(maxsize=8)
def _windows(size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rising and the falling window over half a segment."""
    angle = 0.5 * np.pi * (np.arange(size) + 0.5) / size
    return np.sin(angle), np.cos(angle)


class TurbulentWind:
    """Samples of turbulent wind, m/s, at 0, step, 2 step, ...

    `radius` None gives the wind at a point, a rotor radius in m the wind that rotor feels. `seed` is any tuple of
    integers >= 0, e.g. (seed, number of the turbine).
    """

    def __init__(self, spectrum: Kaimal, *, step: float, seed: tuple[int, ...], radius: float | None = None) -> None:
        self.spectrum = spectrum
        self.step = step
        self._seed = seed
        self._size = 1 << max(10, math.ceil(math.log2(_SEGMENT_SECONDS / step)))
        self.block_size = self._size // 2
        self._amplitude = _amplitudes(spectrum, self._size, step, radius)
        self._rise, self._fall = _windows(self.block_size)
        self._kept: tuple[int, NDArray[np.float64], NDArray[np.float64]] | None = None

    def _segment(self, number: int) -> NDArray[np.float64]:
        """Segment `number`, zero mean in expectation, m/s."""
        # Raw bits and Box-Muller: their stream is fixed for ever, that of numpy's normal() is not promised to be.
        bits = np.random.Philox(np.random.SeedSequence((*self._seed, number))).random_raw(2 * self._amplitude.size)
        uniform = ((bits >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
        radius = np.sqrt(-2.0 * np.log(uniform[::2]))
        normal = radius * np.exp(2j * np.pi * uniform[1::2])
        harmonics = self._amplitude * normal
        # The mean and the Nyquist term are single real numbers, not pairs.
        harmonics[0] = self._amplitude[0].real * normal[0].real
        harmonics[-1] = abs(self._amplitude[-1]) * normal[-1].real
        # irfft divides by N and adds the conjugate half: a harmonic h becomes 2 Re(h exp(...)) / N, with the
        # variance 2 E|h|^2. E|normal|^2 = 2, so a bin of variance A^2 asks for h = A normal / 2.
        harmonics[1:-1] *= 0.5
        return np.fft.irfft(harmonics, self._size) * self._size

    def block(self, number: int) -> NDArray[np.float64]:
        """The `block_size` samples from `number * block_size` on, m/s."""
        half = self.block_size
        if self._kept is not None and self._kept[0] == number:
            falling = self._kept[2]
        else:
            falling = self._segment(number)[half:]
        coming = self._segment(number + 1)
        speed = self.spectrum.mean + self._fall * falling + self._rise * coming[:half]
        np.maximum(speed, LOWEST_SPEED, out=speed)
        # Kept: this block for repeated reads, and the half that the next block needs.
        self._kept = (number + 1, speed, coming[half:].copy())
        return speed

    def __call__(self, first: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times s and speeds m/s of samples first ... first + count - 1: the reader of a runtime series."""
        times = np.arange(first, first + count, dtype=np.float64) * self.step
        speed = np.empty(count)
        done = 0
        while done < count:
            number, offset = divmod(first + done, self.block_size)
            take = min(count - done, self.block_size - offset)
            if self._kept is not None and self._kept[0] == number + 1:
                samples = self._kept[1]
            else:
                samples = self.block(number)
            speed[done : done + take] = samples[offset : offset + take]
            done += take
        return times, speed

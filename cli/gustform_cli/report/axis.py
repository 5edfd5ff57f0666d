"""An axis of a chart: its range, its ticks and how they are written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_HOURS_FROM, _DAYS_FROM = 2.5 * 3600.0, 14 * 86400.0  # s of simulated time
_STEPS = {"h": (0.25, 0.5, 1, 2, 3, 6, 12, 24, 48, 72), "d": (1, 2, 5, 7, 14, 30, 60, 90)}


@dataclass(frozen=True)
class Axis:
    """From `low` to `high`, with ticks and their texts; `label` names quantity and unit."""

    low: float
    high: float
    ticks: tuple[float, ...]
    texts: tuple[str, ...]
    label: str = ""
    log: bool = False
    texts_are_long: bool = False  # names, not numbers: they stand on two lines in turn

    def place(self, value: float) -> float:
        """0 at the low end, 1 at the high end."""
        if self.log:
            return math.log(max(value, 1e-300) / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


def linear(low: float, high: float, label: str = "", *, least: float = 0.0, room: float = 0.05, most: int = 6) -> Axis:
    """An axis of values with some room at both ends, at least `least` high."""
    if high - low < least:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5 * least, middle + 0.5 * least
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-30):
        reach = 0.01 * max(abs(low), abs(high)) or 1.0
        low, high = low - reach, high + reach
    low, high = low - room * (high - low), high + room * (high - low)
    step = _round_step((high - low) / most)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    ticks = tuple(k * step for k in range(first, last + 1))
    return Axis(low, high, ticks, _written(ticks, step), label)


def time(begin: float, end: float) -> Axis:
    """Simulated time: seconds, hours from 2.5 h on, days from two weeks on."""
    span = end - begin
    unit, size = ("s", 1.0) if span < _HOURS_FROM else ("h", 3600.0) if span < _DAYS_FROM else ("d", 86400.0)
    step = next((step for step in _STEPS.get(unit, ()) if span / size / step <= 8), _round_step(span / size / 8))
    first, last = math.ceil(begin / size / step - 1e-9), math.floor(end / size / step + 1e-9)
    ticks = [k * step for k in range(first, last + 1)]
    return Axis(begin, end, tuple(tick * size for tick in ticks), _written(ticks, step), f"time, {unit}")


def decades(low: float, high: float, label: str = "") -> Axis:
    """A logarithmic axis with a tick at each power of ten, every second or third one where there are many."""
    if high < 10.0 * low:
        low, high = low / 3.2, high * 3.2  # ten between them, so that a power of ten is among them
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    every = max(1, -(-(last - first) // 6))
    powers = [k for k in range(first, last + 1) if k % every == 0]
    texts = tuple(f"{10.0**k:g}" if -3 <= k <= 3 else f"1e{k}" for k in powers)
    return Axis(low, high, tuple(10.0**k for k in powers), texts, label, log=True)


def categories(names: Sequence[str], label: str = "") -> Axis:
    """Texts side by side, at 0, 1, 2 ..."""
    return Axis(
        -0.5, len(names) - 0.5, tuple(float(k) for k in range(len(names))), tuple(names), label, texts_are_long=True
    )


def _round_step(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step))
    return next(power * k for k in (1.0, 2.0, 2.5, 5.0, 10.0) if power * k >= step * (1.0 - 1e-9))


def _written(ticks: Sequence[float], step: float) -> tuple[str, ...]:
    """Ticks with as many decimals as their step has; very large and very small ones with a common power of ten."""
    largest = max((abs(tick) for tick in ticks), default=0.0)
    power = 0
    if largest and not 1e-3 <= largest < 1e6:
        power = math.floor(math.log10(largest) + 1e-9)
    step /= 10.0**power
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    if round(step * 10.0**decimals, 6) % 1.0:
        decimals += 1  # steps of 2.5
    texts = (f"{tick / 10.0**power:.{decimals}f}" for tick in ticks)
    return tuple(_signed(text, power) for text in texts)


def _signed(text: str, power: int) -> str:
    if float(text) == 0.0:
        return "0" if power else text.removeprefix("-")
    return f"{text}e{power}" if power else text

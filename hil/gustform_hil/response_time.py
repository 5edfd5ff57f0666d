"""Worst-case response times on a CAN bus.

R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien: Controller Area Network (CAN) schedulability analysis: refuted,
revisited and revised. Real-Time Systems 35 (2007) 239-272. The bus is served by fixed priority without preemption. A
frame waits for the longest one of lower priority that has just begun (blocking B), for all of higher priority that come
until it begins, each up to J late, and for its own earlier instances: the first instance need not be the worst one, so
every instance q of the busy period is looked at,

    w(q) = B + q C + E(w + C) + sum over higher priorities of ceil((w + J_k + tau)/T_k) C_k
    R = max over q of  J + w(q) - q T + C.

tau is one bit: what is queued while a frame begins can still win. Errors on the bus, if any are reckoned with: at most
one per `error_interval`, each of which costs an error frame (31 bits) and the longest frame it can have destroyed.

All of it holds if each sender offers its most urgent frame first. Times are fractions of a second, exact: a ceiling
must not hang on rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import ceil

_ERROR_BITS = 31  # longest error frame with the intermission after it
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Traffic:
    """One message: times in seconds. `period` is the least distance of two frames."""

    name: str
    time: Fraction
    period: Fraction
    deadline: Fraction
    jitter: Fraction = _ZERO


@dataclass(frozen=True)
class Bus:
    """Time of a bit in the arbitration, and the least distance of two errors on the wire (None: no errors)."""

    bit: Fraction
    error_interval: Fraction | None = None


def load(messages: Sequence[Traffic]) -> Fraction:
    """Share of the time in which the bus is busy, at most."""
    return sum((m.time / m.period for m in messages), _ZERO)


def response_times(messages: Sequence[Traffic], bus: Bus) -> list[Fraction | None]:
    """Worst-case response time of each of `messages`, which are in order of priority; None: it has no bound."""
    return [_response(messages, k, bus) for k in range(len(messages))]


def _response(messages: Sequence[Traffic], at: int, bus: Bus) -> Fraction | None:
    own, higher, lower = messages[at], messages[:at], messages[at + 1 :]
    served = (*higher, own)
    destroyed = max(m.time for m in served)
    error = _ERROR_BITS * bus.bit + destroyed
    share = load(served) + (error / bus.error_interval if bus.error_interval else _ZERO)
    if share >= 1:
        return None
    blocking = max((m.time for m in lower), default=_ZERO)

    def errors(t: Fraction) -> Fraction:
        return error * ceil(t / bus.error_interval) if bus.error_interval else _ZERO

    def busy(t: Fraction) -> Fraction:
        return blocking + errors(t) + sum((ceil((t + m.jitter) / m.period) * m.time for m in served), _ZERO)

    def queueing(w: Fraction, instance: int) -> Fraction:
        ahead = sum((ceil((w + m.jitter + bus.bit) / m.period) * m.time for m in higher), _ZERO)
        return blocking + errors(w + own.time) + instance * own.time + ahead

    period = own.time
    while (longer := busy(period)) > period:
        period = longer
    worst = _ZERO
    w = blocking
    for instance in range(ceil((period + own.jitter) / own.period)):
        w = max(w, blocking + instance * own.time)  # the wait of an instance is no shorter than that of the one before
        while (longer := queueing(w, instance)) > w:
            w = longer
        worst = max(worst, own.jitter + w - instance * own.period + own.time)
    return worst

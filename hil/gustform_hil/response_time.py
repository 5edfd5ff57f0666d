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

That is for a sender that offers its most urgent frame first. One with a plain queue, as a Linux interface has, offers
the oldest: its messages M share the fate of the least urgent one, L. A frame that joins the queue at a, counted from
the moment since when the bus has been busy with M and what is more urgent than L, finds everything of M in front of it
that came until then, and each of them can lose to all that is more urgent than L:

    w(a) = B + sum over M of (floor((a + J_g)/T_g) + 1) C_g - C + E(w + C)
             + sum over others above L of ceil((w + J_k + f_k + tau)/T_k) C_k
    R = J + max over a of  w(a) + C - a.

f_k is how long k may wait in its own plain queue before it is offered at all, until what is in front of it has left:
frames come no more often than their periods, but they may come in a bunch. f and R are found together, from f = 0
upwards. A response that J makes worse counts J twice.

A sender may pace some of its messages: it hands one of them over in each `paced` seconds and keeps the others back. In
its own plain queue they are then one message, as long as the longest of them, that comes each `paced` seconds; each is
kept back (n - 1) `paced` at most, n of them taking turns, which adds to its own jitter for everybody else.

Times are fractions of a second, exact: a ceiling must not hang on rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

_LONGEST = 100  # periods; what waits longer in a plain queue waits for ever
_ERROR_BITS = 31  # longest error frame with the intermission after it
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Traffic:
    """One message: times in seconds. `period` is the least distance of two frames; `queue` the plain queue that it
    waits in, with all that have the same, or None: one that is sorted by urgency; `paced` the distance of all frames of
    its `sender` that are paced, or None.
    """

    name: str
    time: Fraction
    period: Fraction
    deadline: Fraction
    jitter: Fraction = _ZERO
    queue: str | None = None
    sender: str = ""
    paced: Fraction | None = None


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
    kept = [_kept_back(m, messages) for m in messages]
    hidden: list[Fraction | None] = [_ZERO] * len(messages)  # f
    while True:
        # How late each may be offered, nobody knowing why.
        late = [None if f is None else m.jitter + k + f for m, k, f in zip(messages, kept, hidden, strict=True)]
        found = [_response(messages, k, bus, late, kept[k]) for k in range(len(messages))]
        longer = [wait for _, wait in found]
        if longer == hidden:
            return [response for response, _ in found]
        hidden = longer


def _kept_back(message: Traffic, messages: Sequence[Traffic]) -> Fraction:
    """How long its sender may keep a paced message back."""
    if message.paced is None:
        return _ZERO
    others = sum(1 for m in messages if m.sender == message.sender and m.paced is not None) - 1
    return others * message.paced


def _queue_of(own: Traffic, messages: Sequence[Traffic]) -> list[Traffic]:
    """What waits in the plain queue of a message, those that are paced as one."""
    queue = [m for m in messages if m.queue == own.queue]
    direct, paced = [m for m in queue if m.paced is None], [m for m in queue if m.paced is not None]
    for sender in dict.fromkeys(m.sender for m in paced):
        some = [m for m in paced if m.sender == sender]
        distance = min(m.paced for m in some if m.paced is not None)
        direct.append(
            Traffic(sender, max(m.time for m in some), distance, distance, max(m.jitter for m in some), own.queue)
        )
    return direct


def _response(
    messages: Sequence[Traffic], at: int, bus: Bus, late: Sequence[Fraction | None], kept: Fraction
) -> tuple[Fraction | None, Fraction | None]:
    """Response, and how long it may wait before it is offered; None: for ever."""
    own = messages[at]
    alone = own.queue is None
    no_bound = None, _ZERO if alone else None
    if alone:
        own = replace(own, jitter=own.jitter + kept)
    queue = [own] if alone else _queue_of(own, messages)
    last = at if alone else max(k for k, m in enumerate(messages) if m.queue == own.queue)
    higher: list[tuple[Traffic, Fraction]] = []
    for message, offered in zip(messages[:last], late, strict=False):
        if alone or message.queue != own.queue:
            if offered is None:
                return no_bound
            higher.append((message, offered))
    served = [*queue, *(m for m, _ in higher)]
    destroyed = max(m.time for m in served)
    error = _ERROR_BITS * bus.bit + destroyed
    if load(served) + (error / bus.error_interval if bus.error_interval else _ZERO) >= 1:
        return no_bound
    blocking = max((m.time for m in messages[last + 1 :]), default=_ZERO)

    def errors(t: Fraction) -> Fraction:
        return error * ceil(t / bus.error_interval) if bus.error_interval else _ZERO

    def busy(t: Fraction) -> Fraction:
        ahead = [(m, m.jitter) for m in queue] + higher
        return blocking + errors(t) + sum((ceil((t + j) / m.period) * m.time for m, j in ahead), _ZERO)

    def queueing(w: Fraction, before: Fraction, time: Fraction) -> Fraction:
        ahead = sum((ceil((w + j + bus.bit) / m.period) * m.time for m, j in higher), _ZERO)
        return blocking + errors(w + time) + before + ahead

    def waiting(begin: Fraction, before: Fraction, time: Fraction) -> Fraction:
        """Until a frame of that time with `before` of its own queue in front of it begins; no less than `begin`."""
        w = max(begin, blocking + before)
        while (longer := queueing(w, before, time)) > w:
            w = longer
        return w

    period = own.time
    while (longer := busy(period)) > period:
        period = longer
    worst, w = _ZERO, blocking
    if alone:
        for instance in range(ceil((period + own.jitter) / own.period)):
            w = waiting(w, instance * own.time, own.time)  # no shorter than that of the instance before
            worst = max(worst, own.jitter + w - instance * own.period + own.time)
        return worst, _ZERO
    hidden, least = _ZERO, min(m.time for m in queue)
    for joined in _joining(queue, period):
        before = sum((((joined + m.jitter) // m.period + 1) * m.time for m in queue), _ZERO) - own.time
        w = waiting(w, before, own.time)
        worst = max(worst, kept + own.jitter + w + own.time - joined)
        if before > 0:  # the shorter the last one in front, the later it ends
            hidden = max(hidden, waiting(_ZERO, before - least, least) + least - joined)
    return worst, hidden if hidden <= _LONGEST * own.period else None


def _joining(queue: Sequence[Traffic], until: Fraction) -> list[Fraction]:
    """When more frames join a plain queue, as early as they can, until the bus falls idle."""
    moments = {_ZERO}
    for message in queue:
        moments |= {n * message.period - message.jitter for n in range(ceil((until + message.jitter) / message.period))}
    return sorted(moment for moment in moments if moment >= 0)

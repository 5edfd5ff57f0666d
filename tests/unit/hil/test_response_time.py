"""Response times: the published example, and a simulation of arbitration that knows nothing of the analysis."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction

import pytest

from gustform_hil.response_time import Bus, Traffic, load, response_times

BIT = Fraction(1)  # everything below in bits
BUS = Bus(BIT)


def traffic(name: str, time: float, period: float, deadline: float | None = None, jitter: float = 0) -> Traffic:
    period_ = Fraction(period)
    return Traffic(name, Fraction(time), period_, Fraction(deadline) if deadline else period_, Fraction(jitter))


def times(messages: list[Traffic], bus: Bus = BUS) -> list[Fraction]:
    found = response_times(messages, bus)
    assert None not in found
    return [t for t in found if t is not None]


# ---- The published example ------------------------------------------------------------------------------------------

# Davis et al. 2007: three messages of 7 bytes at 125 kbit/s, 125 bits or 1 ms each. The analysis of 1994 looks at the
# first instance of C only, finds 3 ms and calls the set schedulable; the second instance of C takes 3.5 ms.
EXAMPLE = [traffic("A", 125, 312.5), traffic("B", 125, 437.5, 406.25), traffic("C", 125, 437.5, 406.25)]


def test_the_example_that_the_first_analysis_got_wrong() -> None:
    assert [t / 125 for t in times(EXAMPLE)] == [2, 3, Fraction(7, 2)]
    assert EXAMPLE[2].deadline / 125 == Fraction(13, 4)  # missed
    assert load(EXAMPLE) == Fraction(2, 5) + 2 * Fraction(2, 7)


# ---- Closed forms ---------------------------------------------------------------------------------------------------


def test_alone_on_the_bus() -> None:
    assert times([traffic("A", 100, 1000)]) == [100]


def test_jitter_is_waited_for() -> None:
    assert times([traffic("A", 100, 1000, jitter=30)]) == [130]


def test_the_highest_waits_for_the_longest_of_the_others() -> None:
    assert times([traffic("A", 100, 9000), traffic("B", 50, 9000), traffic("C", 130, 9000)])[0] == 230


def test_what_comes_within_the_first_bit_still_wins() -> None:
    # B can begin at 100, just when the second A is there: A goes first.
    assert times([traffic("A", 100, 200), traffic("B", 50, 1000)])[1] == 150
    assert times([traffic("A", 100, 100.5), traffic("B", 0.25, 100_000)])[1] > 200


def test_an_overloaded_bus_has_no_bound() -> None:
    found = response_times([traffic("A", 60, 100), traffic("B", 50, 100), traffic("C", 1, 100)], BUS)
    assert found == [110, None, None]


def test_errors_cost_an_error_frame_and_a_repeat() -> None:
    bus = replace(BUS, error_interval=Fraction(10_000))
    assert times([traffic("A", 100, 1000)], bus) == [100 + 31 + 100]


# ---- Simulation -----------------------------------------------------------------------------------------------------


def simulate(
    messages: list[Traffic],
    releases: list[list[Fraction]],
    nominal: list[list[Fraction]],
    busy_until: Fraction = Fraction(0),
) -> list[Fraction]:
    """Longest time from the nominal release to the end of the frame, by playing arbitration out event by event.

    One frame at a time, the most urgent of those that wait when the bus falls idle, never preempted.
    """
    waiting: list[list[int]] = [[] for _ in messages]
    events = sorted((t, k, n) for k, times in enumerate(releases) for n, t in enumerate(times))
    worst = [Fraction(0)] * len(messages)
    now, at = busy_until, 0
    while at < len(events) or any(waiting):
        if not any(waiting):
            now = max(now, events[at][0])
        while at < len(events) and events[at][0] <= now:
            waiting[events[at][1]].append(events[at][2])
            at += 1
        k = next(k for k, queue in enumerate(waiting) if queue)
        n = waiting[k].pop(0)
        now += messages[k].time
        worst[k] = max(worst[k], now - nominal[k][n])
    return worst


def random_set(rng: random.Random) -> list[Traffic]:
    count = rng.randint(2, 6)
    while True:
        found = [
            traffic(
                f"M{k}", rng.choice([55, 75, 95, 125, 135]), rng.choice([400, 500, 700, 1000, 1300, 2000]),
                jitter=rng.choice([0, 0, 40, 250]),
            )
            for k in range(count)
        ]  # fmt: skip
        if load(found) < Fraction(97, 100):
            return found


def periodic(message: Traffic, first: Fraction, until: Fraction) -> list[Fraction]:
    found = []
    while first < until:
        found.append(first)
        first += message.period
    return found


@pytest.mark.parametrize("seed", range(60))
def test_no_simulated_frame_is_later_than_the_bound(seed: int) -> None:
    rng = random.Random(seed)
    messages = random_set(rng)
    bounds = times(messages)
    for _ in range(4):
        nominal = [periodic(m, Fraction(rng.randrange(int(m.period))), Fraction(20_000)) for m in messages]
        releases = [
            [t + rng.randint(0, int(m.jitter)) for t in first] for m, first in zip(messages, nominal, strict=True)
        ]
        for message, seen, bound in zip(messages, simulate(messages, releases, nominal), bounds, strict=True):
            assert seen <= bound, message


@pytest.mark.parametrize("seed", range(60))
def test_the_bound_is_reached_when_all_come_at_once(seed: int) -> None:
    """The critical instant: everything of the same and higher priority at time 0, as late as its jitter allows and
    never late from then on, just when the longest frame of lower priority has begun."""
    messages = random_set(random.Random(seed))
    for at, bound in enumerate(times(messages)):
        served, lower = messages[: at + 1], messages[at + 1 :]
        nominal = [periodic(m, -m.jitter, Fraction(30_000)) for m in served]
        releases = [[max(t, Fraction(0)) for t in first] for first in nominal]
        blocked = max((m.time for m in lower), default=Fraction(0))
        assert simulate(served, releases, nominal, blocked)[at] == bound, messages[at]


def test_the_second_instance_is_the_worst_one_in_the_simulation_too() -> None:
    releases = [periodic(m, Fraction(0), Fraction(1000)) for m in EXAMPLE]
    assert simulate(EXAMPLE, releases, releases)[2] == Fraction(7, 2) * 125

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


# ---- Plain queues ---------------------------------------------------------------------------------------------------


def test_in_a_plain_queue_all_share_the_fate_of_the_least_urgent() -> None:
    # C was first: it loses to B, and A has to wait for both.
    found = times([replace(traffic("A", 100, 9000), queue="x"), traffic("B", 80, 9000),
                   replace(traffic("C", 50, 9000), queue="x"), traffic("D", 60, 9000)])  # fmt: skip
    assert found == [60 + 80 + 50 + 100, 100 + 80 + 60, 290, 290]


def test_a_queue_of_one_is_no_other_than_a_sorted_one() -> None:
    compared = 0
    for seed in range(60):
        messages = [replace(m, jitter=Fraction(0)) for m in random_set(random.Random(seed))]
        expected = times(messages)
        if all(t <= m.period for t, m in zip(expected, messages, strict=True)):
            compared += 1
            assert times([replace(m, queue=m.name) for m in messages]) == expected
    assert compared > 20


def test_what_a_plain_queue_hides_comes_in_a_bunch() -> None:
    """B may stand 410 behind A, which loses to C and D, and then come with the next one of its kind close behind it."""
    queue = [traffic("D", 50, 5000), replace(traffic("B", 90, 520), queue="x"), traffic("C", 60, 5000),
             replace(traffic("A", 300, 5000), queue="x")]  # fmt: skip
    assert times([replace(m, queue=None) for m in queue])[2] == 300 + 50 + 90 + 60
    assert times(queue)[2] == 300 + 50 + 2 * 90 + 60


def test_messages_that_are_paced_are_one_in_the_queue() -> None:
    slow = [replace(traffic(n, t, 20_000), queue="x", sender="x") for n, t in (("C", 50), ("D", 90), ("E", 60))]
    first = replace(traffic("A", 100, 1000), queue="x", sender="x")
    plain = times([first, *slow])
    assert plain[0] == 300
    paced = times([first, *(replace(m, paced=Fraction(1000)) for m in slow)])
    assert paced == [190, *[2000 + 190] * 3]


def test_an_overloaded_plain_queue_has_no_bound_and_takes_others_with_it() -> None:
    found = response_times(
        [replace(traffic("A", 60, 1000), queue="x"), traffic("B", 55, 100), replace(traffic("C", 50, 100), queue="x")],
        BUS,
    )
    assert found == [None, None, None]


def play(messages: list[Traffic], releases: list[list[Fraction]], rng: random.Random) -> list[list[Fraction]]:
    """When each frame has left: as `simulate`, with plain queues; what joins one at the same moment does so in any
    order."""
    events = sorted((t, rng.random(), k, n) for k, some in enumerate(releases) for n, t in enumerate(some))
    queues: dict[str, list[tuple[int, int]]] = {}
    left = [[Fraction(0)] * len(some) for some in releases]
    now, at = Fraction(0), 0
    while at < len(events) or any(queues.values()):
        if not any(queues.values()):
            now = max(now, events[at][0])
        while at < len(events) and events[at][0] <= now:
            _, _, k, n = events[at]
            queues.setdefault(messages[k].queue or f"sorted {k}", []).append((k, n))
            at += 1
        name = min((name for name, waiting in queues.items() if waiting), key=lambda name: queues[name][0][0])
        k, n = queues[name].pop(0)
        now += messages[k].time
        left[k][n] = now
    return left


def pace(due: list[list[Fraction]], distance: Fraction, first: Fraction) -> list[list[Fraction]]:
    """When a sender hands over frames that are due: one in each `distance`, taking turns."""
    handed: list[list[Fraction]] = [[] for _ in due]
    now, turn = first, 0
    while any(len(h) < len(d) for h, d in zip(handed, due, strict=True)):
        order = [(turn + k) % len(due) for k in range(len(due))]
        ready = [k for k in order if len(handed[k]) < len(due[k]) and due[k][len(handed[k])] <= now]
        if ready:
            handed[ready[0]].append(now)
            turn = ready[0] + 1
        now += distance
    return handed


def queued_set(rng: random.Random) -> list[Traffic]:
    """Some of a random set in plain queues, some of those paced: at least two that are due at multiples of it."""
    found = random_set(rng)
    while True:
        messages = [replace(m, queue=rng.choice([None, None, "x", "y"]), sender="x") for m in found]
        slow = [k for k, m in enumerate(messages) if m.queue == "x" and m.period >= 1000]
        if len(slow) >= 2 and rng.random() < 0.7:
            for k in slow:
                messages[k] = replace(messages[k], paced=Fraction(250), period=Fraction(1000), jitter=Fraction(0))
        if all(r is not None and r <= m.period for r, m in zip(response_times(messages, BUS), messages, strict=True)):
            return messages
        found = random_set(rng)


@pytest.mark.parametrize("seed", range(80))
def test_no_frame_of_a_plain_queue_is_later_than_the_bound(seed: int) -> None:
    rng = random.Random(seed)
    messages = queued_set(rng)
    bounds = times(messages)
    paced = [k for k, m in enumerate(messages) if m.paced is not None]
    for _ in range(6):
        tick = Fraction(rng.randrange(250))
        firsts = [
            tick + 250 * rng.randrange(4) if k in paced else Fraction(rng.choice([0, rng.randrange(int(m.period))]))
            for k, m in enumerate(messages)
        ]
        nominal = [periodic(m, first, Fraction(20_000)) for m, first in zip(messages, firsts, strict=True)]
        releases = [
            [t + rng.choice([0, int(m.jitter), rng.randint(0, int(m.jitter))]) for t in some]
            for m, some in zip(messages, nominal, strict=True)
        ]
        for k, handed in zip(paced, pace([nominal[k] for k in paced], Fraction(250), tick), strict=True):
            releases[k] = handed
        for message, left, due, bound in zip(messages, play(messages, releases, rng), nominal, bounds, strict=True):
            assert max(a - b for a, b in zip(left, due, strict=True)) <= bound, message

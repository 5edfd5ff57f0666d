"""`gustform hil faults`: twelve faults into the bridge of a rig, as a table or as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_cli.hil.rigs import rig_of
from gustform_hil.bench import Bench
from gustform_hil.bus import Bus
from gustform_hil.client import Client
from gustform_hil.codec import Codec
from gustform_hil.faults import LIMIT, Outcome, faults, inject, wrong_from_the_start
from gustform_hil.process import UNHURRIED, Bridge
from gustform_hil.rig_files import RigFiles

# Pauses of this computer in the bridge itself; what the bus may do is as strict as ever.
_LENIENT = ("--watchdog", "1000", "--deadlines", "100", "--quiet", "5")
_TRIES = 4  # of each fault, in real time


@contextmanager
def bench_of(rig: RigFiles, interface: str, clock: str = "sync", options: Sequence[str] = ()) -> Iterator[Bench]:
    """A bench with the rig's bridge, which ends with it."""
    options = (*(UNHURRIED if clock == "sync" else ()), *options)
    with Bus(interface, fd=rig.fd) as bus, Bridge(rig.bridge, interface, clock, options) as bridge:
        yield Bench(Client(bus, Codec(rig.messages)), rig.measurements, rig.set_points, bridge.check)


def run(interface: str, rig: Path | None, *, monotonic: bool = False) -> list[Outcome]:
    """All of them, one after the other into the same bridge. `monotonic`: at the pace of this computer's clock; the
    times are then wall times."""
    with rig_of(rig) as found:
        if monotonic:
            return _in_real_time(found, interface)
        with bench_of(found, interface) as bench:
            outcomes = [inject(bench, fault) for fault in faults(bench)]
        with bench_of(found, interface) as bench:
            never = wrong_from_the_start(bench)
    return [replace(o, violations=o.violations + never) if o.fault == "wrong_fingerprint" else o for o in outcomes]


def _in_real_time(rig: RigFiles, interface: str) -> list[Outcome]:
    """Each fault into a bridge of its own, again where Python was too slow to keep it running. GF8077: always."""
    done: list[Outcome] = []
    failure: GustformError | None = None
    number, tries = 0, 0
    while True:
        with bench_of(rig, interface, "monotonic", _LENIENT) as bench:
            twelve = faults(bench)
            if number == len(twelve):
                break
            try:
                outcome = inject(bench, twelve[number])
                done.append(replace(outcome, to_safe_ms=outcome.wall_ms))
            except GustformError as error:
                if error.code != "GF8077":
                    raise
                failure, tries = error, tries + 1
                if tries < _TRIES:
                    continue
                print(f"{twelve[number].name}: this computer is too slow to measure it", file=sys.stderr)
        number, tries = number + 1, 0
    if not done and failure is not None:
        hint = "a faster computer, Python has to send within a millisecond; or build/gust-latency of the rig"
        raise GustformError(failure.code, failure.message, hint=hint)
    return done


def good(outcomes: list[Outcome]) -> bool:
    """Every one as specified."""
    return all(one.good for one in outcomes)


def as_json(outcomes: list[Outcome]) -> str:
    """A list, one object for each fault."""
    return json.dumps([{**asdict(one), "good": one.good} for one in outcomes], indent=2)


def as_text(outcomes: list[Outcome], monotonic: bool = False) -> str:
    """A table."""
    lines = [f"{'fault':<20} {'detected':<9} {'to SAFE':>10} {'tolerated':<10} told by the bridge"]
    for one in outcomes:
        time = "" if one.to_safe_ms is None else f"{one.to_safe_ms:.3g} ms"
        yes = {True: "yes", False: "no"}
        lines.append(
            f"{one.fault:<20} {yes[one.detected]:<9} {time:>10} {yes[one.tolerated]:<10} {', '.join(one.faults)}"
        )
        lines += [f"    {text}" for text in one.violations]
    if monotonic:
        lines.append("wall time, from the first frame of the fault to the arrival of blocked references; not judged")
    else:
        lines.append(f"bus time, from the Sync before the fault; at most {LIMIT} periods")
    return "\n".join(lines)

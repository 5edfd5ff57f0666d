"""What hil/README.md says of faults beyond the twelve of `gustform hil faults`: to SAFE in the period they come in."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from gustform_cli.hil.faults import bench_of
from gustform_hil.bench import Bench
from gustform_hil.client import ConverterState, Values
from gustform_hil.faults import Fault, inject
from gustform_hil.message_set import Part
from gustform_hil.rig_files import RigFiles


def measure(bench: Bench, values: Values) -> None:
    sample = {**bench.measurements, **values, "sample": bench.converter.sample}
    bench.client.put(bench.client.frames(Part.MEASUREMENTS, sample, cut=False))


def out_of_range(bench: Bench, k: int) -> None:
    measure(bench, {"omega_r": 1000.0} if k == 0 else {})


def jump(bench: Bench, k: int) -> None:
    measure(bench, {"v_dc": 1.9} if k == 0 else {})  # of 2 pu: in its range, and 900 pu/s


def emergency_stop(bench: Bench, k: int) -> None:
    if k == 0:
        bench.operator.emergency_stop()
    measure(bench, {})


def trip(bench: Bench, k: int) -> None:
    if k in (0, 3):
        bench.converter.announce(ConverterState.TRIPPED if k == 0 else ConverterState.RUNNING)
    measure(bench, {})


@pytest.mark.parametrize(
    ("told", "send"),
    [("RANGE", out_of_range), ("PLAUSIBILITY", jump), ("EMERGENCY_STOP", emergency_stop), ("CONVERTER", trip)],
)
def test_at_once(rig: RigFiles, interface: str, told: str, send: Callable[[Bench, int], None]) -> None:
    with bench_of(rig, interface) as bench:
        outcome = inject(bench, Fault(told.lower(), told, send))
    assert (outcome.periods, outcome.violations) == (1, [])
    assert told in outcome.faults

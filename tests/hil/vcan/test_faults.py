"""Twelve faults into the bridge of a rig, on the sync clock: bus time is counted, so nothing depends on the machine."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from typer.testing import CliRunner

from gustform_cli.hil.faults import bench_of
from gustform_cli.main import app
from gustform_hil.faults import Outcome, faults, inject, wrong_from_the_start
from gustform_hil.rig_files import RigFiles

# Periods to SAFE. Counted from the Sync before the fault: 1 is at once; 3 follows from two samples that are tolerated.
# The bit that the bridge must tell, and that comes alone or with those that the fault brings along.
EXPECTED: dict[str, tuple[int | None, str]] = {
    "loss": (None, ""),
    "burst_loss": (3, "TIMEOUT"),
    "bit_flip": (3, "CRC"),
    "stale_repeat": (3, "STALE"),
    "counter_jump": (1, "COUNTER"),
    "nan_valid_crc": (1, "NOT_FINITE"),
    "wrong_length": (3, "LENGTH"),
    "masquerade": (1, "MASQUERADE"),
    "delay": (3, "STALE"),
    "bus_off_frame": (1, "BUS_OFF"),
    "wrong_fingerprint": (1, "FINGERPRINT"),
    "enobufs_flood": (1, "SEND"),
}
FaultsOf = Callable[[str], dict[str, Outcome]]


@pytest.fixture(scope="module")
def outcomes_of(rig_for: Callable[[str], RigFiles], interface: str) -> FaultsOf:
    done: dict[str, dict[str, Outcome]] = {}

    def outcomes(bus: str) -> dict[str, Outcome]:
        if bus not in done:
            with bench_of(rig_for(bus), interface) as bench:
                done[bus] = {fault.name: inject(bench, fault) for fault in faults(bench)}
        return done[bus]

    return outcomes


@pytest.mark.parametrize("bus", ["fd", "classic"])
@pytest.mark.parametrize("fault", EXPECTED)
def test_each_leads_to_safe_in_time_or_is_tolerated(outcomes_of: FaultsOf, bus: str, fault: str) -> None:
    outcome = outcomes_of(bus)[fault]
    periods, told = EXPECTED[fault]
    if bus == "classic" and fault == "nan_valid_crc":
        told = "RANGE"  # integers have no NaN
    assert outcome.violations == []
    assert outcome.detected
    assert outcome.tolerated == (periods is None)
    assert outcome.periods == periods
    assert told == "" or told in outcome.faults
    assert outcome.good


def test_all_twelve_are_there(outcomes_of: FaultsOf) -> None:
    assert list(outcomes_of("fd")) == list(EXPECTED)
    assert len(EXPECTED) == 12


@pytest.mark.parametrize("bus", ["fd", "classic"])
def test_another_database_never_gets_ready(rig_for: Callable[[str], RigFiles], interface: str, bus: str) -> None:
    with bench_of(rig_for(bus), interface) as bench:
        assert wrong_from_the_start(bench) == []


@pytest.mark.parametrize(("fault", "periods"), [("burst_loss", 5), ("bit_flip", 5), ("counter_jump", 1)])
def test_a_bridge_that_tolerates_more_is_found_out(rig: RigFiles, interface: str, fault: str, periods: int) -> None:
    with bench_of(rig, interface, options=("--missing", "4")) as bench:
        outcome = inject(bench, next(one for one in faults(bench) if one.name == fault))
    assert outcome.periods == periods
    assert outcome.good == (periods <= 3)


def test_the_command_prints_them(rig: RigFiles, interface: str) -> None:
    done = CliRunner().invoke(app, ["hil", "faults", "--interface", interface, "--rig", str(rig.folder), "--json"])
    assert done.exit_code == 0, done.output
    printed = json.loads(done.stdout)
    assert [one["fault"] for one in printed] == list(EXPECTED)
    for one in printed:
        assert {"fault", "detected", "to_safe_ms", "tolerated"} <= one.keys()
        assert one["tolerated"] == (one["to_safe_ms"] is None)
        assert one["tolerated"] or one["to_safe_ms"] <= 3.0  # the FD set has periods of 1 ms

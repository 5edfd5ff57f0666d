"""The operator's buttons from the command line: each press is a process of its own, as on a bench."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from gustform_cli.hil.faults import bench_of
from gustform_cli.main import app
from gustform_hil.bench import Bench
from gustform_hil.client import ConverterState
from gustform_hil.rig_files import RigFiles


def press(button: str, interface: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["hil", "operate", button, "--interface", interface, "--json"])
    return done.exit_code, json.loads(done.stdout)["state"] if done.exit_code == 0 else done.stderr


@contextmanager
def converter(bench: Bench) -> Iterator[None]:
    """Periods go by while somebody presses buttons."""
    end = threading.Event()

    def periods() -> None:
        while not end.is_set():
            bench.tick()

    thread = threading.Thread(target=periods)
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()


@pytest.mark.timeout(120)
def test_from_ready_to_safe_and_back(rig: RigFiles, interface: str) -> None:
    with bench_of(rig, interface) as bench:
        bench.ticks(60)
        bench.converter.announce(ConverterState.READY)
        with converter(bench):
            assert press("status", interface) == (0, "READY")
            assert press("start", interface) == (0, "RUN")
            assert press("stop", interface) == (0, "READY")
            assert press("start", interface) == (0, "RUN")
            assert press("emergency-stop", interface) == (0, "SAFE")
            code, text = press("start", interface)
            assert (code, "GF8140" in text, "EMERGENCY_STOP" in text) == (1, True, True)
            assert text.rstrip().endswith("try gustform hil operate reset")
            assert press("reset", interface)[1] in ("INIT", "READY")
    assert bench.violations == []


def test_nobody_there(interface: str) -> None:
    done = CliRunner().invoke(app, ["hil", "operate", "start", "--interface", interface, "--patience", "0.3"])
    assert done.exit_code == 1
    assert "GF8141" in done.stderr

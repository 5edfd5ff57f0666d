"""Programs in C on both ends of the bus: gust-bridge --role plant with a model, and gust-latency."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gustform_cli.hil.rigs import SCENARIO
from gustform_hil.bus import Bus
from gustform_hil.client import Client, Command, Operator
from gustform_hil.codec import Codec
from gustform_hil.locate import bridge_folder
from gustform_hil.process import UNHURRIED, Bridge
from gustform_hil.rig_files import RigFiles
from gustform_runtime.locate import include_dir
from tests.support.waiting import PATIENCE, wait_for

SECONDS = 3.0  # of running, some thousand samples
SAMPLES = 100  # that even a busy machine makes of them


@pytest.fixture(scope="module")
def programs(rig: RigFiles, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bridge's own CMakeLists.txt, with controller and messages of the rig and the installed libgustform."""
    build = tmp_path_factory.mktemp("programs")
    prefix = json.loads((rig.folder / "rig.json").read_text())["prefix"]
    configured = [
        "cmake",
        "-S",
        str(bridge_folder()),
        "-B",
        str(build),
        "-DGUST_BRIDGE_PLANT=ON",
        "-DCMAKE_BUILD_TYPE=Debug",
    ]
    configured += [f"-DGUST_BRIDGE_CONTROLLER={rig.folder / 'controller'}", f"-DGUST_BRIDGE_PREFIX={prefix}"]
    configured += [f"-DGUST_BRIDGE_MESSAGES={rig.folder / 'messages'}"]
    configured += ["-DGUST_BRIDGE_PLANT=ON", f"-DGUST_BRIDGE_RUNTIME={include_dir().parent}"]
    for command in (configured, ["cmake", "--build", str(build), "--target", "gust-bridge", "gust-latency"]):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return build


@pytest.fixture
def bridge(rig: RigFiles, interface: str) -> Iterator[Bridge]:
    with Bridge(rig.bridge, interface, "sync", UNHURRIED) as running:
        yield running


def told(bridge: Bridge, state: str) -> bool:
    return any(event["event"] == "state" and event["state"] == state for event in list(bridge.events))


def test_plant_and_controller_in_lock_step(
    programs: Path, rig: RigFiles, bridge: Bridge, interface: str, tmp_path: Path
) -> None:
    model = tmp_path / "wt.gust"
    built = [sys.executable, "-m", "gustform_cli", "check", str(SCENARIO), "--model", str(model)]
    subprocess.run([*built, "--set", "wt.control.sampled=1ms"], check=True, capture_output=True)
    command = [str(programs / "gust-bridge"), "--interface", interface, "--role", "plant", "--clock", "sync"]
    with Bus(interface, fd=rig.fd, only=[]) as bus:
        operator = Operator(Client(bus, Codec(rig.messages)))
        plant = subprocess.Popen(
            [*command, "--patience", "20000", "--model", str(model)], stdout=subprocess.PIPE, text=True
        )
        try:
            wait_for(lambda: told(bridge, "READY"))
            operator.press(Command.START)
            wait_for(lambda: told(bridge, "RUN"))
            time.sleep(SECONDS)
        finally:
            plant.terminate()
            lines = [json.loads(line) for line in plant.communicate(timeout=PATIENCE)[0].splitlines()]
    assert plant.returncode == 0
    end = lines[-1]
    assert end["answers"] == end["samples"]  # every sample was answered, and in its own period
    assert end["trips"] == end["lost"] == end["not_sent"] == 0
    assert end["time"] == pytest.approx((end["samples"] - 1) * 1e-3, abs=1.5e-3)  # s
    assert [line["state"] for line in lines if line["event"] == "converter"][-1] == "RUNNING"
    assert bridge.stop() == 0
    assert not told(bridge, "SAFE")
    assert bridge.events[-1]["steps"] >= SAMPLES
    assert bridge.events[-1]["held"] == 0


def test_latency(programs: Path, bridge: Bridge, interface: str) -> None:
    """It measures; how long it takes is the business of the computer."""
    command = [str(programs / "gust-latency"), interface, "200", "2"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert 0 < found["response_us"]["n"] <= 200
    assert {name: times["n"] for name, times in found["to_safe_us"].items()} == {
        "emergency stop": 2,
        "bus-off": 2,
        "loss": 2,
        "bad CRC": 2,
    }
    assert bridge.stop() == 0  # it has said everything
    faults = {fault for event in bridge.events for fault in event.get("faults", ())}
    assert {"EMERGENCY_STOP", "BUS_OFF", "TIMEOUT", "CRC"} <= faults


def test_a_bridge_without_plant_says_so(rig: RigFiles, interface: str) -> None:
    command = [str(rig.bridge), "--interface", interface, "--role", "plant"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "GF8056" in run.stderr

"""A log against a result: the log is made of the result here, and then changed."""

from __future__ import annotations

import json
from pathlib import Path

import can
import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from gustform.language.errors import GustformError
from gustform_cli.hil.compare import compare, parse_tolerances
from gustform_cli.hil.rigs import SCENARIO
from gustform_cli.interrupt import Interrupt
from gustform_cli.main import app
from gustform_cli.run_data import RunData
from gustform_cli.simulate import simulate
from gustform_hil.client import Client, Frame
from gustform_hil.codec import Codec
from gustform_hil.database import shipped
from gustform_hil.log import Log
from gustform_hil.message_set import Part
from gustform_hil.trace import read_trace

FIRST = 17  # sample at time 0
SETTINGS = [
    *("run.until=0.2s", "events.0.at=0.1s", "output.every=1ms", "output.precision=float64"),
    *("wt.control.sampled=1ms", "wt.control.delay=1"),
]
READ = {"v_dc": "wt.v_dc", "omega_r": "wt.omega_r", "P_pmsg": "wt.P_pmsg", "Q_gsc": "wt.Q_gsc", "Q_msc": "wt.Q_msc"}
COMMANDED = {"omega_gsc": "wt.omega_gsc", "V_gsc": "wt.control.V_gsc", "V_msc": "wt.control.V_msc"}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulate(SCENARIO, tmp_path_factory.mktemp("run"), SETTINGS, Interrupt(), figure=False).result


def log_of(result: Path, file: Path, *, changed: dict[str, float] | None = None, delay: int = 1) -> Path:
    """What a bus would have carried; `changed` adds to a quantity in sample 150."""
    with RunData(result, every_row=True) as run:
        aliases = run.json("aliases")
        rows = len(run.time)

        def column(channel: str) -> list[float]:
            found, sign = aliases.get(channel, (channel, 1))
            return [float(v) for v in sign * run.curve(found).values]

        read = {name: column(channel) for name, channel in READ.items()}
        commanded = {name: column(channel) for name, channel in COMMANDED.items()}
    client = Client(None, Codec(shipped("fd")))  # type: ignore[arg-type]  # nothing is sent
    with Log(file) as log:
        log(message(client.frames(Part.SYNC, {"sample": FIRST - 1})[0], 0.0))
        for k in range(rows - 1 - delay):
            added = {name: more for name, more in (changed or {}).items() if k == 150}
            measured = {name: values[k] + added.get(name, 0.0) for name, values in read.items()}
            # A row has what held before its instant, so what sample k commanded is in row k + 1 + delay.
            commands = {name: values[k + 1 + delay] + added.get(name, 0.0) for name, values in commanded.items()}
            frames = client.frames(Part.MEASUREMENTS, {**measured, "sample": FIRST + k})
            frames += client.frames(Part.SYNC, {"sample": FIRST + k})
            frames += client.frames(Part.REFERENCES, {**commands, "enable": 1.0, "sample": FIRST + k})
            for one in frames:
                log(message(one, k * 1e-3))
    return file


def message(frame: Frame, seconds: float) -> can.Message:
    return can.Message(
        timestamp=seconds,
        arbitration_id=frame.identifier,
        data=frame.data,
        is_fd=True,
        is_extended_id=False,
        channel="vcan0",
    )


def test_the_same_is_the_same(result: Path, tmp_path: Path) -> None:
    trace = read_trace(log_of(result, tmp_path / "bus.log"), Codec(shipped("fd")))
    with RunData(result, every_row=True) as run:
        found = compare(trace, run, "wt")
    by_name = {pair.compared.quantity: pair.compared for pair in found.pairs}
    for name in (*READ, *COMMANDED):
        assert by_name[name].points > 190
        assert by_name[name].largest < 1.2e-7, name  # float32 of values around 1
    assert found.lost == 0
    # Used by the control, so compared although the log here has the safe values only.
    assert not by_name["beta_ref"].good


@pytest.mark.parametrize(("name", "by"), [("v_dc", 0.002), ("P_pmsg", -0.01), ("V_gsc", 0.0015), ("omega_gsc", 0.01)])
def test_one_wrong_sample_is_found(result: Path, tmp_path: Path, name: str, by: float) -> None:
    trace = read_trace(log_of(result, tmp_path / "bus.log", changed={name: by}), Codec(shipped("fd")))
    with RunData(result, every_row=True) as run:
        found = compare(trace, run, "wt")
        one = next(pair.compared for pair in found.pairs if pair.compared.quantity == name)
        assert not one.good
        assert one.largest == pytest.approx(abs(by), abs=2e-7)
        assert one.at == pytest.approx(0.150 if name in READ else 0.152, abs=1e-6)
        wide = compare(trace, run, "wt", [f"{name}={1.1 * abs(by)}"])
    assert next(pair.compared for pair in wide.pairs if pair.compared.quantity == name).good


def test_a_command_that_acts_a_sample_early_is_found(result: Path, tmp_path: Path) -> None:
    trace = read_trace(log_of(result, tmp_path / "bus.log", delay=0), Codec(shipped("fd")))
    with RunData(result, every_row=True) as run:
        found = {pair.compared.quantity: pair.compared for pair in compare(trace, run, "wt", ["1e-6"]).pairs}
    assert not found["omega_gsc"].good  # it moves by 1e-3 in a sample after the step


def test_the_command(result: Path, tmp_path: Path) -> None:
    log = log_of(result, tmp_path / "bus.log")
    figure = tmp_path / "differences.png"
    wide = [word for name in ("beta_ref", "omega_msc") for word in ("--tolerance", f"{name}=100")]
    words = ["hil", "compare", str(log), str(result), "--out", str(figure), "--json", *wide]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    printed = json.loads(done.stdout)
    assert printed["good"] is True
    assert printed["figure"] == str(figure)
    assert figure.read_bytes().startswith(b"\x89PNG")
    narrow = CliRunner().invoke(app, ["hil", "compare", str(log), str(result), *wide, "--tolerance", "v_dc=1e-12"])
    assert narrow.exit_code == 1
    assert "BEYOND" in narrow.stdout


def test_tolerances() -> None:
    assert parse_tolerances(["1e-2", "beta_ref=0.5"]) == (1e-2, {"beta_ref": 0.5})
    for wrong in ("", "x", "=1", "v_dc=", "-1", "v_dc=nan", "inf"):
        with pytest.raises(GustformError, match="GF8081"):
            parse_tolerances([wrong])


def test_what_cannot_be_compared(result: Path, tmp_path: Path) -> None:
    trace = read_trace(log_of(result, tmp_path / "bus.log"), Codec(shipped("fd")))
    with RunData(result, every_row=True) as run:
        with pytest.raises(GustformError, match=r"GF8081.*v_cd"):
            compare(trace, run, "wt", ["v_cd=1"])
        with pytest.raises(GustformError, match="GF8080"):
            compare(trace, run, "other")
    empty = tmp_path / "empty.log"
    empty.write_text("")
    with RunData(result, every_row=True) as run, pytest.raises(GustformError, match=r"GF8080.*never started"):
        compare(read_trace(empty, Codec(shipped("fd"))), run, "wt")


def test_a_result_has_all_rows_where_they_are_asked_for(result: Path) -> None:
    with h5py.File(result) as file, RunData(result, every_row=True) as run:
        assert np.array_equal(file["time"][()], run.time)

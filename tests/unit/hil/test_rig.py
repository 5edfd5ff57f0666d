"""Rigs: each control behind the bus compiles from its folder alone, and a folder that is none is left as it is."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from gustform.language.errors import GustformError
from gustform_cli.export import controls, default_block
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.folder import default_prefix
from gustform_codegen.emit.controller.program import program
from gustform_hil.database import load_message_set, shipped_files
from gustform_hil.rig import Rig, check, compile_rig, period, write_rig

ROOT = Path(__file__).resolve().parents[3]
LOAD_STEP = ROOT / "cli" / "gustform_cli" / "scenarios" / "load_step_8ms.yaml"


def rig(control: str = "DualPort", bus: str = "fd", seconds: float | None = None) -> Rig:
    database, mapping = shipped_files(bus)
    messages = load_message_set(database, mapping)
    made = program(discretise(default_block(control), period(messages) if seconds is None else seconds))
    return Rig(made, default_prefix(control), messages, database, mapping, {"scenario": "none", "turbine": "wt"})


def run(*command: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """With these variables and no others."""
    return subprocess.run(command, capture_output=True, text=True, timeout=240, env=variables, check=False)


@pytest.mark.parametrize(("control", "bus"), [*((name, "fd") for name in controls()), ("DualPort", "classic")])
def test_every_control_compiles_behind_the_bus(
    control: str, bus: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CMAKE_BUILD_TYPE", "Debug")  # twice as fast
    write_rig(rig(control, bus), tmp_path / "rig")
    bridge = compile_rig(tmp_path / "rig")
    assert "--interface" in run(bridge, "--help").stdout
    nowhere = run(bridge, "--interface", "nowhere0")
    # That it says so means that the controller's signals were all found in the messages.
    assert nowhere.returncode == 1
    assert "GF806" in nowhere.stderr


def test_a_rig_that_was_moved_needs_cmake_and_a_compiler(tmp_path: Path) -> None:
    write_rig(rig(), tmp_path / "here")
    shutil.move(tmp_path / "here", tmp_path / "there")
    there = tmp_path / "there"
    path = os.pathsep.join(sorted({str(Path(shutil.which(name) or "").parent) for name in ("cmake", "cc", "make")}))
    for arguments in (["-S", str(there), "-B", str(there / "build")], ["--build", str(there / "build")]):
        done = run(shutil.which("cmake") or "cmake", *arguments, PATH=path, CMAKE_BUILD_TYPE="Debug")
        assert done.returncode == 0, done.stdout + done.stderr
    assert "--interface" in run(there / "build" / "gust-bridge", "--help").stdout


def test_the_same_bytes_each_time(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_rig(rig(), tmp_path / name)
    files = {p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file()}
    assert files == {p.relative_to(tmp_path / "b") for p in (tmp_path / "b").rglob("*") if p.is_file()}
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file
    described = json.loads((tmp_path / "a" / "rig.json").read_text())
    assert set(described["files"]) | {"rig.json"} == {file.as_posix() for file in files}
    assert set(described["versions"]) == {"gustform", "casadi", "cantools"}
    assert described["fingerprint"] == f"0x{rig().messages.fingerprint:08x}"


# ---- What is left as it is ------------------------------------------------------------------------------------------


def test_a_folder_that_is_no_rig_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    (tmp_path / "rig.json").write_text('{"kind": "something else"}')
    with pytest.raises(GustformError, match="GF8130"):
        write_rig(rig(), tmp_path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["rig.json", "thesis.tex"]
    file = tmp_path / "thesis.tex"
    with pytest.raises(GustformError, match="GF8130"):
        write_rig(rig(), file)


def test_a_second_build_takes_its_own_files_away_and_no_others(tmp_path: Path) -> None:
    out = tmp_path / "rig"
    write_rig(rig("DualPort"), out)
    (out / "notes.txt").write_text("scope settings")
    (tmp_path / "outside.txt").write_text("not ours")
    described = json.loads((out / "rig.json").read_text())
    described["files"] |= {"../outside.txt": "", str(tmp_path / "outside.txt"): "", "controller/gone.c": ""}
    (out / "rig.json").write_text(json.dumps(described))
    write_rig(rig("Droop"), out)
    assert not (out / "controller" / "dual_port.c").exists()
    assert (out / "controller" / "droop.c").exists()
    assert (out / "notes.txt").exists()
    assert (tmp_path / "outside.txt").exists()


def test_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match=r"GF8132: the controller's period, 2 ms, .*_fd, 1 ms"):
        write_rig(rig(seconds=2e-3), tmp_path / "rig")
    assert not (tmp_path / "rig").exists()


def test_a_signal_that_no_message_carries_is_named(tmp_path: Path) -> None:
    database, mapping = shipped_files("fd")
    poor = tmp_path / "mapping.yaml"
    poor.write_text("\n".join(line for line in mapping.read_text().splitlines() if "omega_msc" not in line) + "\n")
    with pytest.raises(GustformError, match="GF8131: omega_msc, an output of DualPort"):
        check(Rig(rig().controller, "dual_port", load_message_set(database, poor), database, poor, {}))


# ---- The command ----------------------------------------------------------------------------------------------------


def build(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gustform_cli", "hil", "build", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)


def test_the_command_takes_the_turbine_of_a_scenario(tmp_path: Path) -> None:
    gain = "components.wt.control.K_gsc=0.4"
    done = build(LOAD_STEP, "--out", tmp_path / "rig", "--no-compile", "--json", "--set", gain)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (told["control"], told["turbine"], told["period_s"], told["program"]) == ("DualPort", "wt", 1e-3, None)
    assert told["scenario_sha256"] == sha256(LOAD_STEP.read_bytes()).hexdigest()
    assert told["set"] == [gain]
    described = json.loads((tmp_path / "rig" / "controller" / "dual_port.json").read_text())
    assert {p["name"]: p["default"] for p in described["parameters"]}["K_gsc"] == 0.4
    # Known before there is a controller: the messages do not fit these rates.
    slow: list[str | Path] = ["--out", tmp_path / "late", "--no-compile", "--data-bitrate", "2M"]
    over = build(LOAD_STEP, *slow, "--bitrate", "250k")
    assert (over.returncode, "GF8121" in over.stderr) == (1, True)
    # They would, if the bridge's interface sorted its frames.
    late = build(LOAD_STEP, *slow)
    assert (late.returncode, "GF8122: References" in late.stderr) == (1, True)
    assert not (tmp_path / "late").exists()
    assert build(LOAD_STEP, *slow, "--allow-overload").returncode == 0


@pytest.mark.parametrize(
    ("arguments", "code", "exit_code"),
    [(("--dbc", "x.dbc"), "GF8135", 2), (("--bitrate", "fast"), "GF8120", 2), (("--turbine", "nobody"), "GF2047", 2)],
)
def test_what_the_command_refuses(arguments: tuple[str, ...], code: str, exit_code: int, tmp_path: Path) -> None:
    done = build(LOAD_STEP, "--out", tmp_path / "rig", "--no-compile", *arguments)
    assert (done.returncode, code in done.stderr) == (exit_code, True), done.stderr
    assert not (tmp_path / "rig").exists()

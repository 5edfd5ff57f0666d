"""`gustform export controller`: from a name or a scenario to a folder, and what it says when it cannot."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
LOAD_STEP = ROOT / "cli" / "gustform_cli" / "scenarios" / "load_step_8ms.yaml"


def export(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gustform_cli", "export", "controller", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def test_a_control_by_its_name(tmp_path: Path) -> None:
    options = ["--real", "double", "--period", "500 us", "--prefix", "gfl", "--report"]
    done = export("GridFollowing", "--out", "rig", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("rig")
    assert "v_q         omega_gsc" in done.stdout
    assert {file.name for file in (tmp_path / "rig").iterdir()} == {
        "gfl.c", "gfl.h", "gfl.json", "gfl.a2l", "test_gfl.c", "vectors.h",
        "gust_controller.h", "gfl_interface.h", "gfl_interface.c", "CMakeLists.txt", "README.md",
        "frequency.csv", "footprint.json",
    }  # fmt: skip
    found = json.loads((tmp_path / "rig" / "gfl.json").read_text())
    assert (found["period_s"], found["real"], found["name"]) == (5e-4, "double", "gfl")
    assert "#define GFL_DOUBLE 1" in (tmp_path / "rig" / "gfl.h").read_text()


def test_memory_is_printed_and_kept(tmp_path: Path) -> None:
    """The limits are those of a bench controller on a Cortex-M4F: frames of 256 bytes, 5 kB of text, no data."""
    done = export("DualPort", "--out", "rig", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = {f["target"]: f for f in json.loads((tmp_path / "rig" / "footprint.json").read_text())}
    assert set(found) == {"host", "Cortex-M4F"}  # both compilers are of the set-up
    for one in found.values():
        assert one["compiler"] in done.stdout
        assert f"{one['chain_bytes']}  {' > '.join(one['chain'])}" in done.stdout
        assert (one["data"], one["bss"], one["context"]) == (0, 0, 288)
        assert set(one["chain"]) <= set(one["frames"])
        assert max(one["frames"].values()) <= one["chain_bytes"] <= sum(one["frames"].values())
    small = found["Cortex-M4F"]
    assert small["text"] <= 5000
    assert 0 < max(small["frames"].values()) <= 256
    assert set(small["library"]) <= {"memcpy", "memset", "floorf"}


@pytest.mark.parametrize("method", ["tustin", "euler", "zoh"])
def test_the_method_is_in_the_folder_and_in_its_report(method: str, tmp_path: Path) -> None:
    done = export("DualPort", "--out", "rig", "--method", method, "--report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"DualPort, {method} at 0.001 s" in done.stdout
    assert json.loads((tmp_path / "rig" / "dual_port.json").read_text())["method"] == method
    error = float(
        next(line for line in done.stdout.splitlines() if line.startswith("v_dc        omega_gsc")).split()[2]
    )
    bound = {"tustin": (1e-3, 2e-3), "euler": (3e-2, 5e-2), "zoh": (8e-2, 1.5e-1)}[method]  # docs/export.md
    assert bound[0] < error < bound[1]
    lines = (tmp_path / "rig" / "frequency.csv").read_text().splitlines()
    assert lines[0].startswith("input,output,frequency_hz,gain")
    assert len(lines) > 8 * 20


def test_without_a_compiler_there_is_a_folder_all_the_same(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gustform_cli", "export", "controller", "Matching", "--out", "rig"]
    bare = {**os.environ, "PATH": str(tmp_path)}
    bare.pop("CC", None)
    done = subprocess.run(command, cwd=tmp_path, env=bare, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "not measured" in done.stdout
    assert (tmp_path / "rig" / "matching.c").exists()
    assert not (tmp_path / "rig" / "footprint.json").exists()


def test_a_turbine_of_a_scenario_begins_in_its_steady_state(tmp_path: Path) -> None:
    done = export("wt", str(LOAD_STEP), "--out", "rig", "--set", "components.wt.control.K_gsc=0.4", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "rig" / "dual_port.json").read_text())
    value = {p["name"]: p["default"] for p in found["parameters"]}
    assert value["K_gsc"] == 0.4
    # Found by the steady state: V* of the machine side keeps Q_msc = 0, Q* of the grid side what is delivered.
    assert 0.9 < value["msc_V_ref"] < 1.0
    state = {s["name"]: s["start"] for s in found["states"]}
    assert value["gsc_Q_ref"] == state["gsc_Q_filtered"] != 0.0
    assert state["gsc_xi"] == 0.0


def test_a_curtailment_schedule_is_exported_with_its_tables(tmp_path: Path) -> None:
    chosen = ["--set", "components.wt.schedule={type: CurtailmentSchedule}"]
    done = export("wt", str(LOAD_STEP), "--out", "rig", *chosen, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "rig" / "dual_port.json").read_text())
    inputs = {s["name"] for s in found["inputs"]}
    assert "wind" in inputs
    assert inputs.isdisjoint({"omega_del", "beta_del"})
    assert {s["name"]: s["start"] for s in found["states"]}["schedule_v"] == 8.0
    assert {p["name"]: p["default"] for p in found["parameters"]}["schedule_curtailment"] == 0.1
    tables = {t["name"]: t for t in found["tables"]}
    assert set(tables) == {"schedule_omega_table", "schedule_beta_table"}
    assert tables["schedule_omega_table"]["x"] == [3.0, 25.0]  # cut-in to cut-out
    assert "schedule_omega_table" in (tmp_path / "rig" / "README.md").read_text()
    memory = json.loads((tmp_path / "rig" / "footprint.json").read_text())
    assert all((m["data"], m["bss"]) == (0, 0) for m in memory)
    assert [m["c"] for m in found["monitors"]] == ["mon.omega_del", "mon.beta_del"]
    a2l = (tmp_path / "rig" / "dual_port.a2l").read_text()
    header = (tmp_path / "rig" / "dual_port.h").read_text()
    assert "MEASUREMENT mon.omega_del" in a2l
    assert "dual_port_monitors mon;" in header
    outside = ["--set", "components.wt.schedule={type: CurtailmentSchedule, location: outside}"]
    for words in (["--no-schedule", *chosen], outside):
        done = export("wt", str(LOAD_STEP), "--out", "bare", *words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        bare = json.loads((tmp_path / "bare" / "dual_port.json").read_text())
        assert {"omega_del", "beta_del"} <= {s["name"] for s in bare["inputs"]}
        assert bare["tables"] == bare["monitors"] == []
    done = export("wt", str(LOAD_STEP), "--out", "with", "--schedule", *outside, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "with" / "dual_port.json").read_text()) == found


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("DualPorts",), "GF2070"),
        (("PmsgTurbine",), "GF2070"),
        (("DualPort", "--period", "0"), "GF2070"),
        (("DualPort", "--period", "5 s"), "GF2070"),
        (("DualPort", "--period", "5 V"), "GF2302"),
        (("DualPort", "--prefix", "9x"), "GF2071"),
        (("DualPort", "--set", "a=1"), "GF2070"),
        (("nobody", str(LOAD_STEP)), "GF2047"),
    ],
)
def test_what_cannot_be_exported_is_said_in_one_line(arguments: tuple[str, ...], code: str, tmp_path: Path) -> None:
    done = export(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert f"error {code}" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = export("Matching", "--out", "file", cwd=tmp_path)
    assert done.returncode == 2
    assert "error GF7001" in done.stderr

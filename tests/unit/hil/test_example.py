"""hil/examples: a C program that links an exported folder alone, by CMake and by make, in C and in C++."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gustform_codegen.emit.controller.folder import WARNINGS, write_folder
from tests.support.controller import program_of

EXAMPLES = Path(__file__).resolve().parents[3] / "hil" / "examples"
STRICT = f"-O2 {WARNINGS}"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """The example and the exported folder, and nothing of gustform near them."""
    shutil.copytree(EXAMPLES, tmp_path / "example")
    write_folder(program_of("DualPort"), "dual_port", False, tmp_path / "controller")
    return tmp_path / "example"


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    bare = {"PATH": os.environ["PATH"], "LC_ALL": "C"}
    return subprocess.run(command, cwd=folder, env=bare, capture_output=True, text=True, check=False, timeout=120)


def check(program: Path) -> None:
    done = run([str(program)], program.parent)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split() for line in done.stdout.splitlines() if re.match(r" *\d+\.\d\d  ", line)]
    before, after = (next(row for row in rows if row[0] == time) for time in ("10.00", "27.50"))
    assert (float(before[1]), float(before[2])) == pytest.approx((50.0, 1.0), abs=1e-3)
    assert 49.7 < float(after[1]) < 49.8  # 0.5 pu of load on a governor of 100 pu, less what the wind gives
    assert float(after[3]) < 0.97  # rotor slower
    assert float(after[4]) > float(before[4]) + 0.03  # and more power from the wind
    assert "20 samples rejected" in done.stdout
    assert "frequency/DC voltage = 0.5000" in done.stdout
    assert "rotor/DC voltage = 15.000" in done.stdout


@pytest.mark.parametrize("compiler", ["cc", "clang", "c++ -x c++"])
def test_it_is_built_by_make(compiler: str, place: Path) -> None:
    if compiler == "clang" and shutil.which("clang") is None:
        compiler = "gcc"
    done = run(["make", "CONTROLLER=../controller", f"CC={compiler}", f"CFLAGS={STRICT}"], place)
    assert done.returncode == 0, done.stderr
    check(place / "toy_loop")
    linked = run(["ldd", str(place / "toy_loop")], place).stdout
    names = {line.split()[0].partition(".")[0].rpartition("/")[2] for line in linked.splitlines()}
    assert names <= {"linux-vdso", "libm", "libc", "ld-linux-x86-64", "ld-linux-aarch64", "libstdc++", "libgcc_s"}


def test_it_is_built_by_cmake(place: Path) -> None:
    for command in (["cmake", "-S", ".", "-B", "build", "-DCONTROLLER=../controller"], ["cmake", "--build", "build"]):
        done = run(command, place)
        assert done.returncode == 0, done.stdout + done.stderr
    check(place / "build" / "toy_loop")

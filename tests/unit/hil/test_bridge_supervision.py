"""The supervision of the bridge: its unit tests reach every line of it and catch what goes wrong in it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

BRIDGE = Path(__file__).resolve().parents[3] / "hil" / "bridge"
MUTATE = BRIDGE / "tests" / "mutate.py"


def test_every_line_is_covered(tmp_path: Path) -> None:
    gcov = shutil.which("gcov")
    assert gcov is not None, "gcov is missing: apt-get install gcc"
    sources = [str(BRIDGE / "tests" / "test_supervision.c"), str(BRIDGE / "src" / "supervision.c")]
    compiled = ["gcc", "-std=c11", "-O0", "--coverage", f"-I{BRIDGE / 'include'}", *sources, "-lcmocka", "-lm"]
    subprocess.run([*compiled, "-o", "test"], cwd=tmp_path, check=True)
    subprocess.run([str(tmp_path / "test")], cwd=tmp_path, check=True, capture_output=True)
    (notes,) = (path for path in tmp_path.glob("*.gcno") if "test_supervision" not in path.name)
    printed = subprocess.run(
        [gcov, "--json-format", "--stdout", notes.name], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    (covered,) = (file for file in json.loads(printed)["files"] if Path(file["file"]).name == "supervision.c")
    lines = {line["line_number"]: line["count"] for line in covered["lines"]}
    assert len(lines) > 100  # the file has some 120 lines of code
    assert [number for number, count in lines.items() if count == 0] == []


def test_mutants_are_caught() -> None:
    """A fifth of them; `make mutate` runs all."""
    run = subprocess.run(
        [sys.executable, str(MUTATE), "--sample", "64", "--json"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    figures = json.loads(run.stdout)
    assert figures["mutants"] == 64
    assert figures["caught"] + figures["equivalent"] == 64
    assert figures["survived"] == figures["not_compiled"] == 0


def test_a_surviving_mutant_is_told(tmp_path: Path) -> None:
    """With a test that tests nothing every mutant survives, and the script says so."""
    folder = tmp_path / "bridge"
    shutil.copytree(BRIDGE / "include", folder / "include")
    for name in ("src", "tests"):
        (folder / name).mkdir()
    shutil.copy(BRIDGE / "src" / "supervision.c", folder / "src")
    shutil.copy(MUTATE, folder / "tests")
    (folder / "tests" / "test_supervision.c").write_text("int main(void)\n{\n    return 0;\n}\n")
    run = subprocess.run(
        [sys.executable, str(folder / "tests" / "mutate.py"), "--sample", "3"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 1
    assert run.stderr.count("survived: supervision.c:") == 3
    assert "survived 3" in run.stdout

"""Exported controllers on emulated Cortex-M boards: the bits of this computer, instructions, memory; a short run.

`make pil` runs all controllers over 4,000 samples of the closed loop. Here one does over the jump of the load.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gustform_hil.pil as pil
from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.footprint import CORTEX
from gustform_codegen.emit.controller.vectors import input_sequence
from gustform_codegen.toolchain import find_compiler
from gustform_hil.locate import pil_folder
from tests.support.controller import program_of


def test_dual_port_control_is_small_and_exact_on_both_boards(tmp_path: Path) -> None:
    """Limits of the bench: issue 5. The samples are those of the closed loop from 0.1 s before the load step on."""
    command = [sys.executable, "-m", "gustform_cli", "hil", "pil", "--control", "DualPort", "--out", "pil.json"]
    done = subprocess.run(
        [*command, "--begin", "29.9", "--samples", "300"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = {(m["board"], m["real"]): m for m in json.loads((tmp_path / "pil.json").read_text())}
    assert set(found) == {(board, real) for board in ("Cortex-M4F", "Cortex-M7") for real in ("float", "double")}
    assert all(m["equal"] and m["samples"] == 300 and m["errors"] == 0 for m in found.values())
    for m in found.values():
        assert (m["data"], m["bss"]) == (0, 0)
        assert 0 < m["stack"] <= m["chain"] + 128  # the library's sqrt, floor and soft double are not in the chain
    small = found["Cortex-M4F", "float"]
    assert small["instructions_max"] <= 1000
    assert small["instructions_max"] <= 1.05 * small["instructions_min"]
    assert small["linked"] <= 5000
    assert small["frame"] <= 256
    assert small["context"] <= 512
    assert small["stack"] <= small["chain"] + 16
    assert done.stdout.count(" equal ") == 4


def test_a_difference_of_one_bit_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """With fused multiply-add, which `-ffp-contract=off` forbids, a Cortex-M7 rounds once not twice."""
    made = program_of("DualPort")
    inputs = input_sequence(made, 200)
    assert pil.processor_in_the_loop(made, "dual_port", inputs, ["Cortex-M7"])[0].equal
    fused = tuple(f for f in CORTEX["Cortex-M7"] if f != "-ffp-contract=off")
    monkeypatch.setitem(CORTEX, "Cortex-M7", (*fused, "-ffp-contract=fast"))
    assert not pil.processor_in_the_loop(made, "dual_port", inputs, ["Cortex-M7"])[0].equal


def test_addition_for_cores_without_doubles_is_exact(tmp_path: Path) -> None:
    """Bit patterns of all kinds, and operands within 2^40 of each other, against the addition of this computer."""
    code = """
#include <stdint.h>
#include <stdio.h>
uint64_t exact_add(uint64_t a, uint64_t b);
int main(void)
{
    uint64_t x[2];
    while (fread(x, sizeof x, 1, stdin) == 1) {
        const uint64_t sum = exact_add(x[0], x[1]);
        (void)fwrite(&sum, sizeof sum, 1, stdout);
    }
    return 0;
}
"""
    (tmp_path / "add.c").write_text(code)
    exact = pil_folder() / "exact_double.c"
    command = [find_compiler().path, "-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    subprocess.run([*command, str(tmp_path / "add.c"), str(exact), "-o", str(tmp_path / "add")], check=True)
    rng = np.random.default_rng(11)
    x = rng.integers(0, 2**64, (400_000, 2), np.uint64)
    near, exponent = slice(100_000, 300_000), np.uint64(0x7FF << 52)
    shift = rng.integers(-40, 41, 200_000) + (x[near, 0] >> np.uint64(52)).astype(np.int64)
    x[near, 1] = (x[near, 1] & ~exponent) | ((shift & 0x7FF).astype(np.uint64) << np.uint64(52))
    x[300_000:350_000] &= ~exponent  # below the smallest normal number
    x[350_000:360_000, 1] = x[350_000:360_000, 0] ^ np.uint64(1 << 63)  # their sum is zero
    special = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 1.0, 1.7976931348623157e308]).view(np.uint64)
    x[360_000:360_049] = np.array([(a, b) for a in special for b in special])
    run = subprocess.run([str(tmp_path / "add")], input=x.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(run.stdout, np.float64)
    with np.errstate(all="ignore"):
        expected = x[:, 0].view(np.float64) + x[:, 1].view(np.float64)
    number = ~np.isnan(expected)
    np.testing.assert_array_equal(np.isnan(found), ~number)
    np.testing.assert_array_equal(found[number].view(np.uint64), expected[number].view(np.uint64))


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(GustformError, match=r"GF4110.*qemu-system-arm"):
        pil.require()


def test_samples_without_a_record_are_no_result(tmp_path: Path) -> None:
    (tmp_path / "records.bin").write_bytes(b"\0" * 24)
    with pytest.raises(GustformError, match="GF4111"):
        pil._read(tmp_path / "records.bin")

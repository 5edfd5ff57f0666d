"""Processor in the loop: an exported controller on emulated Cortex-M boards, against the same C on this computer.

The boards are QEMU's MPS2 with AN386 (Cortex-M4F) and AN500 (Cortex-M7). The harness of hil/pil gives both the same
samples and writes the whole context after each of them; equal means equal bit for bit. With -icount every instruction
takes the same virtual time, which the board's own timer shows: instructions are counted exactly, cycles of a real core
are not.

A Cortex-M4F adds doubles by a function of GCC that is not exactly rounded; hil/pil/exact_double.c takes its place.
"""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from shutil import which

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.folder import write_folder
from gustform_codegen.emit.controller.footprint import CORTEX, CROSS, FLAGS, Footprint, cortex, footprint
from gustform_codegen.emit.controller.program import Program
from gustform_codegen.toolchain import find_compiler
from gustform_hil.locate import pil_folder

Array = NDArray[np.float64]

MACHINES = {"Cortex-M4F": "mps2-an386", "Cortex-M7": "mps2-an500"}
QEMU = "qemu-system-arm"
_SOFT_DOUBLE = {"Cortex-M4F"}
_EXACT = [f"-Wl,--wrap=__aeabi_{name}" for name in ("dadd", "dsub", "drsub")]
_SHIFT = 10  # 2^10 ns of virtual time an instruction: 25.6 ticks of the 25 MHz timer, so that none is lost in rounding
_TIMEOUT = 600  # s
_WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror")
_SUMMARY = ("samples", "errors", "ticks_nothing", "ticks_thousand", "stack", "context_size")


@dataclass(frozen=True)
class Records:
    """What a run of the harness wrote: the context after each sample, byte by byte; ticks of each step."""

    contexts: NDArray[np.uint8]
    ticks: NDArray[np.uint32]
    summary: dict[str, int]

    def instructions(self) -> NDArray[np.int64]:
        """Of each step, from its first to its return."""
        nothing, thousand = self.summary["ticks_nothing"], self.summary["ticks_thousand"]
        exact = (self.ticks.astype(np.float64) - nothing) * 1000.0 / (thousand - nothing) + 1.0
        whole = np.rint(exact)
        if np.max(np.abs(exact - whole)) > 0.25:
            raise GustformError("GF4111", "the emulator's timer does not count instructions", hint=f"{QEMU} 7 or newer")
        return whole.astype(np.int64)


@dataclass(frozen=True)
class Measured:
    """A controller on one board, in one number type. Bytes; `linked`: text with what it needs of the libraries."""

    control: str
    board: str
    machine: str
    real: str
    samples: int
    equal: bool
    errors: int
    instructions_mean: float
    instructions_min: int
    instructions_max: int
    text: int
    data: int
    bss: int
    linked: int
    context: int
    frame: int
    chain: int
    stack: int


def require() -> None:
    """GF4110 if a program that is needed is missing."""
    for program, package in ((QEMU, "qemu-system-arm"), (f"{CROSS}gcc", "gcc-arm-none-eabi libnewlib-arm-none-eabi")):
        if which(program) is None:
            raise GustformError(
                "GF4110",
                f"{program} is not installed",
                hint=f"sudo apt-get install --no-install-recommends {package}",
            )


def processor_in_the_loop(program: Program, prefix: str, inputs: Array, boards: list[str]) -> list[Measured]:
    """Run a controller over samples, in float and in double, on each board. GF4110, GF4111."""
    require()
    found = []
    with tempfile.TemporaryDirectory(prefix="gustform-pil-") as scratch:
        folder = Path(scratch)
        for double in (False, True):
            write_folder(program, prefix, double, folder)
            inputs.astype(np.float64 if double else np.float32).tofile(folder / "inputs.bin")
            host = _on_host(prefix, folder)
            for board in boards:
                found.append(_measure(program, prefix, double, folder, board, host))
    return found


def _measure(program: Program, prefix: str, double: bool, folder: Path, board: str, host: Records) -> Measured:
    target = cortex(board)
    assert target is not None  # require() has found it
    memory: Footprint = footprint(program, prefix, double, folder, target)
    ours, exact = ["harness.c", "board.c"], []
    if double and board in _SOFT_DOUBLE:
        ours, exact = [*ours, "exact_double.c"], _EXACT
    image = _link(prefix, folder, board, [f"-T{pil_folder() / 'board.ld'}", *exact], ours)
    _emulate(image, folder, board)
    records = _read(folder / "records.bin")
    instructions = records.instructions()
    return Measured(
        program.step.block.name,
        board,
        MACHINES[board],
        memory.real,
        records.summary["samples"],
        bool(np.array_equal(records.contexts, host.contexts)),
        records.summary["errors"],
        float(instructions.mean()),
        int(instructions.min()),
        int(instructions.max()),
        memory.text,
        memory.data,
        memory.bss,
        _linked_text(prefix, folder, board, exact),
        records.summary["context_size"],
        memory.largest[1],
        memory.chain_bytes,
        records.summary["stack"],
    )


def _sources(prefix: str, folder: Path, *ours: str) -> list[str]:
    """Sources of the harness and of the controller, with what they are compiled with."""
    common = [*_WARNINGS, f"-I{folder}", f"-DCONTROLLER={prefix}_controller"]
    return [
        *common,
        *(str(pil_folder() / name) for name in ours),
        str(folder / f"{prefix}.c"),
        str(folder / f"{prefix}_interface.c"),
    ]


def _on_host(prefix: str, folder: Path) -> Records:
    image = folder / "host"
    _run([find_compiler().path, *FLAGS, *_sources(prefix, folder, "harness.c", "host.c"), "-o", str(image), "-lm"])
    _run([str(image)], folder)
    return _read(folder / "records.bin")


def _link(prefix: str, folder: Path, board: str, options: list[str], ours: list[str]) -> Path:
    image = folder / "board.elf"
    command = [f"{CROSS}gcc", *CORTEX[board], "-nostartfiles", "-Wl,--gc-sections", *options]
    _run([*command, *_sources(prefix, folder, *ours), "-o", str(image), "-lm"])
    return image


def _linked_text(prefix: str, folder: Path, board: str, exact: list[str]) -> int:
    """Bytes of code and constants of an image that is nothing but the controller and what it calls."""
    kept = [f"-Wl,-u,{prefix}_{function}" for function in ("startup", "recalibrate", "reinitialise")]
    image = _link(prefix, folder, board, [f"-Wl,-e,{prefix}_step", *kept, *exact], ["exact_double.c"] if exact else [])
    return int(_run([f"{CROSS}size", str(image)]).splitlines()[-1].split()[0])


def _emulate(image: Path, folder: Path, board: str) -> None:
    command = [
        QEMU, "-M", MACHINES[board], "-display", "none", "-serial", "none", "-monitor", "none",
        "-semihosting-config", "enable=on,target=native", "-icount", f"shift={_SHIFT}", "-kernel", str(image),
    ]  # fmt: skip
    _run(command, folder)


def _read(file: Path) -> Records:
    data = file.read_bytes()
    tail = np.frombuffer(data[-4 * len(_SUMMARY) :], "<u4")
    summary = {name: int(value) for name, value in zip(_SUMMARY, tail, strict=True)}
    width = 4 + summary["context_size"]
    body = data[: -4 * len(_SUMMARY)]
    if summary["samples"] == 0 or len(body) != width * summary["samples"]:
        raise GustformError("GF4111", "the harness did not write a record for each sample", hint="report this")
    rows = np.frombuffer(body, np.uint8).reshape(-1, width)
    return Records(rows[:, 4:].copy(), rows[:, :4].copy().view("<u4").ravel(), summary)


def _run(command: list[str], folder: Path | None = None) -> str:
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=_TIMEOUT,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired) as failure:
        raise GustformError("GF4111", f"{name} could not be run: {failure}", hint="see docs/export.md") from None
    if done.returncode != 0:
        words = (done.stderr or f"exit status {done.returncode}").strip().splitlines()
        raise GustformError("GF4111", f"{name} failed: {' | '.join(words[:3])}", hint="see docs/export.md")
    return done.stdout

"""How much memory an exported controller needs: frames on the stack, the worst chain of calls, sizes of its object.

All of it is what a compiler says: -fstack-usage for the frames, -fcallgraph-info=su for who calls whom (GCC; with
another compiler the chain is the sum of all frames, which no chain exceeds, as nothing recurs), `size` for the object.
Functions of the C library count as zero and are named.
"""

from __future__ import annotations

import contextlib
import json
import platform
import re
import shutil
import subprocess
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.a2l import offsets
from gustform_codegen.emit.controller.program import Program
from gustform_codegen.toolchain import find_compiler

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
_EMBEDDED = ("-mthumb", "-mfloat-abi=hard", "-fno-math-errno", "-ffunction-sections")
CORTEX = {
    "Cortex-M4F": (*FLAGS, "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", *_EMBEDDED),
    "Cortex-M7": (*FLAGS, "-mcpu=cortex-m7", "-mfpu=fpv5-d16", *_EMBEDDED),
}
CROSS = "arm-none-eabi-"
# What a leaf function keeps below the stack pointer is no part of its frame to the compiler; so let there be nothing.
_HOST = ("-mno-red-zone",) if platform.machine() in ("x86_64", "AMD64") else ()
_TIMEOUT = 120  # s


@dataclass(frozen=True)
class Target:
    """A compiler with its options, and the `size` that reads its objects."""

    name: str
    compiler: str
    size: str
    flags: tuple[str, ...]


@dataclass(frozen=True)
class Footprint:
    """Memory in bytes. `chain` calls down to the deepest place; `library` is called and not counted in it."""

    target: str
    compiler: str
    flags: str
    real: str
    text: int
    data: int
    bss: int
    context: int
    frames: dict[str, int]
    chain: list[str]
    chain_bytes: int
    library: list[str]

    @property
    def largest(self) -> tuple[str, int]:
        """The function with the largest frame."""
        return max(self.frames.items(), key=lambda item: item[1])


def targets() -> list[Target]:
    """The host's compiler and, where it is installed, that for Cortex-M4F."""
    found = [cortex("Cortex-M4F")]
    with contextlib.suppress(GustformError):
        found.insert(0, Target("host", find_compiler().path, "size", (*FLAGS, *_HOST)))
    return [target for target in found if target is not None]


def cortex(name: str) -> Target | None:
    """The compiler for one of `CORTEX`, if it is installed."""
    compiler = shutil.which(f"{CROSS}gcc")
    return None if compiler is None else Target(name, compiler, f"{CROSS}size", CORTEX[name])


def context_bytes(program: Program, double: bool) -> int:
    """sizeof of the context."""
    size = 8 if double else 4
    end = offsets(program, size)["faulty_inputs"] + 4
    return (end + size - 1) // size * size


def footprint(program: Program, prefix: str, double: bool, folder: Path, target: Target) -> Footprint:
    """Measure `folder`/`prefix`.c with a compiler. GF4104 if it or `size` fails."""
    with tempfile.TemporaryDirectory(prefix="gustform-") as scratch:
        out = Path(scratch) / "object.o"
        macro = f"-D{prefix.upper()}_DOUBLE={int(double)}"
        command = [target.compiler, *target.flags, macro, "-fstack-usage", "-c", str(folder / f"{prefix}.c")]
        graph = out.with_suffix(".ci")
        try:
            _run([*command, "-fcallgraph-info=su", "-o", str(out)])
        except GustformError:
            _run([*command, "-o", str(out)])  # not GCC; if that is not why, this one says what it is
        sizes = _run([target.size, str(out)]).splitlines()[-1].split()
        version = _run([target.compiler, "--version"]).splitlines()[0]
        frames = stack_usage(out.with_suffix(".su").read_text())
        calls = call_graph(graph.read_text()) if graph.exists() else None
    if calls is None:
        chain, library = sorted(frames), []
    else:
        chain = worst_chain(frames, calls)
        library = sorted({callee for callees in calls.values() for callee in callees} - set(frames))
    text, data, bss = (int(word) for word in sizes[:3])
    return Footprint(
        target.name,
        version,
        " ".join(target.flags),
        "double" if double else "float",
        text,
        data,
        bss,
        context_bytes(program, double),
        frames,
        chain,
        sum(frames[name] for name in chain),
        library,
    )


def _run(command: list[str]) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_TIMEOUT, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as failure:
        raise GustformError("GF4104", f"{command[0]} could not be run: {failure}", hint="CC=gcc") from None
    if done.returncode != 0:
        words = (done.stderr or f"exit code {done.returncode}").strip().splitlines()
        raise GustformError("GF4104", f"{command[0]} failed: {' | '.join(words[:2])}", hint="CC=gcc")
    return done.stdout


def stack_usage(text: str) -> dict[str, int]:
    """Bytes of each function of a .su file: `file.c:12:5:name  48  static`. GF4104 if a frame has no fixed size."""
    frames: dict[str, int] = {}
    for line in text.splitlines():
        place, size, kind = line.split("\t")
        name = _function(place)
        if kind not in ("static", "dynamic,bounded"):
            raise GustformError("GF4104", f"the frame of {name} has no fixed size", hint="another compiler")
        frames[name] = max(int(size), frames.get(name, 0))
    return frames


def _function(title: str) -> str:
    """The name of a function from its title: without its place, and what the optimiser makes of it has its name."""
    return title.rsplit(":", 1)[-1].split(".", 1)[0]


def call_graph(text: str) -> dict[str, list[str]]:
    """Who calls whom, of a .ci file."""
    calls: dict[str, list[str]] = {}
    for source, callee in re.findall(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text):
        calls.setdefault(_function(source), []).append(_function(callee))
    return calls


def worst_chain(frames: dict[str, int], calls: dict[str, list[str]]) -> list[str]:
    """The chain of calls with the most bytes. GF4104 if a function calls itself, however indirectly."""

    def below(name: str, above: tuple[str, ...]) -> list[str]:
        if name in above:
            raise GustformError("GF4104", f"{name} calls itself: no bound of its stack", hint="report this")
        chains = [below(c, (*above, name)) for c in dict.fromkeys(calls.get(name, [])) if c in frames]
        deepest = max(chains, key=lambda chain: sum(frames[c] for c in chain), default=[])
        return [name, *deepest]

    return max((below(name, ()) for name in sorted(frames)), key=lambda chain: sum(frames[c] for c in chain))


def as_text(found: list[Footprint]) -> str:
    """A table, with the compilers it was measured with."""
    lines = [
        f"{'bytes':<12}{'real':<8}{'text':>7}{'data':>6}{'bss':>5}{'context':>9}{'frame':>7}{'chain':>7}  deepest calls"
    ]
    for f in found:
        calls = " > ".join(f.chain)
        lines.append(
            f"{f.target:<12}{f.real:<8}{f.text:>7}{f.data:>6}{f.bss:>5}{f.context:>9}{f.largest[1]:>7}"
            f"{f.chain_bytes:>7}  {calls}"
        )
    lines += [f"{f.target}: {f.compiler}; {f.flags}" for f in found]
    library = sorted({name for f in found for name in f.library})
    if library:
        lines.append(f"stack of the C library not counted: {', '.join(library)}")
    return "\n".join(lines) + "\n"


def as_json(found: list[Footprint]) -> str:
    """The same as data."""
    return json.dumps([asdict(f) for f in found], indent=2) + "\n"

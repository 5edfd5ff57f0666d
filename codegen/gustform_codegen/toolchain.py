"""The C compiler: found, asked for its version, run without a shell; its errors reported with the file at fault."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from gustform.language.errors import GustformError

# Speed without breaking IEEE semantics: no errno for sqrt, the machine's own vector units, no fused contraction
# beyond what ISO mode allows, so that results do not depend on the optimiser's mood.
FLAGS = ("-std=c11", "-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared",
         "-fvisibility=default")  # fmt: skip


@dataclass(frozen=True)
class Compiler:
    """A C compiler and what distinguishes its output."""

    path: str
    version: str


def find_compiler() -> Compiler:
    """$CC, else cc, gcc or clang. GF4001 when there is none, GF4002 when $CC cannot say its version."""
    return _find(os.environ.get("CC"), os.environ.get("PATH"))


@lru_cache
def _find(wanted: str | None, search: str | None) -> Compiler:
    for name in [wanted] if wanted else ["cc", "gcc", "clang"]:
        path = shutil.which(name, path=search)
        if path is None:
            continue
        try:
            answer = subprocess.run(
                [path, "--version"], capture_output=True, text=True, timeout=30, check=False, stdin=subprocess.DEVNULL
            )
        except OSError:
            continue
        if answer.returncode == 0:
            return Compiler(path, answer.stdout.splitlines()[0] if answer.stdout else path)
        if wanted:
            words = (answer.stderr or answer.stdout or f"exit code {answer.returncode}").strip().splitlines()
            raise GustformError(
                "GF4002", f"the C compiler {path} failed on --version: {' | '.join(words[:3])}", hint="CC=gcc"
            )
    looked = f"$CC={wanted!r}" if wanted else "cc, gcc and clang on the PATH"
    raise GustformError(
        "GF4001", f"no C compiler: looked for {looked}", hint="apt-get install build-essential, or CC=/path/to/cc"
    )


# An exported controller: the same bits on every machine, so no fused multiply-add and nothing of this machine's own.
CONTROLLER_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-DGUST_CONTROLLER_LIBRARY")


def compile_kernel(source: str, target: Path, include: Path, type_name: str) -> None:
    """Compile a kernel to `target` (put in place atomically). GF4002 with the compiler's words when it fails."""
    _compile({"kernel.c": source}, (*FLAGS, f"-I{include}"), target, f"type {type_name}")


def compile_controller(sources: Mapping[str, str], target: Path, name: str) -> None:
    """Compile the C files of an exported controller to the shared library `target`, as compile_kernel does."""
    _compile(sources, CONTROLLER_FLAGS, target, f"controller {name}")


def _compile(sources: Mapping[str, str], flags: Sequence[str], target: Path, what: str) -> None:
    """`sources` by file name; the first one is kept beside the library."""
    compiler = find_compiler()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gustform-", dir=target.parent) as folder:
        files = [Path(folder) / name for name in sources]
        so_file = Path(folder) / "library.so"
        for file, text in zip(files, sources.values(), strict=True):
            file.write_text(text, encoding="utf-8")
        units = [str(file) for file in files if file.suffix == ".c"]
        command = [compiler.path, *flags, *units, "-o", str(so_file), "-lm"]
        try:
            run = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=600, stdin=subprocess.DEVNULL
            )
        except (OSError, subprocess.TimeoutExpired) as failure:
            raise GustformError(
                "GF4002",
                f"the C compiler {compiler.path} could not be run for {what}: {failure}",
                hint="CC=gcc",
            ) from failure
        if run.returncode != 0 or not so_file.exists():
            kept = target.with_suffix(".failed.c")
            shutil.copyfile(files[0], kept)
            lines = (run.stderr or run.stdout or f"exit code {run.returncode}").strip().splitlines()
            raise GustformError(
                "GF4002",
                f"the C compiler {compiler.path} failed on {what}: {' | '.join(lines[:3])}; "
                f"the source is kept in {kept}",
                hint="CC=gcc, or a newer compiler",
            )
        # The source stays beside the library, for whoever wants to read what was compiled.
        files[0].replace(target.with_suffix(".c"))
        so_file.replace(target)

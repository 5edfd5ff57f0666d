"""Kernels by content: the same C text with the same compiler and flags is compiled once per machine."""

from __future__ import annotations

import hashlib
import os
import platform
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_codegen import toolchain


def default_folder() -> Path:
    """$GUSTFORM_CACHE, else $XDG_CACHE_HOME/gustform, else ~/.cache/gustform."""
    if chosen := os.environ.get("GUSTFORM_CACHE"):
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "gustform"


@lru_cache(maxsize=1)
def _machine() -> str:
    """What -march=native depends on."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("flags"):
                return line
    except OSError:
        pass
    return platform.machine() + platform.processor()


@dataclass
class KernelCache:
    """Compiled kernels in a folder. `compilations` counts the C compilations this object needed."""

    include: Path
    folder: Path = field(default_factory=default_folder)
    compilations: int = 0

    def key(self, source: str) -> str:
        header = (self.include / "gustform" / "gust_kernel.h").read_text(encoding="utf-8")
        parts = [source, header, toolchain.find_compiler().version, " ".join(toolchain.FLAGS), _machine()]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]

    def get(self, source: str, type_name: str) -> Path:
        """The shared library for a kernel's C text, compiled if it is not there whole. GF4005 without a folder."""
        path = self.folder / "kernels" / f"{self.key(source)}.so"
        self._provide(path, partial(toolchain.compile_kernel, source, path, self.include, type_name))
        return path

    def controller(self, sources: Mapping[str, str], name: str) -> Path:
        """The shared library of an exported controller, from its files by name, the controller's own first."""
        flags = " ".join(toolchain.CONTROLLER_FLAGS)
        parts = [f"{file}\0{text}" for file, text in sources.items()]
        hashed = "\0".join([*parts, toolchain.find_compiler().version, flags, platform.machine()])
        path = self.folder / "controllers" / f"{hashlib.sha256(hashed.encode()).hexdigest()[:32]}.so"
        self._provide(path, partial(toolchain.compile_controller, sources, path, name))
        return path

    def _provide(self, path: Path, compile_it: Callable[[], None]) -> None:
        """Compile what is not there whole."""
        if _intact(path):
            return
        try:
            compile_it()
            _seal(path)
        except OSError as failure:
            raise GustformError(
                "GF4005",
                f"compiled kernels cannot be kept in {path.parent}: {failure}",
                hint="GUSTFORM_CACHE=/a/folder/to/write/to",
            ) from failure
        self.compilations += 1


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _seal(path: Path) -> None:
    """Write down what a whole library hashes to: a file cut off by a crash must not be loaded."""
    with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as file:
        file.write(_digest(path))
    Path(file.name).replace(path.with_suffix(".sha256"))


def _intact(path: Path) -> bool:
    try:
        return path.with_suffix(".sha256").read_text(encoding="ascii", errors="replace") == _digest(path)
    except OSError:
        return False

"""A rig: one folder with all that a gust-bridge is made of, which compiles wherever there are CMake and a C compiler.

    RIG/controller   the exported control
    RIG/can          database and mapping, as they were
    RIG/messages     C made of them
    RIG/bridge       the bridge's own sources
    RIG/rig.json     what it was made from
    RIG/build        the programs gust-bridge, gust-soak and gust-latency, once compiled

The same scenario and versions give the same bytes. A folder that is neither empty nor a rig is never written to; in a
rig, files of the last build that are no longer part of it are removed, and nothing else.

GF8130 folder is not a rig; GF8131 the control needs what the messages do not carry; GF8132 periods differ;
GF8133 no CMake; GF8134 the rig does not compile.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import Any

import gustform
from gustform.language.errors import GustformError, did_you_mean
from gustform_codegen.emit.controller.folder import files as controller_files
from gustform_codegen.emit.controller.program import Program
from gustform_hil.c_messages import c_messages
from gustform_hil.locate import bridge_folder
from gustform_hil.message_set import Field, MessageSet, Part
from gustform_hil.rig_texts import cmake, readme

KIND = "gustform rig"
PROGRAM = Path("build") / "gust-bridge"
_TIMEOUT = 600  # s


@dataclass(frozen=True)
class Rig:
    """What goes into one: `origin` tells in rig.json where the controller comes from."""

    controller: Program
    prefix: str
    messages: MessageSet
    database: Path
    mapping: Path
    origin: dict[str, Any]

    @property
    def description(self) -> dict[str, Any]:
        """The beginning of rig.json."""
        block = self.controller.step.block
        return {
            "kind": KIND,
            "versions": {
                "gustform": gustform.__version__,
                "casadi": version("casadi"),
                "cantools": version("cantools"),
            },
            **self.origin,
            "control": block.name,
            "prefix": self.prefix,
            "real": "float",
            "period_s": self.controller.step.period,
            "messages": self.messages.name,
            "fingerprint": f"0x{self.messages.fingerprint:08x}",
        }


def check(rig: Rig) -> None:
    """GF8131, GF8132 where control and messages do not fit each other."""
    block = rig.controller.step.block
    carried = {part: _quantities(rig.messages, part) for part in (Part.MEASUREMENTS, Part.SET_POINTS, Part.REFERENCES)}
    arriving = carried[Part.MEASUREMENTS] | carried[Part.SET_POINTS]
    for signals, known, role in (
        (block.inputs, arriving, "input"),
        (block.outputs, carried[Part.REFERENCES], "output"),
    ):
        for signal in signals:
            if signal.name not in known:
                raise GustformError(
                    "GF8131",
                    f"{signal.name}, an {role} of {block.name}, must be a quantity of {rig.messages.name}; it has none",
                    hint=did_you_mean(signal.name, known) or f"{{quantity: {signal.name}}} in {rig.mapping.name}",
                )
    cycle, own = period(rig.messages), rig.controller.step.period
    if abs(cycle - own) > 1e-9:
        raise GustformError(
            "GF8132",
            f"the controller's period, {own * 1e3:g} ms, must be the cycle time of the references in"
            f" {rig.messages.name}, {cycle * 1e3:g} ms",
            hint=f"--period {cycle:g}",
        )


def period(messages: MessageSet) -> float:
    """Seconds from one sample to the next: the cycle time of the references. GF8132."""
    references = messages.find(Part.REFERENCES)
    if references is None or references.cycle <= 0:
        raise GustformError(
            "GF8132", f"the references of {messages.name} must have a cycle time", hint="cycle: 1 in the mapping"
        )
    return references.cycle * 1e-6


def _quantities(messages: MessageSet, part: Part) -> set[str]:
    return {
        signal.quantity
        for message in messages.pieces(part)
        for signal in message.signals
        if signal.field == Field.QUANTITY
    }


def check_target(out: Path) -> None:
    """GF8130 unless `out` is a rig, an empty folder, or not there."""
    if not out.exists() or _description(out) is not None:
        return
    if not out.is_dir() or any(out.iterdir()):
        raise GustformError(
            "GF8130", f"{str(out)!r} is neither empty nor a rig, and is left as it is", hint="--out with another folder"
        )


def _description(out: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((out / "rig.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and found.get("kind") == KIND else None


def write_rig(rig: Rig, out: Path) -> None:
    """Write the folder. GF8130 to GF8132 before anything is touched, GF7001 if it cannot be written."""
    check(rig)
    check_target(out)
    contents = dict(sorted(_contents(rig)))
    described = rig.description | {"files": {name: sha256(data).hexdigest() for name, data in contents.items()}}
    old = _description(out) or {}
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in _stale(old, set(contents)):
            (out / name).unlink(missing_ok=True)
        for name, data in contents.items():
            file = out / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        (out / "rig.json").write_bytes((json.dumps(described, indent=2) + "\n").encode())
    except OSError as error:
        raise GustformError(
            "GF7001", f"the folder {str(out)!r} must be writable; {error.strerror}", hint="--out with another folder"
        ) from None


def _stale(old: dict[str, Any], kept: set[str]) -> Iterator[str]:
    """Files that an earlier build has listed, as long as they lie inside of the rig."""
    listed = old.get("files")
    for name in listed if isinstance(listed, dict) else ():
        path = PurePosixPath(name)
        if name not in kept and len(path.parts) <= 4 and not path.is_absolute() and ".." not in path.parts:
            yield name


def _contents(rig: Rig) -> Iterator[tuple[str, bytes]]:
    for name, text in controller_files(rig.controller, rig.prefix, double=False).items():
        yield f"controller/{name}", text.encode()
    yield f"can/{rig.messages.name}.dbc", rig.database.read_bytes()
    yield "can/mapping.yaml", rig.mapping.read_bytes()
    messages = {f"messages/{name}": text.encode() for name, text in c_messages(rig.messages).items()}
    bridge = dict(_bridge_files())
    yield from messages.items()
    yield from bridge.items()
    yield "CMakeLists.txt", cmake(rig.prefix, sorted([*messages, *bridge])).encode()
    yield "README.md", readme(rig.description).encode()


def _bridge_files() -> Iterator[tuple[str, bytes]]:
    folder = bridge_folder()
    for pattern in ("include/gustform_bridge/*.h", "src/*.[ch]", "tools/*.c"):
        for file in sorted(folder.glob(pattern)):
            yield f"bridge/{file.relative_to(folder).as_posix()}", file.read_bytes()


def compile_rig(out: Path) -> Path:
    """Compile the program; its path. GF8133, GF8134."""
    program = shutil.which("cmake")
    if program is None:
        raise GustformError("GF8133", "cmake must be on the PATH to compile a rig", hint="apt-get install cmake")
    # A cache that was made elsewhere is refused by CMake; what it holds is found again.
    (out / "build" / "CMakeCache.txt").unlink(missing_ok=True)
    for arguments in (["-S", str(out), "-B", str(out / "build")], ["--build", str(out / "build"), "--parallel"]):
        _run([program, *arguments])
    return out / PROGRAM


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=_TIMEOUT, stdin=subprocess.DEVNULL,
            check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise GustformError("GF8134", f"cmake could not be run: {error}", hint="cmake --version") from None
    if done.returncode != 0:
        words = [line.strip() for line in (done.stdout + done.stderr).splitlines() if "rror" in line] or [done.stderr]
        raise GustformError(
            "GF8134", f"the rig does not compile: {' | '.join(words[:3])[:500]}", hint=" ".join(command)
        )

"""An emulated PC whose time is counted in instructions: Debian's real-time kernel, an initramfs of ours, no disk.

QEMU with -icount gives each instruction the same length of virtual time, and sleep=off lets that time jump where the
processor idles. What a program measures in there depends neither on this machine nor on what else runs on it.
"""

from __future__ import annotations

import gzip
import re
import shutil
import stat
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
VCAN = HERE.parent / "vcan"
KERNEL_PACKAGE = "linux-image-rt-amd64"
MODULES = ("net/can/can", "net/can/can-raw", "drivers/net/can/dev/can-dev", "drivers/net/can/vcan")
SHIFT = 1
"""An instruction takes 2^SHIFT ns: 500 million a second, about what one slow core of a bench computer does."""


class Failed(Exception):
    """A sentence for the user."""


@dataclass(frozen=True)
class Kernel:
    """What is taken of Debian's package."""

    image: Path
    modules: Path

    @property
    def version(self) -> str:
        """As in the name of the image."""
        return self.image.name.removeprefix("vmlinuz-")


@dataclass(frozen=True)
class Outcome:
    """What a command in the machine has left."""

    code: int
    stdout: str
    stderr: str


def kernel(folder: Path) -> Kernel:
    """Debian's newest real-time kernel, downloaded and unpacked into `folder` once; nothing is installed."""
    if not list(folder.glob("boot/vmlinuz-*")):
        work = folder.with_suffix(".new")
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir(parents=True)
        depends = output("apt-cache", "depends", "--important", KERNEL_PACKAGE)
        found = re.search(r"Depends: (linux-image-\S+)", depends)
        if found is None:
            raise Failed(f"apt knows no {KERNEL_PACKAGE}: apt-get update")
        output("apt-get", "download", found[1], cwd=work)
        (package,) = work.glob("*.deb")
        output("dpkg-deb", "-x", str(package), str(work))
        package.unlink()
        shutil.rmtree(folder, ignore_errors=True)
        work.rename(folder)
    (image,) = folder.glob("boot/vmlinuz-*")
    return Kernel(image, folder / "lib" / "modules" / image.name.removeprefix("vmlinuz-") / "kernel")


def output(*command: str, cwd: Path | None = None) -> str:
    """What a program prints; its complaint becomes ours."""
    try:
        return subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True).stdout
    except FileNotFoundError:
        raise Failed(f"{command[0]} is not there: this needs Debian or a distribution made from it") from None
    except subprocess.CalledProcessError as error:
        raise Failed(f"{' '.join(command)} failed:\n{error.stderr or error.stdout}") from None


def with_libraries(programs: Sequence[Path]) -> dict[str, bytes]:
    """The programs as /bin/NAME and the shared libraries they need, in their places."""
    files = {f"bin/{program.name}": program.read_bytes() for program in programs}
    for program in programs:
        for line in output("ldd", str(program)).splitlines():
            if found := re.search(r"(/\S+) \(0x", line):
                files[found[1].lstrip("/")] = Path(found[1]).read_bytes()
    return files


def archive(files: Mapping[str, bytes]) -> bytes:
    """An initramfs: the cpio format "newc", every file executable, everything of root and of the year 1970."""
    folders = {str(parent) for name in files for parent in Path(name).parents if str(parent) != "."}
    entries = [(name, stat.S_IFDIR | 0o755, b"") for name in sorted(folders)]
    entries += [(name, stat.S_IFREG | 0o755, data) for name, data in sorted(files.items())]
    whole = bytearray()
    for number, (name, mode, data) in enumerate([*entries, ("TRAILER!!!", 0, b"")], start=1):
        fields = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(name) + 1, 0)
        whole += b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
        whole += bytes(-len(whole) % 4) + data
        whole += bytes(-len(whole) % 4)
    return gzip.compress(bytes(whole), compresslevel=1, mtime=0)


def init(folder: Path) -> Path:
    """The first process, which the guests of hil/vcan have as well."""
    program = folder / "guest_init"
    sources = [str(VCAN / name) for name in ("guest_init.c", "guest_command.c", "vcan_link.c")]
    output("cc", "-std=gnu11", "-O2", "-static", *sources, "-o", str(program))
    return program


def run(linux: Kernel, folder: Path, command: Sequence[str], files: Mapping[str, bytes], timeout: float) -> Outcome:
    """Boots, runs `command`, which finds `files` in its root, and switches off. `folder` takes what passes."""
    folder.mkdir(parents=True, exist_ok=True)
    modules = {f"modules/{Path(name).name}.ko": (linux.modules / f"{name}.ko").read_bytes() for name in MODULES}
    description = ["/", str(len(command)), *command, "PATH=/bin"]
    own = {
        "init": init(folder).read_bytes(),
        "modules.list": "".join(f"/{name}\n" for name in modules).encode(),
        "command": b"".join(text.encode() + b"\0" for text in description),
    }
    (folder / "initramfs").write_bytes(archive({**files, **modules, **own}))
    streams = [folder / name for name in ("log", "stdout", "stderr", "control")]
    settings = ["VCAN_INTERFACES=vcan0", "VCAN_MODULES=/modules.list", "VCAN_COMMAND=/command"]
    settings += ["VCAN_STDOUT=/dev/ttyS1", "VCAN_STDERR=/dev/ttyS2", "VCAN_CONTROL=/dev/ttyS3"]
    machine = ["qemu-system-x86_64", "-accel", "tcg,thread=single", "-icount", f"shift={SHIFT},sleep=off", "-smp", "1"]
    machine += ["-cpu", "qemu64", "-m", "512", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"]
    machine += ["-rtc", "base=2026-01-01,clock=vm", "-kernel", str(linux.image), "-initrd", str(folder / "initramfs")]
    machine += ["-append", f"console=ttyS0 quiet panic=-1 nokaslr random.trust_cpu=off {' '.join(settings)}"]
    machine += [word for path in streams for word in ("-serial", f"file:{path}")]
    try:
        ended = subprocess.run(machine, timeout=timeout, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    except FileNotFoundError:
        raise Failed("qemu-system-x86_64 is not installed: tools/system_packages.sh --realtime") from None
    except subprocess.TimeoutExpired:
        raise Failed(f"the emulated machine did not end within {timeout} s; its log is {streams[0]}") from None
    log, stdout, stderr, control = (path.read_text(errors="replace") for path in streams)
    found = re.search(r"^exit (\d+)$", control, re.MULTILINE)
    if found is None:
        raise Failed(f"the emulated machine ended without an exit code:\n{ended.stderr}{log[-2000:]}")
    return Outcome(int(found[1]), stdout, stderr)

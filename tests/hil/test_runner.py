"""The runner hil/vcan/with-vcan: what a command sees in a guest, how it ends, many guests in a row and at a time."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.support.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]
RUNNER = ROOT / "hil" / "vcan" / "with-vcan"
TIMEOUT = 90
"""Seconds. A boot takes 1.3 s on an idle processor; the tests beside this one may leave it a tenth of one."""

FRAME_PASSES = """
import socket, struct, sys
data = bytes(range(64))
frame = struct.pack("<IBBBB64s", 0x123, 64, 4, 0, 0, data)
def opened():
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
    bus.settimeout(20)
    bus.bind((sys.argv[1],))
    return bus
sender, receiver = opened(), opened()
assert sender.send(frame) == 72
received = receiver.recv(80)
assert len(received) == 72 and received[:5] == frame[:5] and received[8:] == data, received
print("passed")
"""


def arguments(*command: str, way: str = "--guest", options: Sequence[str] = ()) -> list[str]:
    return [sys.executable, str(RUNNER), *([way] if way else []), *options, *command]


def run(
    *command: str,
    way: str = "--guest",
    options: Sequence[str] = (),
    environment: dict[str, str] | None = None,
    **others: str,
) -> subprocess.CompletedProcess[str]:
    """Runs a command by the runner; the environment is this one but for the given changes."""
    return subprocess.run(
        arguments(*command, way=way, options=options),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        env=os.environ | (environment or {}),
        cwd=others.get("cwd"),
    )


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The runners of a test keep their folders here, so that its guests can be told from those of others."""
    folder = tmp_path / "runners"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


def guests(place: Path) -> list[str]:
    """The processes of the guests that were begun in `place` and still run, and folders left there."""
    found = [path.name for path in place.iterdir()]
    for process in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            if b"linux.uml" in (line := process.read_bytes()) and os.fsencode(place) in line:
                found.append(process.parent.name)
    return found


def test_the_command_sees_files_folder_environment_and_arguments(tmp_path: Path) -> None:
    odd = "quotes ' \" $HOME ; spaces\nand a line, ümlaut"
    program = "import os, sys, pathlib; pathlib.Path('written').write_text(os.environ['ODD'] + sys.argv[1])"
    result = run(sys.executable, "-c", program, odd, cwd=str(tmp_path), environment={"ODD": odd})
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert (tmp_path / "written").read_text() == odd + odd


def test_the_two_streams_stay_apart_and_every_byte_passes() -> None:
    """A megabyte of all byte values each way: terminal lines neither touch a byte nor drop one."""
    program = (
        "import os, sys, threading\n"
        "def write(fd, data):\n"
        "    while data: data = data[os.write(fd, data):]\n"
        "threads = [threading.Thread(target=write, args=(1, bytes(range(256)) * 4096)),"
        " threading.Thread(target=write, args=(2, bytes(range(255, -1, -1)) * 4096))]\n"
        "[t.start() for t in threads]; [t.join() for t in threads]; assert sys.stdin.read() == ''"
    )
    result = subprocess.run(arguments(sys.executable, "-c", program), capture_output=True, timeout=TIMEOUT)
    assert result.returncode == 0
    assert result.stdout == bytes(range(256)) * 4096
    assert result.stderr == bytes(range(255, -1, -1)) * 4096


def test_twenty_guests_in_a_row_and_their_exit_codes(place: Path) -> None:
    codes = [0, 1, 2, 124, 125, 126, 127, 128, 129, 254, 255, *range(3, 12)]
    assert [run("sh", "-c", f"exit {code}").returncode for code in codes] == codes
    assert guests(place) == []


@pytest.mark.parametrize(
    ("command", "code", "message"),
    [
        (["/no/such/program"], 127, "/no/such/program: No such file or directory"),
        (["/etc/passwd"], 126, "/etc/passwd: Permission denied"),
        (["sh", "-c", "kill -SEGV $$"], 128 + signal.SIGSEGV, ""),
    ],
)
def test_a_command_that_cannot_run_or_is_killed_has_the_code_of_the_shell(
    command: list[str], code: int, message: str
) -> None:
    result = run(*command)
    assert result.returncode == code
    assert message in result.stderr


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGUSR1])
def test_a_signal_reaches_the_command_which_ends_in_its_own_way(number: signal.Signals, place: Path) -> None:
    program = f"trap 'echo caught; exit 7' {number:d}; echo waiting; while :; do sleep 0.1; done"

    def not_ignored() -> None:  # as a shell without job control leaves it to what it runs in the background
        signal.signal(number, signal.SIG_DFL)

    words = arguments("bash", "-c", program)
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, preexec_fn=not_ignored) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "waiting\n"
        process.send_signal(number)
        rest, _ = process.communicate(timeout=TIMEOUT)
    assert (rest, process.returncode) == ("caught\n", 7)
    assert guests(place) == []


@pytest.mark.parametrize("part", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_signal_during_the_boot_ends_the_guest(part: float, place: Path) -> None:
    """At some moments user-mode Linux leaves a stopped process behind when it is told to end."""
    with subprocess.Popen(arguments("sleep", "1000")) as process:
        wait_for(lambda: len(guests(place)) >= 2, TIMEOUT)  # its folder and its first process
        time.sleep(part)
        process.terminate()
        assert process.wait(TIMEOUT) == 128 + signal.SIGTERM
    assert guests(place) == []


def test_a_killed_runner_leaves_no_guest_behind(place: Path) -> None:
    with subprocess.Popen(arguments("sh", "-c", "echo waiting; sleep 1000"), stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"waiting\n"
        process.kill()
    wait_for(lambda: len(guests(place)) == 1, TIMEOUT)  # its folder: nobody was left to remove it


def test_a_killed_guest_takes_its_processes_along_and_is_said(place: Path) -> None:
    """Were they let go, their system calls would reach the host, and the pipes they hold the runner for ever."""
    program = "echo waiting; while :; do echo running >>written; done"
    words, pipe = arguments("sh", "-c", program), subprocess.PIPE
    with subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, cwd=place.parent) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "waiting\n"
        (guest,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        os.kill(int(guest), signal.SIGKILL)
        _, said = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 125
    assert "the guest ended without an exit code" in said
    assert guests(place) == []


def test_a_reader_that_goes_away_ends_an_endless_command() -> None:
    with subprocess.Popen(arguments("yes"), stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"y\n"
        process.stdout.close()
        assert process.wait(TIMEOUT) == 128 + signal.SIGPIPE


def test_what_a_command_leaves_in_the_background_does_not_hold_the_guest() -> None:
    result = run("sh", "-c", "sleep 1000 & echo done")
    assert (result.returncode, result.stdout) == (0, "done\n")


def test_fd_frames_pass_on_each_interface() -> None:
    program = '"$0" -c "$1" vcan0 && "$0" -c "$1" vcan1 && echo $GUSTFORM_VCAN $GUSTFORM_VCAN_INTERFACES'
    result = run("sh", "-c", program, sys.executable, FRAME_PASSES, options=["--interfaces", "vcan0,vcan1"])
    assert (result.returncode, result.stdout) == (0, "passed\npassed\nguest vcan0,vcan1\n"), result.stderr


def test_two_guests_at_a_time_have_a_bus_each(tmp_path: Path) -> None:
    """Each waits for the other through files before it sends, so they run side by side; each hears itself alone."""
    program = """
import pathlib, socket, struct, sys, time
mine, other = sys.argv[1:]
bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind(("vcan0",))
sender = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
sender.bind(("vcan0",))
pathlib.Path(mine).touch()
for _ in range(600):
    if pathlib.Path(other).exists(): break
    time.sleep(0.1)
else:
    sys.exit("the other one never came")
for i in range(20):
    sender.send(struct.pack("<IB3x8s", int(mine), 8, bytes([i] * 8)))
    time.sleep(0.01)
bus.settimeout(0.2)
heard = []
try:
    while True: heard.append(bus.recv(16))
except TimeoutError: pass
print(len(heard), {struct.unpack_from("<I", frame)[0] for frame in heard})
"""

    def start(mine: str, other: str) -> subprocess.Popen[str]:
        command = arguments(sys.executable, "-c", program, mine, other)
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path)

    with start("1", "2") as one, start("2", "1") as two:
        assert one.communicate(timeout=TIMEOUT)[0] == "20 {1}\n"
        assert two.communicate(timeout=TIMEOUT)[0] == "20 {2}\n"


def test_traffic_control_loses_delays_and_fills_up() -> None:
    """What the loss and ENOBUFS tests stand on: netem and tbf, and a full queue that says ENOBUFS to the sender."""
    program = """
import errno, socket, struct, subprocess
def tc(*words): subprocess.run(["tc", "qdisc", *words], check=True)
def opened():
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.bind(("vcan0",))
    bus.settimeout(0.5)
    return bus
sender, receiver = opened(), opened()
frame = struct.pack("<IB3x8x", 1, 8)
def received():
    count = 0
    try:
        while receiver.recv(16): count += 1
    except TimeoutError: return count
tc("add", "dev", "vcan0", "root", "netem", "loss", "50%")
for _ in range(400): sender.send(frame)
print(100 < received() < 300)
for words in (["netem", "delay", "100ms", "limit", "5"], ["tbf", "rate", "8kbit", "burst", "64", "limit", "80"]):
    tc("replace", "dev", "vcan0", "root", *words)
    sent = 0
    try:
        while sent < 100:
            sender.send(frame)
            sent += 1
    except OSError as error: print(errno.errorcode[error.errno], sent < 10)
    print(received() == sent)
"""
    path = f"{os.environ['PATH']}:/usr/sbin:/sbin"
    result = run(sys.executable, "-c", program, environment={"PATH": path})
    assert result.stdout == "True\nENOBUFS True\nTrue\nENOBUFS True\nTrue\n", result.stderr


def test_the_hosts_own_vcan_is_taken_where_there_is_one() -> None:
    """In a guest, whose kernel has vcan, the runner needs no other: a namespace of its own, else vcan0 as it is."""
    inner = f"{sys.executable} {RUNNER} --host"
    program = f"""
    {inner} --interfaces vcan0,vcan5 sh -c 'echo $GUSTFORM_VCAN; ls /sys/class/net; kill -TERM $$'
    echo $?
    {inner} {sys.executable} -c "$0" vcan0 && echo namespace
    echo 0 >/proc/sys/user/max_net_namespaces
    {inner} {sys.executable} -c "$0" vcan0 && echo present
    ip link set vcan0 down; ip link set vcan0 mtu 16; ip link set vcan0 up
    {inner} true
    echo $?
    """
    result = run("bash", "-c", program, FRAME_PASSES)
    # sysfs shows the interfaces of the namespace in which it was mounted, so the first list is the outer one.
    lines = [line for line in result.stdout.splitlines() if line not in {"lo", "vcan0"}]
    assert lines == ["host", "143", "passed", "namespace", "passed", "present", "125"], result.stderr
    assert "ip link set vcan0 down; ip link set vcan0 mtu 72; ip link set vcan0 up" in result.stderr


def test_without_any_bus_the_line_to_install_is_printed(tmp_path: Path) -> None:
    """With no linux.uml to be found, on a kernel that has no vcan either: the runner says what to type."""
    for name in ("unshare", "sh", "env"):
        (tmp_path / name).symlink_to(shutil.which(name) or name)
    copy = tmp_path / "with-vcan"
    copy.write_text(RUNNER.read_text().replace('path="/usr/bin"', f'path="{tmp_path}"'))
    result = subprocess.run(
        [sys.executable, str(copy), "--guest", "true"],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        env={"PATH": str(tmp_path)},
    )
    assert result.returncode == 125
    assert "linux.uml (user-mode-linux) is not installed" in result.stderr
    assert "apt-get install --no-install-recommends user-mode-linux" in result.stderr


@pytest.mark.parametrize("options", [[], ["--interfaces", "vcan0;reboot"], ["--interfaces", "../x"]])
def test_wrong_usage_is_refused(options: list[str]) -> None:
    command = [] if not options else ["true"]
    result = run(*command, options=options)
    assert result.returncode == 125
    assert "usage: with-vcan" in result.stderr


def test_a_guest_without_its_module_says_so() -> None:
    result = run("true", options=["--module", "no_such_module"])
    assert result.returncode == 125
    assert "has no module no_such_module" in result.stderr

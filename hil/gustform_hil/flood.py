"""A full transmit queue: a queueing discipline behind which only the bridge's frames wait, and a flood that fills it.

Band 0 passes sockets of a high priority (this bench), band 1 holds all others back for `delay` in a queue of `frames`.
A sender then gets ENOBUFS, as from a bus that is busier than its queue is long. Needs CAP_NET_ADMIN; the programs of
iproute2 do it.

GF8078 the queue cannot be attached
"""

from __future__ import annotations

import shutil
import socket
import subprocess
from types import TracebackType
from typing import Self

from gustform.language.errors import GustformError
from gustform_hil.bus import Bus

_PASSES = 6  # SO_PRIORITY of what is not held back
_PRIORITY_MAP = "1 1 1 1 1 1 0 0 1 1 1 1 1 1 1 1"
_STRANGER = 0x7FE  # identifier of the flood, nobody's


class Flood:
    """A context: the queue is attached and full when it begins, and gone when it ends."""

    def __init__(self, bus: Bus, delay: str = "200ms", frames: int = 16) -> None:
        """`bus`: of the bench; what it sends passes."""
        self._bus, self._delay, self._frames = bus, delay, frames

    def __enter__(self) -> Self:
        interface = self._bus.interface
        self._bus.raw.setsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY, _PASSES)
        _tc(
            "qdisc", "replace", "dev", interface, "root", "handle", "1:", "prio", "bands", "3", "priomap", _PRIORITY_MAP
        )
        try:
            held = ("netem", "delay", self._delay, "limit", str(self._frames))
            _tc("qdisc", "add", "dev", interface, "parent", "1:2", "handle", "20:", *held)
            self._fill()
        except BaseException:
            self._remove()
            raise
        return self

    def _fill(self) -> None:
        with Bus(self._bus.interface, fd=self._bus.fd, only=()) as stranger:
            for _ in range(4 * self._frames):
                if not stranger.send(_STRANGER, bytes(8), fd=False):
                    return
        raise GustformError(
            "GF8078", f"the queue of {self._bus.interface} has not filled up", hint="a virtual CAN interface"
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._remove()

    def _remove(self) -> None:
        _tc("qdisc", "del", "dev", self._bus.interface, "root")


def _tc(*arguments: str) -> None:
    words = [word for argument in arguments for word in argument.split()]
    program = shutil.which("tc", path="/usr/sbin:/sbin:/usr/bin:/bin")
    if program is None:
        raise GustformError("GF8078", "the program tc must be installed", hint="apt-get install iproute2")
    done = subprocess.run([program, *words], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise GustformError(
            "GF8078",
            f"the queue cannot be attached; tc says: {done.stderr.strip()}",
            hint="as root, or in hil/vcan/with-vcan; modprobe sch_prio sch_netem",
        )

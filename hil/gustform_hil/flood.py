"""A full transmit queue: a queueing discipline behind which only the bridge's frames wait, and a flood that fills it.

Band 0 passes sockets of a high priority (this bench), band 1 holds all others back in a queue of a few frames. A sender
then gets ENOBUFS, as from a bus that is busier than its queue is long. The kernel is asked over rtnetlink, as tc does:

    tc qdisc replace dev IF root handle 1: prio bands 3 priomap 1 1 1 1 1 1 0 0 1 1 1 1 1 1 1 1
    tc qdisc add dev IF parent 1:2 handle 20: netem delay 5s limit 16

GF8078 the queue cannot be attached
"""

from __future__ import annotations

import os
import socket
import struct
from types import TracebackType
from typing import Self

from gustform.language.errors import GustformError
from gustform_hil.bus import Bus

_PASSES = 6  # SO_PRIORITY of what is not held back
_PRIORITY_MAP = bytes((1, 1, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1))  # band by priority
_STRANGER = 0x7FE  # identifier of the flood, nobody's

# linux/rtnetlink.h, linux/pkt_sched.h
_NEW_QDISC, _DELETE_QDISC = 36, 37
_REQUEST, _ACKNOWLEDGE, _REPLACE, _CREATE = 0x1, 0x4, 0x100, 0x400
_KIND, _OPTIONS, _NETEM_LATENCY64 = 1, 2, 10
_ROOT, _PRIO, _HELD_BAND, _NETEM = 0xFFFF_FFFF, 0x1_0000, 0x1_0002, 0x20_0000


class Flood:
    """A context: the queue is attached and full when it begins, and gone when it ends."""

    def __init__(self, bus: Bus, delay: float = 5.0, frames: int = 16) -> None:
        """`bus`: of the bench; what it sends passes. `delay`: how long frames are held back, s. It is longer than any
        pause of this computer, or the queue would empty by itself; what is in it at the end is thrown away."""
        self._bus, self._delay, self._frames = bus, delay, frames

    def __enter__(self) -> Self:
        self._bus.raw.setsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY, _PASSES)
        prio = struct.pack("=i16s", 3, _PRIORITY_MAP)
        netem = struct.pack("=6I", 0, self._frames, 0, 0, 0, 0)
        netem += _attribute(_NETEM_LATENCY64, struct.pack("=q", round(1e9 * self._delay)))
        interface = self._bus.interface
        _ask(interface, _NEW_QDISC, _CREATE | _REPLACE, _PRIO, _ROOT, "prio", prio)
        try:
            _ask(interface, _NEW_QDISC, _CREATE | _REPLACE, _NETEM, _HELD_BAND, "netem", netem)
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
        _ask(self._bus.interface, _DELETE_QDISC, 0, 0, _ROOT)


def _attribute(kind: int, payload: bytes) -> bytes:
    return struct.pack("=HH", 4 + len(payload), kind) + payload + bytes(-len(payload) % 4)


def _ask(interface: str, what: int, flags: int, handle: int, parent: int, kind: str = "", options: bytes = b"") -> None:
    """One request and its answer. GF8078."""
    body = struct.pack("=BxHiIII", 0, 0, socket.if_nametoindex(interface), handle, parent, 0)
    if kind:
        body += _attribute(_KIND, kind.encode() + b"\0") + _attribute(_OPTIONS, options)
    header = struct.pack("=IHHII", 16 + len(body), what, _REQUEST | _ACKNOWLEDGE | flags, 1, 0)
    try:
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as kernel:
            kernel.send(header + body)
            answer = kernel.recv(4096)
        code = -int(struct.unpack_from("=i", answer, 16)[0])
    except OSError as error:
        code = error.errno or -1
    if code != 0:
        raise GustformError(
            "GF8078",
            f"the queue of {interface} cannot be changed ({kind or 'delete'}); {os.strerror(code)}",
            hint="as root, or in hil/vcan/with-vcan; modprobe -a sch_prio sch_netem",
        )

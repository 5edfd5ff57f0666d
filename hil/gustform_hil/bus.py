"""Open a SocketCAN interface with python-can: clear errors in place of errno, and what is sent can be recorded.

GF8070 python-can is missing   GF8071 no such interface, or it is down   GF8072 the interface takes no CAN FD
GF8073 a frame could not be sent
"""

from __future__ import annotations

import errno
import re
import struct
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from gustform.language.errors import GustformError

if TYPE_CHECKING:
    import can

_NAME = re.compile(r"[A-Za-z0-9_.:-]{1,15}")  # IFNAMSIZ less the final zero
_FD_MTU = 72  # sizeof(struct canfd_frame)
_NETWORK = Path("/sys/class/net")
_BUFFER = 4 << 20  # bytes for what comes in while Python is busy; the kernel may give less

_HEADER = struct.Struct("=IBB2x")  # of struct can_frame and struct canfd_frame
_BIT_RATE_SWITCH = 1
_EXTENDED_FLAG, _IDENTIFIER = 0x8000_0000, 0x1FFF_FFFF
ERROR_FLAG = 0x2000_0000  # CAN_ERR_FLAG of linux/can.h
BUS_OFF = 0x40  # CAN_ERR_BUSOFF of linux/can/error.h

Tap = Callable[["can.Message"], None]


def python_can() -> Any:
    """The module `can`. GF8070."""
    try:
        import can
    except ImportError:
        raise GustformError(
            "GF8070", "python-can must be installed for this", hint="pip install 'gustform[hil]'"
        ) from None
    return can


def check_interface(interface: str, *, fd: bool) -> None:
    """That the interface is there, up, and takes the frames. GF8071, GF8072."""
    hint = "ip link add vcan0 type vcan; ip link set vcan0 mtu 72 up; or hil/vcan/with-vcan before the command"
    if not _NAME.fullmatch(interface) or interface in (".", ".."):
        raise GustformError("GF8071", f"{interface!r} must be the name of a CAN interface, 1 to 15 letters", hint=hint)
    folder = _NETWORK / interface
    try:
        kind, flags, mtu = (int((folder / name).read_text(), 0) for name in ("type", "flags", "mtu"))
    except (OSError, ValueError):
        there = sorted(one.name for one in _NETWORK.glob("*can*"))
        raise GustformError(
            "GF8071",
            f"the CAN interface {interface!r} must exist; there is {', '.join(there) if there else 'none'}",
            hint=hint,
        ) from None
    if kind != 280:  # ARPHRD_CAN
        raise GustformError("GF8071", f"{interface!r} must be a CAN interface; it is another kind", hint=hint)
    if not flags & 1:  # IFF_UP
        raise GustformError("GF8071", f"the interface {interface!r} must be up", hint=f"ip link set {interface} up")
    if fd and mtu < _FD_MTU:
        raise GustformError(
            "GF8072",
            f"{interface!r} must take CAN FD frames (mtu {_FD_MTU}); its mtu is {mtu}",
            hint=f"ip link set {interface} down; ip link set {interface} mtu {_FD_MTU} up; or --bus classic",
        )


class Bus:
    """One socket on an interface; a context. `taps` see every frame that it sends or receives, with its time."""

    def __init__(self, interface: str, *, fd: bool = True, only: Iterable[int] | None = None) -> None:
        """`only`: identifiers to receive; error frames are received in any case."""
        can = python_can()
        check_interface(interface, fd=fd)
        filters = None if only is None else [{"can_id": i, "can_mask": _IDENTIFIER} for i in only]
        try:
            self._bus: Any = can.Bus(interface="socketcan", channel=interface, fd=fd, can_filters=filters)
        except (OSError, can.CanError) as error:
            raise GustformError(
                "GF8071", f"{interface!r} cannot be opened; {error}", hint="another interface"
            ) from None
        self._grow()
        self._message = can.Message
        self._failed = can.CanOperationError
        self.interface, self.fd = interface, fd
        self.taps: list[Tap] = []

    def _grow(self) -> None:
        import socket

        raw: socket.socket = self._bus.socket
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the socket back."""
        self._bus.shutdown()

    @property
    def raw(self) -> Any:
        """The socket itself, for its options."""
        return self._bus.socket

    def send(self, identifier: int, data: bytes, *, fd: bool, extended: bool = False, error: bool = False) -> bool:
        """Send one frame; False if the queue was full (ENOBUFS) and the frame is gone. GF8073 for anything else."""
        # Past python-can, which asks the kernel for the time and for room before each frame: a lock-step pays for it.
        size, flags = (64, _BIT_RATE_SWITCH) if fd else (8, 0)
        kind = (ERROR_FLAG if error else 0) | (_EXTENDED_FLAG if extended else 0)
        frame = _HEADER.pack(identifier | kind, len(data), flags) + data.ljust(size, b"\0")
        try:
            self.raw.send(frame)
        except OSError as failure:
            if failure.errno in (errno.ENOBUFS, errno.EAGAIN):
                return False
            raise GustformError(
                "GF8073", f"a frame could not be sent on {self.interface}; {failure}", hint="a look at the interface"
            ) from None
        if self.taps:
            self._tell(identifier, data, fd, extended, error)
        return True

    def _tell(self, identifier: int, data: bytes, fd: bool, extended: bool, error: bool) -> None:
        message = self._message(
            arbitration_id=identifier,
            data=data,
            is_extended_id=extended,
            is_fd=fd,
            bitrate_switch=fd,
            is_error_frame=error,
            is_rx=False,
            timestamp=time.time(),
            channel=self.interface,
        )
        for tap in self.taps:
            tap(message)

    def receive(self, timeout: float) -> can.Message | None:
        """The next frame, or None after `timeout` s without one."""
        try:
            message: can.Message | None = self._bus.recv(timeout)
        except self._failed as failure:
            raise GustformError(
                "GF8073", f"nothing can be received on {self.interface}; {failure}", hint="a look at the interface"
            ) from None
        if message is not None:
            for tap in self.taps:
                tap(message)
        return message

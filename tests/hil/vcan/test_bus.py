"""The bus itself: frames pass between can-utils, python-can and plain sockets, each sender hears its own echo."""

from __future__ import annotations

import os
import socket
import struct
import subprocess

import can
import pytest

INTERFACE = os.environ.get("GUSTFORM_VCAN_INTERFACES", "vcan0").split(",")[0]
PATIENCE = 20.0
"""Seconds, for what takes microseconds on an idle machine."""


def test_an_fd_frame_of_can_utils_reaches_python_can() -> None:
    with can.Bus(interface="socketcan", channel=INTERFACE, fd=True) as bus:
        subprocess.run(["cansend", INTERFACE, "123##1" + bytes(range(64)).hex()], check=True, timeout=PATIENCE)
        frame = bus.recv(PATIENCE)
    assert frame is not None
    assert (frame.arbitration_id, frame.is_fd, frame.bitrate_switch) == (0x123, True, True)
    assert frame.data == bytes(range(64))


@pytest.mark.parametrize("length", [0, 8, 12, 64])
def test_a_sender_hears_its_own_frame_with_the_mark_of_an_echo(length: int) -> None:
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, 1)
        bus.bind((INTERFACE,))
        bus.settimeout(PATIENCE)
        data = bytes(range(length))
        bus.send(struct.pack("<IBB2x64s", 0x7FF, length, 1, data))
        frame, _, flags, _ = bus.recvmsg(128)
    assert struct.unpack("<IBB2x64s", frame)[3][:length] == data
    assert flags & socket.MSG_CONFIRM

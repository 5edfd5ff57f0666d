"""What stands in tests/hil/vcan needs a real CAN bus; without one each test there fails with the line to type."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

NEEDING_A_BUS = Path(__file__).resolve().parent / "vcan"
HOW = "make test-hil, or hil/vcan/with-vcan .venv/bin/python -m pytest tests/hil/vcan"


def interfaces() -> list[str]:
    """The interfaces that hil/vcan/with-vcan names, or vcan0 as a bench may have it."""
    return os.environ.get("GUSTFORM_VCAN_INTERFACES", "vcan0").split(",")


def complaint() -> str | None:
    """Why CAN FD frames cannot be sent here, or None."""
    for name in interfaces():
        try:
            with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
                bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
                bus.bind((name,))
        except OSError as error:
            return f"no CAN interface {name} here ({error.strerror})"
    return None


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Never a skip: a test of the bus that did not run has shown nothing."""
    if NEEDING_A_BUS in item.path.parents and (reason := complaint()):
        pytest.fail(f"{reason}; type {HOW}", pytrace=False)

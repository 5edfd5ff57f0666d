"""Waiting for something that another process or thread does."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE = 120.0  # s, for what takes a second or two on a machine of its own


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE) -> None:
    """Until it holds; an error if that takes longer than anybody's patience."""
    limit = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < limit
        time.sleep(0.01)

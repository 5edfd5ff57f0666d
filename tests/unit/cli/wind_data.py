"""Real wind files, which lie beside the checkout, and small ways to read files in tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform_cli.wind.rotor import Reader

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def whole(reader: Reader, most: int = 10_000_000) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """All samples of a reader, asked for in pieces as the runtime does."""
    times, speeds, first = [np.empty(0)], [np.empty(0)], 0
    while first < most:
        t, v = reader(first, 4096)
        times.append(t)
        speeds.append(v)
        first += t.size
        if t.size < 4096:
            break
    return np.concatenate(times), np.concatenate(speeds)

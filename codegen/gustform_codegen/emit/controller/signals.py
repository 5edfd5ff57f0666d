"""A named quantity of an exported controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Signal:
    """A named quantity of the controller. `value`: default of a parameter, start of a signal or state.

    `exclusive`: the lower bound itself is not allowed.
    """

    name: str
    symbol: Any
    unit: str
    description: str
    low: float
    high: float
    value: float
    nominal: float = 1.0
    exclusive: bool = False

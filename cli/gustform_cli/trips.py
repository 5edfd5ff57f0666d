"""Which turbines tripped and when, found as rows come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_SUFFIX = ".tripped"


@dataclass
class TripWatch:
    """Fed with blocks of rows in order; looks at the channels "NAME.tripped". `times`: of the first row with 1, s."""

    channels: Sequence[str]
    times: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._columns = [k for k, name in enumerate(self.channels) if name.endswith(_SUFFIX)]

    def add(self, times: NDArray[np.float64], rows: NDArray[np.float32]) -> None:
        """One block."""
        for column in self._columns:
            hit = np.flatnonzero(rows[:, column] > 0.5)
            if hit.size:
                self.times.setdefault(self.channels[column].removesuffix(_SUFFIX), float(times[hit[0]]))

"""Mean, standard deviation and extremes of every channel while a case runs, without its first seconds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gustform_codegen.table import Channel

if TYPE_CHECKING:
    from gustform_runtime import Statistics

# The deviation is the root of the mean square off the mean, as numpy.std gives it.
_NAMES = {"mean": "mean", "std": "deviation", "min": "minimum", "max": "maximum"}


class ChannelMoments:
    """Fed with blocks of rows, which come `every` s; looks at those from `transient` s on."""

    def __init__(self, channels: Sequence[Channel], every: float, transient: float) -> None:
        from gustform_runtime import Keep, Statistics

        self._channels = channels
        self._begin = transient - 1e-6 * every  # row times are multiples of a step that is no binary fraction
        self._statistics: Statistics = Statistics([Keep(k) for k in range(len(channels))], len(channels), every)

    def add(self, times: NDArray[np.float64], rows: NDArray[np.float32]) -> None:
        """One block."""
        first = int(np.searchsorted(times, self._begin))
        if first < times.size:
            self._statistics.add(times[first:], rows[first:])

    def scalars(self) -> dict[str, float]:
        """wt.P.mean, wt.P.std, wt.P.min, wt.P.max, ...; NaN for a run that ended before."""
        found = {}
        for number, channel in enumerate(self._channels):
            moments = self._statistics.moments(number)
            for name, attribute in _NAMES.items():
                found[f"{channel.name}.{name}"] = float(getattr(moments, attribute))
        return found

    @staticmethod
    def units(channels: Sequence[Channel]) -> dict[str, str]:
        """The unit of each scalar."""
        return {f"{channel.name}.{name}": channel.unit for channel in channels for name in _NAMES}

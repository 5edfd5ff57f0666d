"""The non-dominated set: what cannot be had better in one respect without losing in another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def non_dominated(costs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which rows of costs[n, k] no other row dominates, i.e. is at most as large everywhere and smaller somewhere.

    Everything is to be small. Equal rows stay together; a row with a NaN is not comparable and never in the set.
    Rows are looked at in the order of their sums: a row can only be dominated by one with a smaller sum, and if it is
    dominated at all, then by one of the set found so far.
    """
    count = costs.shape[0]
    kept = np.zeros(count, dtype=np.bool_)
    comparable = np.flatnonzero(~np.isnan(costs).any(axis=1))
    ranks = np.empty_like(costs)
    for column in range(costs.shape[1]):
        # Ranks in place of values: sums of them neither overflow nor lose a small difference in round-off.
        ranks[comparable, column] = np.unique(costs[comparable, column], return_inverse=True)[1]
    front: list[int] = []
    for row in comparable[np.argsort(ranks[comparable].sum(axis=1), kind="stable")]:
        found = ranks[front]
        if not ((found <= ranks[row]).all(axis=1) & (found < ranks[row]).any(axis=1)).any():
            front.append(int(row))
    kept[front] = True
    return kept

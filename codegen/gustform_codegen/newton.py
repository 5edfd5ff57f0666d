"""Newton's method for the steady state of a system of moderate size: most starts are so near that it needs three
steps. Where it does not come to a solution inside the bounds, or to one of many, it says so, and Ipopt, which is twenty
times as slow and far more patient, begins anew from the same start.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LARGEST = 300  # unknowns; beyond, a dense Jacobian costs more than Ipopt
_STEPS = 12
_SOLVED = 1e-11  # largest scaled residual; Ipopt is asked for 1e-10
_TOO_FAR = 1e3  # scaled step that no start near a solution needs
_SINGULAR = 1e-10  # smallest over largest singular value


def newton(
    residual: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Array,
    low: Array,
    high: Array,
) -> tuple[Array, int] | None:
    """A root of `residual` near `start` and within the bounds, with the steps it took; None if it is not found.

    All arguments are scaled. Columns whose bounds are equal stay. A direction that nothing determines (a DC voltage
    which no control looks at) ends the search: where a solution lies along it depends on how one goes there.
    """
    if start.size > _LARGEST:
        return None
    moving = low < high
    x = start.copy()
    r = residual(x)
    for step in range(_STEPS + 1):
        if not np.all(np.isfinite(r)):
            return None
        if np.max(np.abs(r), initial=0.0) <= _SOLVED:
            return x, step
        slopes = jacobian(x)[:, moving]
        if not np.all(np.isfinite(slopes)):
            return None
        change, _, rank, _ = np.linalg.lstsq(slopes, -r, rcond=_SINGULAR)
        if rank < min(slopes.shape) or np.max(np.abs(change), initial=0.0) > _TOO_FAR:
            return None
        x[moving] += change
        if np.any(x < low) or np.any(x > high):
            return None
        r = residual(x)
    return None

"""Newton's method for the steady state of a system of moderate size: most starts are so near that it needs three
steps. Where it does not come to a solution inside the bounds, or to one of many, it says so, and Ipopt, which is twenty
times as slow and far more patient, begins anew from the same start.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

_LARGEST = 300  # unknowns; beyond, a dense Jacobian costs more than Ipopt
_STEPS = 12
_SHORT_STEPS = 60
_HALVINGS = 8  # of a step, at most
_DESCENT = 0.1  # of what a whole step of a linear problem would take off the residual
_SOLVED = 1e-11  # largest scaled residual; Ipopt is asked for 1e-10
_TOO_FAR = 1e3  # scaled step that no start near a solution needs
_SINGULAR = 1e-10  # smallest over largest singular value


def newton(
    residual: Function,
    jacobian: Function,
    start: Array,
    low: Array,
    high: Array,
) -> tuple[Array, int] | None:
    """A root of `residual` near `start` and within the bounds, with the steps it took; None if it is not found.

    All arguments are scaled. Columns whose bounds are equal stay. A direction that nothing determines (a DC voltage
    which no control looks at) ends the search: where a solution lies along it depends on how one goes there. If whole
    steps lead nowhere, shorter ones are tried from the same start, each of which stays within the bounds and makes the
    residual smaller: a start far from the solution must not be thrown across a limiter.
    """
    if start.size > _LARGEST:
        return None
    for halvings, steps in ((0, _STEPS), (_HALVINGS, _SHORT_STEPS)):
        found = _search(residual, jacobian, start, low, high, steps, halvings)
        if found is not None:
            return found
    return None


def _search(
    residual: Function,
    jacobian: Function,
    start: Array,
    low: Array,
    high: Array,
    steps: int,
    halvings: int,
) -> tuple[Array, int] | None:
    moving = low < high
    x = start.copy()
    r = residual(x)
    for step in range(steps + 1):
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
        for shorter in range(halvings + 1):
            ahead = x.copy()
            ahead[moving] += change / 2.0**shorter
            if np.any(ahead < low) or np.any(ahead > high):
                continue
            r_ahead = residual(ahead)
            if halvings == 0 or np.linalg.norm(r_ahead) < (1.0 - _DESCENT / 2.0**shorter) * np.linalg.norm(r):
                x, r = ahead, r_ahead
                break
        else:
            return None
    return None

"""Where the power coefficient of a rotor is highest, and where it falls to a wanted value: bounded problems for Ipopt.

Each is a problem in one variable. Without a neighbour it is bracketed by a scan; with one, Ipopt starts from it. A row
of such problems (one wind speed each) is solved as one, since a call of Ipopt costs more than its iterations.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.aero.rotor import Rotor
from gustform.language.errors import GustformError

Array = NDArray[np.float64]

_SCAN = 241  # points of a scan that brackets a root: steps of about 0.05 in lambda or pitch, finer than any known table
_ON_TARGET = 1e-9  # of Cp: what a solution may miss

_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-13,
        "constr_viol_tol": 1e-13,
        "acceptable_tol": 1e-11,
        "acceptable_iter": 3,
        "bound_relax_factor": 0.0,
        "max_iter": 200,
    },
}


class CpSolver:
    """Solvers on the Cp of one rotor; take it from `cp_solver`, which makes one for each rotor."""

    def __init__(self, rotor: Rotor) -> None:
        self.name = type(rotor).__name__
        self.cp = rotor.power_coefficient()
        self.ratios = rotor.tip_speed_ratio_range()
        self.pitches = rotor.pitch_range()
        x, y, p = ca.MX.sym("x"), ca.MX.sym("y"), ca.MX.sym("p", 2)  # p: the other argument, the target
        best: Any = {"x": x, "p": p, "f": -self.cp(x, p[0])}
        ratio: Any = {"x": x, "p": p, "f": 0, "g": self.cp(x, p[0]) - p[1]}
        pitch: Any = {"x": x, "p": p, "f": 0, "g": self.cp(p[0], x) - p[1]}
        self._best = ca.nlpsol("best", "ipopt", best, _OPTIONS)
        self._ratio = ca.nlpsol("ratio", "ipopt", ratio, _OPTIONS)
        self._pitch = ca.nlpsol("pitch", "ipopt", pitch, _OPTIONS)
        self._scan = self.cp.map(_SCAN)
        value = self.cp(x, y)
        self._slopes = ca.Function("slopes", [x, y], [ca.jacobian(value, x), ca.jacobian(value, y)])
        self._rows: dict[int, tuple[Any, Any, Any]] = {}
        self._mpp: dict[float, float] = {}
        self._falling_ratio: dict[tuple[float, float], float | None] = {}
        self._falling_pitch: dict[tuple[float, float, float], float | None] = {}

    def value(self, ratio: float, pitch: float) -> float:
        """Cp, with the arguments held inside their ranges as the rotor does."""
        return float(self.cp(inside(ratio, self.ratios), inside(pitch, self.pitches)))

    def slopes(self, ratio: float, pitch: float) -> tuple[float, float]:
        """dCp/dlambda and dCp/dbeta (per deg); zero in an argument that is held at the edge of its range."""
        d_ratio, d_pitch = self._slopes(inside(ratio, self.ratios), inside(pitch, self.pitches))
        return (
            float(d_ratio) if self.ratios[0] <= ratio <= self.ratios[1] else 0.0,
            float(d_pitch) if self.pitches[0] <= pitch <= self.pitches[1] else 0.0,
        )

    def values(self, ratios: Array, pitches: Array) -> Array:
        """Cp at pairs of arguments, held inside their ranges."""
        mapped = self._row(ratios.size)[1]
        value = mapped(np.clip(ratios, *self.ratios)[None, :], np.clip(pitches, *self.pitches)[None, :])
        return np.asarray(value).ravel()

    def mpp(self, pitch: float) -> float:
        """The tip speed ratio of the highest Cp at a pitch angle."""
        if pitch not in self._mpp:
            scan = np.linspace(*self.ratios, _SCAN)
            k = int(np.argmax(self._along_ratio(scan, pitch)))
            low, high = float(scan[max(k - 1, 0)]), float(scan[min(k + 1, _SCAN - 1)])
            answer = self._best(x0=scan[k], p=[pitch, 0.0], lbx=low, ubx=high)
            self._mpp[pitch] = float(answer["x"])
        return self._mpp[pitch]

    def falling_ratio(self, pitch: float, target: float) -> float | None:
        """The tip speed ratio above the best one at which Cp falls to the target; None if it does not."""
        key = (pitch, target)
        if key not in self._falling_ratio:
            scan = np.linspace(self.mpp(pitch), self.ratios[1], _SCAN)
            below = np.flatnonzero(self._along_ratio(scan, pitch) <= target)
            below = below[below > 0]
            found = None
            if below.size:
                k = int(below[0])
                found = self._root(self._ratio, float(scan[k - 1]), float(scan[k]), [pitch, target])
            self._falling_ratio[key] = found
        return self._falling_ratio[key]

    def falling_pitch(self, ratio: float, target: float, low: float) -> float | None:
        """The highest pitch angle at which Cp falls through the target; None if it stays above."""
        key = (ratio, target, low)
        if key not in self._falling_pitch:
            bracket = self._bracket(ratio, target, low)
            self._falling_pitch[key] = None if bracket is None else self._root(self._pitch, *bracket, [ratio, target])
        return self._falling_pitch[key]

    def falling_pitches(self, ratios: Array, targets: Array, low: float, near: Array | None = None) -> Array:
        """`falling_pitch` of a row of points, solved as one problem; nan where Cp stays above the target.

        `near`: guesses, nan where there is none. Ipopt starts from a guess without a scan; where it does not arrive on
        the falling side, the point is solved again with one.
        """
        n = ratios.size
        lower, upper = np.full(n, low), np.full(n, self.pitches[1])
        start = np.full(n, np.nan) if near is None else np.clip(near, lower, upper)
        # Cp that has not fallen to the target at the highest pitch is no case for a guess: a scan has to tell.
        start[self.values(ratios, upper) > targets] = np.nan
        guessed = ~np.isnan(start)
        for k in np.flatnonzero(~guessed):
            bracket = self._bracket(float(ratios[k]), float(targets[k]), low)
            if bracket is not None:
                lower[k], upper[k] = bracket
                start[k] = 0.5 * (lower[k] + upper[k])
        wanted = ~np.isnan(start)
        # Points without a solution take part with a target that they meet where they start.
        start = np.where(wanted, start, 0.5 * (lower + upper))
        aims = np.where(wanted, targets, self.values(ratios, start))
        solver, mapped, slope = self._row(n)
        answer = solver(x0=start, p=np.concatenate([ratios, aims]), lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
        found = np.asarray(answer["x"]).ravel()
        miss = np.abs(np.asarray(mapped(ratios[None, :], found[None, :])).ravel() - aims)
        falling = np.asarray(slope(ratios[None, :], found[None, :])[1]).ravel() < 0.0
        for k in np.flatnonzero(wanted & ~((miss < _ON_TARGET) & (falling | ~guessed))):
            again = self.falling_pitch(float(ratios[k]), float(targets[k]), low)
            found[k] = np.nan if again is None else again
        return np.where(wanted, found, np.nan)

    def _row(self, n: int) -> tuple[Any, Any, Any]:
        """For n points at once: the pitch problem, Cp, and its slopes."""
        if n not in self._rows:
            mapped = self.cp.map(n)
            x, p = ca.MX.sym("x", n), ca.MX.sym("p", 2 * n)
            problem: Any = {"x": x, "p": p, "f": 0, "g": mapped(p[:n].T, x.T).T - p[n:]}
            self._rows[n] = (ca.nlpsol("row", "ipopt", problem, _OPTIONS), mapped, self._slopes.map(n))
        return self._rows[n]

    def _along_ratio(self, ratios: Array, pitch: float) -> Array:
        return np.asarray(self._scan(ratios[None, :], np.full((1, _SCAN), pitch))).ravel()

    def _bracket(self, ratio: float, target: float, low: float) -> tuple[float, float] | None:
        """Two neighbours in a scan of the pitch between which Cp falls through the target for the last time."""
        scan = np.linspace(low, self.pitches[1], _SCAN)
        surplus = np.asarray(self._scan(np.full((1, _SCAN), ratio), scan[None, :])).ravel() - target
        through = np.flatnonzero((surplus[:-1] > 0.0) & (surplus[1:] <= 0.0))
        if not through.size:
            return None
        k = int(through[-1])
        return float(scan[k]), float(scan[k + 1])

    def _root(self, solver: Any, low: float, high: float, p: list[float]) -> float:
        answer = solver(x0=0.5 * (low + high), p=p, lbx=low, ubx=high, lbg=0.0, ubg=0.0)
        miss = abs(float(answer["g"]))
        if not miss < _ON_TARGET:
            raise GustformError(
                "GF2024",
                f"no operating point of {self.name} between {low:g} and {high:g}: Ipopt ended with "
                f"{solver.stats()['return_status']}, Cp off by {miss:.2g}",
                hint="a smoother table of Cp",
            )
        return float(answer["x"])


def inside(value: float, bounds: tuple[float, float]) -> float:
    """The value, held within the bounds."""
    return min(max(value, bounds[0]), bounds[1])


_solvers: dict[Hashable, CpSolver] = {}


def cp_solver(rotor: Rotor) -> CpSolver:
    """The solvers on the Cp of a rotor, made once for all rotors that are alike."""
    key = rotor.aerodynamic_key()
    if key not in _solvers:
        _solvers[key] = CpSolver(rotor)
    return _solvers[key]

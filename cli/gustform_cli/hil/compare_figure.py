"""The figure of a comparison: what was on the bus over what was simulated, and beside it how far they are apart."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gustform_cli.figures import BLUE, GREY, ORANGE, RED, STYLE
from gustform_cli.hil.compare import Comparison, Pair

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROWS = 8  # quantities shown: those that come nearest to their tolerance
_LEAST = 1e-3  # height of an axis of values, so that round-off is not drawn as movement


def draw(comparison: Comparison, file: Path) -> Path:
    """One row for each quantity. GF7001 if it cannot be written."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from gustform_cli.png import save

    pairs = sorted(comparison.pairs, key=_share, reverse=True)[:_ROWS]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 1.0 + 1.55 * len(pairs)))
        axes = figure.subplots(len(pairs), 2, sharex=True, squeeze=False)
        for (left, right), pair in zip(axes, pairs, strict=True):
            _curves(left, pair)
            _difference(right, pair)
        axes[0, 0].legend(loc="best")
        for axis in axes[-1]:
            axis.set_xlabel("time (s)")
        figure.align_ylabels()
        verdict = "within tolerance" if comparison.good else "BEYOND TOLERANCE"
        figure.suptitle(
            f"{comparison.log} against {Path(comparison.result).name}: {verdict}",
            x=0.012,
            ha="left",
            fontsize=12,
            fontweight="bold",
        )
        left_out = len(comparison.pairs) - len(pairs)
        parts = [f"{comparison.samples} samples, {comparison.lost} lost, {comparison.damaged} damaged frames"]
        parts += [f"{left_out} quantities further within their tolerance are not shown"] if left_out else []
        figure.supxlabel("   ".join(parts), x=0.988, ha="right", fontsize=8, color=GREY)
        return save(figure, file)


def _share(pair: Pair) -> float:
    one = pair.compared
    return one.largest / one.tolerance if one.tolerance > 0.0 else np.inf if one.largest > 0.0 else 0.0


def _curves(axis: Axes, pair: Pair) -> None:
    one = pair.compared
    axis.set_title(one.quantity)
    axis.set_ylabel("" if one.unit == "1" else one.unit)
    axis.plot(pair.time, pair.simulated, color=BLUE, label="simulated", linewidth=2.2)
    axis.plot(pair.time, pair.logged, color=ORANGE, label="on the bus", linewidth=1.0)
    low, high = axis.get_ylim()
    if high - low < _LEAST:
        middle = 0.5 * (low + high)
        axis.set_ylim(middle - 0.5 * _LEAST, middle + 0.5 * _LEAST)
    axis.margins(x=0.0)


def _difference(axis: Axes, pair: Pair) -> None:
    one = pair.compared
    if one.largest > 0.0:
        axis.set_title(f"off by {one.largest:.2g} at {one.at:.2f} s, tolerance {one.tolerance:g}")
    else:
        axis.set_title("no difference")
    axis.plot(pair.time, pair.logged - pair.simulated, color=BLUE if one.good else RED, linewidth=1.0)
    height = 1.15 * max(one.largest, 1e-12)
    if one.tolerance < 20.0 * one.largest:  # else its lines would flatten the curve
        height = max(1.15 * one.tolerance, height)
        for side in (-1.0, 1.0):
            axis.axhline(side * one.tolerance, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)))
    axis.set_ylim(-height, height)
    axis.ticklabel_format(axis="y", style="sci", scilimits=(-3, 3))
    axis.margins(x=0.0)

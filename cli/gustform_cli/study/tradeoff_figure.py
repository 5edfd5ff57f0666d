"""The Pareto figure: fatigue over nadir with the energy as colour, and beside it what else the nadir costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gustform_cli.figures import DARK, GREY, RED, STYLE
from gustform_cli.png import save
from gustform_cli.study.tradeoff_design import FR, MPPT, PAPER
from gustform_cli.study.tradeoff_results import (
    CAPACITOR,
    ENERGY,
    FATIGUE,
    NADIR,
    PITCH,
    ROCOF,
    SHOCK,
    Measure,
    Row,
    compromise,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PAPER_CAPACITOR = 31.88  # mF


def draw(found: Sequence[Row], objectives: Sequence[Measure], steps_per_day: float, file: Path) -> Path:
    """Draw the figure; GF7001 if it cannot be saved."""
    import matplotlib as mpl
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, NullFormatter

    good = [row for row in found if not row.problem]
    chosen = compromise(found, objectives)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12.0, 6.4))
        axes: Any = figure.subplot_mosaic("AABC;AADE")
        energy = [row.measures[ENERGY.key] for row in good]
        norm = mpl.colors.Normalize(min(energy, default=0.0), max(energy, default=1.0))
        panels = (
            ("A", FATIGUE, f"Fatigue of the shaft: DEL, {steps_per_day:g} steps of 20 MW a day (MN m)"),
            ("B", CAPACITOR, "Smallest capacitor (mF)"),
            ("C", PITCH, "Pitch travel (deg/s)"),
            ("D", SHOCK, "Torque that the step adds (MN m)"),
            ("E", ROCOF, "RoCoF over 0.5 s (Hz/s)"),
        )
        for name, measure, title in panels:
            axis = axes[name]
            _points(axis, good, measure, norm)
            _marks(axis, found, chosen, measure, name == "A")
            axis.set_title(f"({name.lower()})  {title}")
            if name in "ADE":
                axis.set_xlabel("nadir of a 20 MW step (Hz)")
        axes["B"].set_yscale("log")
        axes["B"].axhline(_PAPER_CAPACITOR, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
        axes["B"].text(
            0.02, _PAPER_CAPACITOR * 1.1, "the paper's, 31.88 mF", fontsize=7.5, color="#555555", zorder=4,
            transform=axes["B"].get_yaxis_transform(), va="bottom",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
        axes["B"].yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes["B"].yaxis.set_minor_formatter(NullFormatter())
        bar = figure.colorbar(
            mpl.cm.ScalarMappable(norm=norm, cmap="viridis"), ax=axes["A"], location="bottom", aspect=40, pad=0.02,
            shrink=0.9, label="energy lost against maximum power (%)",
        )  # fmt: skip
        bar.outline.set_visible(False)
        figure.suptitle(
            "What frequency support costs: designs of dual-port control in turbulent wind",
            x=0.012, ha="left", fontsize=12, fontweight="bold",
        )  # fmt: skip
        return save(figure, file, dpi=110.0, scale=True)


def _points(axis: Axes, good: Sequence[Row], measure: Measure, norm: Any) -> None:
    """All designs, those of the front large and outlined."""
    for front in (False, True):
        some = [row for row in good if row.front is front and row.design not in PAPER]
        axis.scatter(
            [row.measures[NADIR.key] for row in some],
            [row.measures[measure.key] for row in some],
            c=[row.measures[ENERGY.key] for row in some],
            norm=norm,
            cmap="viridis",
            s=44 if front else 16,
            alpha=1.0 if front else 0.5,
            linewidths=0.8 if front else 0.0,
            edgecolors=DARK if front else "none",
            zorder=3 if front else 2,
            label="not dominated" if front else "dominated, or no capacitor does",
        )


def _marks(axis: Axes, found: Sequence[Row], chosen: Row | None, measure: Measure, named: bool) -> None:
    """The paper's two designs and the compromise."""
    marks: list[tuple[Row, str, str]] = []
    for row in found:
        if row.design in (FR, MPPT) and not row.problem:
            marks.append((row, f"the paper's {row.design.name}", "*" if row.design == FR else "P"))
    if chosen is not None and chosen.design not in PAPER:
        marks.append((chosen, "nearest to the best of each objective", "D"))
    for row, label, marker in marks:
        x, y = row.measures[NADIR.key], row.measures[measure.key]
        if np.isnan(y):
            continue
        ring = marker == "D"
        axis.scatter(
            [x], [y], marker=marker, s=95 if ring else 190 if marker == "*" else 110,
            facecolors="none" if ring else RED, edgecolors=RED if ring else "white",
            linewidths=1.8 if ring else 0.9, zorder=5, label=label,
        )  # fmt: skip
    if named:
        axis.legend(loc="best", fontsize=8.5)

"""The figures of the paper study, laid out as the paper's: (a)-(f) for each wind speed, the three controls overlaid.

The paper's own figures were not at hand; its text says what the panels are: (a) DC voltage, (b) power of the wind
turbines, (c) frequency of the synchronous generator, (d) frequency of the grid-side converter, (e) rotor speed,
(f) pitch angle. Colours and line styles stand for the controls in every figure of the study.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gustform_cli.figures import BLUE, DARK, GREEN, GREY, ORANGE, RED, STYLE
from gustform_cli.png import save
from gustform_cli.run_data import RunData
from gustform_cli.study.paper_cases import CONTROLS, GFL, GFM_FR, GFM_MPPT, Case, Control
from gustform_cli.study.paper_tables import Frequency
from gustform_codegen.modes import CONSTANT, REFERENCE, Modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LINES: Mapping[Control, Mapping[str, Any]] = {
    GFL: {"color": ORANGE, "linewidth": 2.2, "zorder": 2},
    GFM_MPPT: {"color": GREEN, "linewidth": 1.5, "linestyle": (0, (6, 2)), "zorder": 3},
    GFM_FR: {"color": BLUE, "linewidth": 1.7, "zorder": 4},
}
_MARKERS = {8: "o", 10: "s", 12: "^"}  # wind speeds, m/s
_BEFORE = 5.0  # s shown before the step
_SLOW = (-1.7, 5.9)  # real and imaginary part, 1/s: the corner of the second panel of eigenvalues


@dataclass(frozen=True)
class _Panel:
    title: str
    unit: str
    channel: str
    least: float  # smallest height of the value axis: a still quantity is drawn as a line, not as its round-off


_PANELS = (
    _Panel("DC voltage", "pu", "wt.v_dc", 0.01),
    _Panel("Power into the grid", "pu of 50 MVA", "wt.P_gsc", 0.02),
    _Panel("SG frequency", "Hz", "sg.frequency", 0.05),
    _Panel("GSC frequency", "Hz", "wt.frequency", 0.05),
    _Panel("Rotor speed", "pu", "wt.omega_r", 0.02),
    _Panel("Pitch angle", "deg", "wt.beta", 1.0),
)
_SAME_SCALE = ("sg.frequency", "wt.frequency")


def case_figure(wind: int, results: Mapping[Case, Path], frequency: Frequency, file: Path) -> Path:
    """The panels (a)-(f) at one wind speed, m/s, from the result files of its cases."""
    cases = [case for case in results if case.wind == wind]
    # What fits is known here; to find it out takes matplotlib as long as drawing.
    figure = _figure(8.6, 7.3, arranged=False)
    figure.subplots_adjust(left=0.085, right=0.985, bottom=0.06, top=0.925, wspace=0.2, hspace=0.2)
    axes = figure.subplots(3, 2, sharex=True)
    for letter, axis, panel in zip("abcdef", axes.ravel(), _PANELS, strict=True):
        axis.set_title(f"({letter})  {panel.title}")
        axis.set_ylabel(panel.unit)
    step, end = 0.0, 0.0
    for case in cases:
        with RunData(results[case]) as run:
            step, end = run.json("events")[0]["at"], float(run.time[-1])
            shown = run.time >= step - _BEFORE
            for axis, panel in zip(axes.ravel(), _PANELS, strict=True):
                values = run.curve(panel.channel).values[shown]
                axis.plot(run.time[shown], values, label=case.control.label, **_LINES[case.control])
    for axis, panel in zip(axes.ravel(), _PANELS, strict=True):
        axis.axvline(step, color=GREY, linewidth=0.9, linestyle=(0, (2, 2)), zorder=1)
        axis.set_xlim(step - _BEFORE, end)
        _keep_height(axis, panel.least)
    same = [axis for axis, panel in zip(axes.ravel(), _PANELS, strict=True) if panel.channel in _SAME_SCALE]
    low, high = min(axis.get_ylim()[0] for axis in same), max(axis.get_ylim()[1] for axis in same)
    for axis in same:
        axis.set_ylim(low, high)
    low, high = axes[0, 0].get_ylim()
    axes[0, 0].set_ylim(low, high + 0.14 * (high - low))  # room for the words above the curves
    axes[0, 0].annotate(
        "+20 MW load", (step, 1.0), xycoords=("data", "axes fraction"), xytext=(4, -2), textcoords="offset points",
        va="top", fontsize=8.5, color="#555555",
    )  # fmt: skip
    _write_nadirs(axes[1, 0], cases, frequency)
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    figure.align_ylabels()
    _heading(figure, f"20 MW load step at {wind} m/s", cases, axes[0, 0])
    return save(figure, file)


def eigenvalue_figure(found: Mapping[Case, Modes], file: Path) -> Path:
    """The eigenvalues of all cases: the whole plane on logarithmic axes, and the slow modes."""
    figure = _figure(8.6, 4.3, arranged=True)
    left, right = figure.subplots(1, 2)
    for case, modes in found.items():
        # Pairs are symmetric; the angle that everything is measured against is no mode of the system.
        some = [
            v
            for v, kind in zip(modes.eigenvalues, modes.kinds, strict=True)
            if v.imag >= 0.0 and kind not in (REFERENCE, CONSTANT)
        ]
        for axis in (left, right):
            axis.plot(
                np.real(some), np.imag(some), _MARKERS[case.wind], color=_LINES[case.control]["color"],
                markersize=5.5, markerfacecolor="none", markeredgewidth=1.3, zorder=4, clip_on=axis is right,
            )  # fmt: skip
    left.set_title("(a)  All modes, logarithmic axes")
    left.set_xscale("symlog", linthresh=0.1, linscale=0.5)
    left.set_yscale("symlog", linthresh=0.1, linscale=0.5)
    left.set_ylim(bottom=-0.015)
    _decades(left)
    right.set_title("(b)  Slow modes")
    right.set_xlim(_SLOW[0], 0.12)
    right.set_ylim(-0.12, _SLOW[1])
    _damping_rays(right, (0.05, 0.1, 0.2, 0.5))
    for axis in (left, right):
        axis.set_xlabel("real part (1/s)")
        axis.set_ylabel("imaginary part (rad/s)")
        axis.axvline(0.0, color=DARK, linewidth=0.9, zorder=1)
        axis.axvspan(0.0, axis.get_xlim()[1], color=RED, alpha=0.12, linewidth=0.0, zorder=0)
        axis.set_xlim(axis.get_xlim())
    _heading(figure, "Eigenvalues", list(found), None)
    return save(figure, file)


def _figure(width: float, height: float, *, arranged: bool) -> Figure:
    import matplotlib as mpl  # half a second: after the runs
    from matplotlib.figure import Figure

    mpl.rcParams.update({**STYLE, "figure.constrained_layout.use": arranged})
    return Figure(figsize=(width, height))


def _keep_height(axis: Axes, least: float) -> None:
    low, high = axis.get_ylim()
    if high - low < least:
        # Nothing here goes below zero: a pitch angle of 0 stands on the floor.
        bottom = max(0.5 * (low + high - least), -0.05 * least)
        axis.set_ylim(bottom, bottom + least)


def _write_nadirs(axis: Axes, cases: Sequence[Case], frequency: Frequency) -> None:
    """The nadirs in the colours of their curves, where the curves leave room."""
    for row, case in enumerate(cases):
        nadir = frequency[case.control.key][str(case.wind)]["nadir_hz"]
        if nadir is None:
            continue
        axis.text(
            0.985, 0.91 - 0.105 * row, f"nadir {nadir:.3f} Hz", transform=axis.transAxes, ha="right",
            fontsize=8.5, color=_LINES[case.control]["color"], fontweight="bold", zorder=5,
        )  # fmt: skip


def _heading(figure: Figure, text: str, cases: Sequence[Case], axis: Axes | None) -> None:
    """The title at the left, the controls (and, without an axis to take them from, the wind speeds) at the right."""
    from matplotlib.lines import Line2D

    top = {"y": 0.993} if axis is not None else {}  # where matplotlib does not arrange it, it would stand too low
    figure.suptitle(text, x=0.012, ha="left", fontsize=12, fontweight="bold", **top)
    shown = [control for control in CONTROLS if any(case.control is control for case in cases)]
    if axis is not None:
        handles = [Line2D([], [], **_LINES[control]) for control in shown]
        labels = [control.label for control in shown]
    else:
        handles = [Line2D([], [], color=_LINES[control]["color"], linewidth=3.0) for control in shown]
        winds = sorted({case.wind for case in cases})
        handles += [
            Line2D([], [], linestyle="", marker=_MARKERS[w], color=GREY, markerfacecolor="none", markersize=5.5)
            for w in winds
        ]
        labels = [control.label for control in shown] + [f"{w} m/s" for w in winds]
    figure.legend(
        handles, labels, loc="upper right", ncols=len(labels), frameon=False, bbox_to_anchor=(1.0, 1.005),
        handlelength=2.2, columnspacing=1.3,
    )  # fmt: skip


def _decades(axis: Axes) -> None:
    """Ticks at every other power of ten, which do not run into each other round zero."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    for one, (low, high) in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
        ticks = [t for k in range(-1, 5) for t in (-(10.0**k), 10.0**k) if low <= t <= high]
        one.set_major_locator(FixedLocator([0.0, *ticks]))
        one.set_minor_locator(NullLocator())
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _damping_rays(axis: Axes, ratios: Sequence[float]) -> None:
    """Lines of constant damping ratio, each named where it leaves the panel."""
    (left, _), (_, top) = axis.get_xlim(), axis.get_ylim()
    for ratio in ratios:
        slope = np.sqrt(1.0 - ratio**2) / ratio
        x = min(abs(left), top / slope)
        axis.plot([0.0, -x], [0.0, slope * x], color=GREY, linewidth=0.7, linestyle=(0, (5, 4)), zorder=1)
        inside = x < abs(left)
        axis.annotate(
            f"{ratio:.0%}", (-x, slope * x), xytext=(3, -9) if inside else (4, 3), textcoords="offset points",
            fontsize=7.5, color=GREY, ha="left",
        )  # fmt: skip

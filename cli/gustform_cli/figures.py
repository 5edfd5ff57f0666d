"""The figure of a run, from its result file alone: six panels after the source paper's case-study figures.

Which they are is said in `panels.py`. Components that stand there several times are thin lines with their mean on top.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.frequency import SETTLE_AFTER
from gustform_cli.panels import FREQUENCY, WIND, Filled, Panel, filled_panels, still
from gustform_cli.progress import times
from gustform_cli.run_data import RunData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours, told apart by everyone.
BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#777777"
DARK = "#222222"
_COLOURS = (BLUE, ORANGE, GREEN, RED)

STYLE: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#444444",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.5,
    "legend.framealpha": 0.8,  # long runs fill their panels
    "legend.edgecolor": "none",
    "legend.fontsize": 8.5,
    # With it a level line of many points jumps by a pixel where the renderer begins its next piece.
    "path.snap": False,
    "figure.constrained_layout.use": True,
    "agg.path.chunksize": 500,  # keeps the rasteriser's memory small on noisy lines
}


def draw(result: Path, figure: Path) -> Path:
    """Draw the figure of a result file. GF7002 if it is none or has nothing to draw, GF7001 if it cannot be saved."""
    with RunData(result) as run:
        panels = filled_panels(run)
        if not panels:
            raise GustformError(
                "GF7002",
                f"{str(result)!r} must have a channel that the figure shows; it has {', '.join(run.names()[:8])}",
                hint="output.channels: ['*']",
            )
        _draw_panels(panels, run, figure)
    return figure


def _draw_panels(panels: Filled, run: RunData, figure: Path) -> None:
    import matplotlib as mpl  # a second: only when there is something to draw
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        rows = -(-len(panels) // 2)
        canvas = Figure(figsize=(10.0, 0.9 + 2.3 * rows))
        FigureCanvasAgg(canvas)
        axes = canvas.subplots(rows, 2, sharex=True, squeeze=False).ravel()
        for letter, axis, (panel, curves) in zip("abcdefgh", axes, panels, strict=False):
            _draw_panel(axis, letter, panel, curves, run)
            if panel.title == FREQUENCY.title:
                _mark_frequency(axis, run)
        for axis in axes[len(panels) :]:
            axis.set_axis_off()
        for axis in axes[max(0, len(panels) - 2) : len(panels)]:
            _name_time(axis, run.time[-1] - run.time[0])
            axis.tick_params(labelbottom=True)
        canvas.align_ylabels()
        canvas.suptitle(_heading(run), x=0.012, ha="left", fontsize=12, fontweight="bold")
        canvas.supxlabel(_footing(run), x=0.988, ha="right", fontsize=8, color=GREY)
        try:
            canvas.savefig(figure, dpi=150)
        except (OSError, ValueError) as error:
            raise GustformError(
                "GF7001", f"the figure {str(figure)!r} cannot be written; {error}", hint="--out with another file"
            ) from None


def _heading(run: RunData) -> str:
    status = run.attribute("status")
    title = run.attribute("title")
    return title if status == "completed" else f"{title} ({status} at {run.time[-1]:g} s)"


def _footing(run: RunData) -> str:
    statistics, versions = run.json("statistics") or {}, run.json("versions") or {}
    parts = [f"gustform {versions['gustform']}"] if "gustform" in versions else []
    if statistics.get("steps"):
        parts.append(f"{statistics['unknowns']} unknowns, {statistics['steps']} steps")
        parts.append(f"{times(statistics['real_time_factor'])} x real time")
    return "   ".join(parts)


def _draw_panel(
    axis: Axes, letter: str, panel: Panel, curves: Sequence[tuple[str, NDArray[np.float64]]], run: RunData
) -> None:
    axis.set_title(f"({letter})  {panel.title}")
    axis.set_ylabel(panel.unit)
    for (label, values), colour in zip(curves, _COLOURS * len(curves), strict=False):
        if values.ndim == 1:
            axis.plot(run.time, values, color=colour, label=label)
            continue
        axis.plot(run.time, values[:, :50], color=colour, alpha=max(0.15, 0.8 / values.shape[1] ** 0.5), linewidth=0.7)
        axis.plot(run.time, values.mean(axis=1), color=colour, label=f"{label}, mean of {values.shape[1]}")
    _keep_height(axis, panel.least)
    axis.set_xlim(run.time[0], run.time[-1])
    for event in run.json("events") or ():
        axis.axvline(event["at"], color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    trips = (run.json("statistics") or {}).get("trips") or {}
    for time in trips.values():
        axis.axvline(time, color=RED, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
    if letter == "a":
        _name_events(axis, run)
        _name_trips(axis, trips)
    if len(curves) > 1 or any(values.ndim > 1 for _, values in curves):
        axis.legend(loc="best")


_HOURS_FROM, _DAYS_FROM = 2.5 * 3600.0, 4.0 * 86_400.0  # s


def _unit_of_time(span: float) -> tuple[str, float]:
    """Seconds, hours or days, and how many seconds they have."""
    if span < _HOURS_FROM:
        return "s", 1.0
    return ("h", 3600.0) if span < _DAYS_FROM else ("d", 86_400.0)


def _name_time(axis: Axes, span: float) -> None:
    """The axis of time; `span` in s."""
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    unit, seconds = _unit_of_time(span)
    axis.set_xlabel(f"time ({unit})")
    if seconds == 1.0:
        return
    length = span / seconds
    steps = (0.5, 1, 2, 3, 6, 12, 24) if unit == "h" else (0.5, 1, 2, 5, 10, 20, 50, 100, 200)
    every = next((step for step in steps if length / step <= 9), length / 8)
    axis.xaxis.set_major_locator(MultipleLocator(seconds * every))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / seconds:g}"))


def _moment(time: float, span: float, digits: int) -> str:
    """A time on the axis, in its unit."""
    unit, seconds = _unit_of_time(span)
    return f"{time:.{digits}f} s" if seconds == 1.0 else f"{time / seconds:.2f} {unit}"


def _keep_height(axis: Axes, least: float) -> None:
    low, high = axis.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axis.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def _name_events(axis: Axes, run: RunData) -> None:
    """What happens at the dashed lines, once, in the first panel."""
    events = (run.json("events") or ())[:4]
    if events:
        low, high = axis.get_ylim()
        axis.set_ylim(low, high + 0.12 * (high - low))  # room for the text above the curves
    for event in events:
        text = ", ".join(f"{target} = {value}" for target, value in event["set"].items())
        axis.annotate(
            text,
            (event["at"], 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(4, -3),
            textcoords="offset points",
            va="top",
            fontsize=8,
            color="#555555",
        )


def _name_trips(axis: Axes, trips: Mapping[str, float]) -> None:
    """Who trips at the first dotted line, in the first panel."""
    if trips:
        name, time = min(trips.items(), key=lambda trip: trip[1])
        axis.annotate(
            f"{name} trips" if len(trips) == 1 else f"{name} trips, then {len(trips) - 1} more",
            (time, 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(4, 14),
            textcoords="offset points",
            fontsize=8,
            color=RED,
        )


def _mark_frequency(axis: Axes, run: RunData) -> None:
    """The lowest grid frequency after the first event, and where the frequency settles."""
    name = run.attribute("frequency_channel")
    if name not in run.names():
        return
    values = run.curve(name).values
    begin = min((event["at"] for event in run.json("events") or ()), default=run.time[0])
    figures = (run.json("statistics") or {}).get("frequency") or {}
    nadir, at = figures.get("nadir_hz"), figures.get("nadir_time_s")
    if nadir is None or at is None or np.ptp(values[run.time >= begin]) < 1e-3:
        return
    low, high = axis.get_ylim()
    axis.set_ylim(low - 0.1 * (high - low), high)  # room for the text below the curve
    span = run.time[-1] - run.time[0]
    word = "nadir" if run.json("events") else "lowest"  # nothing that it would be the answer to
    _point_out(axis, at, nadir, f"{word} {nadir:.3f} Hz at {_moment(at, span, 1)}")
    settled = figures.get("settle_hz")
    if settled is not None and run.attribute("status") == "completed" and still(run, WIND):
        time = min(begin + SETTLE_AFTER, run.time[-1])
        _point_out(axis, time, settled, f"{settled:.3f} Hz at {_moment(time, span, 0)}")


def _point_out(axis: Axes, time: float, value: float, text: str) -> None:
    begin, end = axis.get_xlim()
    place = (time - begin) / (end - begin)
    side = "right" if place > 0.8 else "left" if place < 0.2 else "center"
    axis.plot([time], [value], "o", color=DARK, markersize=4, zorder=5, clip_on=False)
    axis.annotate(
        text, (time, value), xytext=(0, -6), textcoords="offset points", ha=side, va="top", fontsize=8.5, color=DARK
    )

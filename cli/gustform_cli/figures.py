"""The figure of a run, from its result file alone: six panels after the source paper's case-study figures.

(a) DC voltage, (b) power, (c) frequency, (d) rotor speed, (e) pitch angle, (f) wind, or the power of generator and load
where the wind is constant. Components that stand there several times are thin lines with their mean on top.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.frequency import SETTLE_AFTER
from gustform_cli.progress import times
from gustform_cli.run_data import Curve, RunData

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


@dataclass(frozen=True)
class _Line:
    """What to draw: channels whose name ends like this, and how to call them."""

    pattern: str
    label: str
    scale: Callable[[Curve], NDArray[np.float64]] = lambda curve: curve.values


@dataclass(frozen=True)
class _Panel:
    title: str
    unit: str
    lines: tuple[_Line, ...]
    least: float  # smallest height of the value axis: a still quantity is drawn as a line, not as its round-off


def _mega(curve: Curve) -> NDArray[np.float64]:
    return curve.values / 1e6


_POWER = _Panel(
    "Power",
    "pu",
    (_Line(r"\.P_wt", "from the wind"), _Line(r"\.P_gsc", "grid-side converter")),
    0.02,
)
_PLANT = _Panel(
    "Active power in the grid",
    "MW",
    (_Line(r"\.P", "{component}", _mega),),
    1.0,
)
_WIND = _Panel("Wind", "m/s", (_Line(r"\.wind", "rotor-effective wind"),), 1.0)
_FREQUENCY = _Panel("Frequency", "Hz", (_Line(r"\.frequency", "{role} ({component})"),), 0.05)
_PANELS = (
    _Panel("DC voltage", "pu", (_Line(r"\.v_dc", "DC voltage"),), 0.01),
    _POWER,
    _FREQUENCY,
    _Panel("Rotor speed", "pu", (_Line(r"\.omega_r", "rotor"),), 0.02),
    _Panel("Pitch angle", "deg", (_Line(r"\.beta", "blades"),), 1.0),
)


# Panels with their curves: label and values.
Filled = list[tuple[_Panel, list[tuple[str, NDArray[np.float64]]]]]


def draw(result: Path, figure: Path) -> Path:
    """Draw the figure of a result file. GF7002 if it is none or has nothing to draw, GF7001 if it cannot be saved."""
    with RunData(result) as run:
        panels = _filled(run)
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
            if panel.title == _FREQUENCY.title:
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


def _filled(run: RunData) -> Filled:
    """The panels that the run has channels for."""
    filled: Filled = []
    for panel in (*_PANELS, _PLANT if _still(run, _WIND) else _WIND):
        curves = _curves(run, panel)
        if curves:
            filled.append((panel, curves))
    return filled


def _still(run: RunData, panel: _Panel) -> bool:
    return all(np.ptp(values) < 1e-6 for _, values in _curves(run, panel))


def _curves(run: RunData, panel: _Panel) -> list[tuple[str, NDArray[np.float64]]]:
    """Labels and values, for each line of the panel and each component that has such a channel."""
    result = []
    for line in panel.lines:
        found = [name for name in run.names() if re.fullmatch(r"[^.]+" + line.pattern, name)]
        for name in found:
            component = name.split(".")[0]
            role = "grid" if name == run.attribute("frequency_channel") else "grid-side converter"
            label = line.label.format(component=component, role=role)
            if len(found) > 1 and component not in label:
                label = f"{label}, {component}"
            curve = run.curve(name)
            result.append((label, line.scale(curve)))
    # The grid's own frequency comes last, so that it lies on top of those that follow it.
    return sorted(result, key=lambda curve: curve[0].startswith("grid ("))


def _draw_panel(
    axis: Axes, letter: str, panel: _Panel, curves: Sequence[tuple[str, NDArray[np.float64]]], run: RunData
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


def _name_time(axis: Axes, span: float) -> None:
    """Seconds, or hours where the run is long; `span` in s."""
    from matplotlib.ticker import FuncFormatter, MultipleLocator

    if span < 2.5 * 3600.0:
        axis.set_xlabel("time (s)")
        return
    hours = span / 3600.0
    every = next((h for h in (0.5, 1, 2, 3, 6, 12, 24, 48, 120, 240, 480, 720) if hours / h <= 9), hours / 8)
    axis.xaxis.set_major_locator(MultipleLocator(3600.0 * every))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 3600.0:g}"))
    axis.set_xlabel("time (h)")


def _keep_height(axis: Axes, least: float) -> None:
    low, high = axis.get_ylim()
    if high - low < least:
        middle = 0.5 * (low + high)
        axis.set_ylim(middle - 0.5 * least, middle + 0.5 * least)


def _name_events(axis: Axes, run: RunData) -> None:
    """What happens at the dashed lines, once, in the first panel."""
    for event in (run.json("events") or ())[:4]:
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
    _point_out(axis, at, nadir, f"nadir {nadir:.3f} Hz at {at:.1f} s")
    settled = figures.get("settle_hz")
    if settled is not None and run.attribute("status") == "completed" and _still(run, _WIND):
        time = min(begin + SETTLE_AFTER, run.time[-1])
        _point_out(axis, time, settled, f"{settled:.3f} Hz at {time:.0f} s")


def _point_out(axis: Axes, time: float, value: float, text: str) -> None:
    begin, end = axis.get_xlim()
    place = (time - begin) / (end - begin)
    side = "right" if place > 0.8 else "left" if place < 0.2 else "center"
    axis.plot([time], [value], "o", color=DARK, markersize=4, zorder=5, clip_on=False)
    axis.annotate(
        text, (time, value), xytext=(0, -6), textcoords="offset points", ha=side, va="top", fontsize=8.5, color=DARK
    )

"""The figure of the eigenvalue plane: all modes on logarithmic axes, the slow ones on plain axes with damping rays.

Pairs are symmetric, so only the upper half plane is drawn. Colours are those of the component that takes part most.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from gustform_cli.figures import BLUE, DARK, GREEN, GREY, ORANGE, RED, STYLE
from gustform_cli.png import save
from gustform_codegen.modes import CONSTANT, REFERENCE, Mode, Modes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = (BLUE, ORANGE, GREEN, "#CC79A7", "#56B4E9", "#F0E442")
_SLOW = 8.0  # rad/s: modes nearer to the origin than this are those of the second panel, if there are any
_RAYS = (0.05, 0.1, 0.2, 0.4)  # damping ratios
_NAMED = 6  # modes with a label in each panel
_FADING = 0.8  # damping ratio above which a mode is no oscillation worth a label


def draw(modes: Modes, title: str, file: Path) -> Path:
    """Draw the eigenvalues; GF7001 if the figure cannot be saved."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    components = dict.fromkeys(_component(q.name) for q in modes.states)
    colours = {name: _COLOURS[k % len(_COLOURS)] for k, name in enumerate(components)}
    slow = [m for m in modes.listed if abs(m.eigenvalue) <= _SLOW]
    if len(slow) < 2:
        slow = sorted(modes.listed, key=lambda m: abs(m.eigenvalue))[: max(2, len(modes.listed) // 2)]
    with mpl.rc_context(STYLE):
        canvas = Figure(figsize=(10.5, 4.8))
        FigureCanvasAgg(canvas)
        left, right = canvas.subplots(1, 2, width_ratios=(1.0, 1.05))
        _all(left, modes.listed, colours)
        _label(left, [m for m in modes.listed if m not in slow], -3.0)
        _near(right, slow, colours)
        handles = [mpl.lines.Line2D([], [], linestyle="", marker="x", markersize=7, markeredgewidth=1.8, color=c)
                   for c in colours.values()]  # fmt: skip
        labels = list(colours)
        if any(m.kind == REFERENCE for m in modes.listed):
            handles.append(mpl.lines.Line2D([], [], linestyle="", marker="s", markerfacecolor="none", color=GREY))
            labels.append("reference angle")
        left.legend(handles, labels, title="most of it in", loc="upper right", fontsize=8, title_fontsize=8)
        verdict = "stable" if modes.stable else "NOT STABLE"
        canvas.suptitle(f"{title}: {verdict}", x=0.012, ha="left", fontsize=11.5, fontweight="bold")
        return save(canvas, file)


def _component(state: str) -> str:
    return state.split(".")[0].split("[")[0]


def _point(axis: Axes, mode: Mode, colours: dict[str, str]) -> None:
    value = mode.eigenvalue
    if mode.kind in (REFERENCE, CONSTANT):
        axis.plot([0.0], [0.0], "s", markersize=8, markerfacecolor="none", color=GREY, zorder=4, clip_on=False)
        return
    colour = colours[_component(mode.participation[0][0])]
    axis.plot([value.real], [value.imag], "x", markersize=7, markeredgewidth=1.8, color=colour, zorder=5, clip_on=False)


def _right_half(axis: Axes) -> None:
    """Red where things grow."""
    low, high = axis.get_xlim()
    axis.axvspan(0.0, high, color=RED, alpha=0.10, linewidth=0.0, zorder=0)
    axis.axvline(0.0, color=DARK, linewidth=0.9, zorder=1)
    axis.set_xlim(low, high)


def _all(axis: Axes, modes: list[Mode], colours: dict[str, str]) -> None:
    axis.set_title("(a)  All modes, logarithmic")
    for mode in modes:
        _point(axis, mode, colours)
    reals = [m.eigenvalue.real for m in modes]
    highest = max([abs(m.eigenvalue) for m in modes] + [1.0])
    axis.set_xscale("symlog", linthresh=0.1, linscale=0.6)
    axis.set_yscale("symlog", linthresh=0.1, linscale=0.6)
    axis.set_xlim(-3.0 * highest, max(1.0, 3.0 * max(reals)))
    axis.set_ylim(-0.02, 30.0 * max([m.eigenvalue.imag for m in modes] + [1.0]))
    _sparse(axis)
    axis.set_xlabel("real part (1/s)")
    axis.set_ylabel("imaginary part (rad/s)")
    _right_half(axis)


def _sparse(axis: Axes) -> None:
    """Ticks that do not run into each other round zero."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    def text(value: float, _: object) -> str:
        return f"{value:g}" if abs(value) < 1000.0 else f"{value / 1000.0:g}k"

    for one, (low, high) in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
        decades = [10.0**k for k in range(-1, 8)]
        ticks = [t for d in decades for t in (-d, d) if low <= t <= high]
        one.set_major_locator(FixedLocator([0.0, *ticks]))
        one.set_minor_locator(NullLocator())
        one.set_major_formatter(FuncFormatter(text))


def _near(axis: Axes, modes: list[Mode], colours: dict[str, str]) -> None:
    axis.set_title("(b)  Slow modes")
    for mode in modes:
        _point(axis, mode, colours)
    reals, imags = [m.eigenvalue.real for m in modes], [m.eigenvalue.imag for m in modes]
    left = min(1.15 * min(reals), -0.1)
    top = max(1.25 * max(imags), 0.3 * abs(left), 0.1)
    axis.set_xlim(left, max(0.12 * abs(left), 1.6 * max(reals)))
    axis.set_ylim(-0.02 * top, top)
    for damping in _RAYS:
        slope = math.sqrt(1.0 - damping**2) / damping
        x = min(abs(left), top / slope)
        axis.plot([0.0, -x], [0.0, slope * x], color=GREY, linewidth=0.7, linestyle=(0, (5, 4)), zorder=1)
        axis.annotate(
            f"{damping:.0%}", (-x, slope * x), xytext=(0, 2) if x < abs(left) else (3, 3), textcoords="offset points",
            fontsize=7.5, color=GREY, ha="center" if x < abs(left) else "left", va="bottom", annotation_clip=False,
        )  # fmt: skip
    _right_half(axis)
    _label(axis, modes, 0.45 * left)
    axis.set_xlabel("real part (1/s)")
    axis.set_ylabel("imaginary part (rad/s)")


def _label(axis: Axes, modes: list[Mode], middle: float) -> None:
    """What the least damped oscillations are, on the side with more room."""
    swinging = [m for m in modes if m.eigenvalue.imag > 0.0 and (m.damping or 0.0) < _FADING]
    for mode in sorted(swinging, key=lambda m: m.damping or 0.0)[:_NAMED]:
        value = mode.eigenvalue
        to_the_left = value.real > middle
        axis.annotate(
            f"{_hertz(mode.frequency)}, damping {mode.damping:.1%}\n{mode.participation[0][0]}",
            (value.real, value.imag),
            xytext=(-9 if to_the_left else 9, 0),
            textcoords="offset points",
            ha="right" if to_the_left else "left",
            va="center",
            fontsize=8,
            color=DARK,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
            zorder=3,
        )


def _hertz(frequency: float) -> str:
    return f"{frequency:.2g} Hz" if frequency < 100.0 else f"{frequency:.0f} Hz"

"""The figure of the stability study: above how far the rightmost eigenvalue is from the axis, below where they go."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gustform_cli.figures import BLUE, DARK, GREEN, GREY, ORANGE, RED, STYLE
from gustform_cli.png import save
from gustform_cli.study.stability import Curve, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STYLES: dict[str, dict[str, Any]] = {
    "simplified": {"color": BLUE, "linestyle": "--"},
    "simplified_filtered": {"color": "#56B4E9", "linestyle": ":", "linewidth": 2.2},
    "simplified_no_governor": {"color": "#56B4E9", "linestyle": ":", "linewidth": 2.2},
    "rms": {"color": DARK},
    "rms_dead_band": {"color": ORANGE},
    "rms_dead_band_moved": {"color": GREEN, "linestyle": "", "marker": "o", "markersize": 4, "markerfacecolor": "none"},
}
# What the lower panels show of the full model: model, real and imaginary range.
_WINDOWS = {
    "T_dc": ("rms", (-130.0, 25.0), (0.0, 165.0)),
    "K_d_ratio": ("rms", (-130.0, 25.0), (0.0, 135.0)),
    "K_wt": ("rms", (-0.30, 0.20), (0.0, 0.20)),
}


def draw(sweeps: Sequence[Sweep], file: Path) -> Path:
    """Draw the sweeps side by side; GF7001 if the figure cannot be saved."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        canvas = Figure(figsize=(13.5, 7.4))
        FigureCanvasAgg(canvas)
        axes = canvas.subplots(2, len(sweeps))
        for k, sweep in enumerate(sweeps):
            _margin(axes[0, k], "abc"[k], sweep)
            _loci(canvas, axes[1, k], "def"[k], sweep)
        axes[0, 0].set_ylabel("largest real part (1/s)")
        axes[1, 0].set_ylabel("imaginary part (rad/s)")
        canvas.suptitle(
            "Where dual-port control loses stability: 8 m/s, 10 % curtailment", x=0.012, ha="left", fontsize=12,
            fontweight="bold",
        )  # fmt: skip
        return save(canvas, file)


def _margin(axis: Axes, letter: str, sweep: Sweep) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    unit = f" ({sweep.unit})" if sweep.unit else ""
    axis.set_title(f"({letter})  {sweep.title[0].upper()}{sweep.title[1:]}", fontsize=9.5)
    for curve in sweep.curves:
        axis.plot(curve.values, curve.rightmost.real, label=curve.label, **_STYLES[curve.model])
    if sweep.logarithmic:
        axis.set_xscale("log")
    axis.set_yscale("symlog", linthresh=1e-3, linscale=0.5)
    lows = [c.rightmost.real.min() for c in sweep.curves]
    highs = [c.rightmost.real.max() for c in sweep.curves]
    room = 3.0 if len(sweep.curves) <= 3 else 1000.0  # for the legend
    low, high = room * min(lows), max(3.0 * max(highs), 1e-2)
    axis.set_ylim(low, high)
    ticks = [t for k in range(-3, 4) for t in (-(10.0**k), 10.0**k) if low <= t <= high]
    axis.yaxis.set_major_locator(FixedLocator([0.0, *ticks]))
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.axhspan(0.0, high, color=RED, alpha=0.10, linewidth=0.0, zorder=0)
    axis.axhline(0.0, color=DARK, linewidth=0.9, zorder=1)
    axis.set_xlim(sweep.curves[0].values[0], sweep.curves[0].values[-1])
    for name, value in {**sweep.marks, "here": sweep.nominal}.items():
        if name == "here" and value in sweep.marks.values():
            continue
        axis.axvline(value, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
        axis.annotate(
            name, (value, 0.0), xycoords=("data", "axes fraction"), xytext=(3 if name == "here" else -3, 4),
            textcoords="offset points", rotation=90, ha="left" if name == "here" else "right", va="bottom",
            fontsize=7.5, color="#555555", zorder=1,
            bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip
    axis.set_xlabel(f"{sweep.key}{unit}")
    axis.legend(loc="best" if len(sweep.curves) <= 3 else "lower left", fontsize=7.5)


def _loci(canvas: Figure, axis: Axes, letter: str, sweep: Sweep) -> None:
    import matplotlib as mpl

    model, reals, imags = _WINDOWS[sweep.key]
    curve = next(c for c in sweep.curves if c.model == model)
    axis.set_title(f"({letter})  Eigenvalues of the {curve.label} model", fontsize=9.5)
    norm: Any = (mpl.colors.LogNorm if sweep.logarithmic else mpl.colors.Normalize)(curve.values[0], curve.values[-1])
    for value, e in zip(curve.values, curve.eigenvalues, strict=True):
        shown = e[(e.imag >= imags[0] - 1e-9) & (e.real >= reals[0])]
        axis.scatter(
            shown.real, np.abs(shown.imag), s=9, c=np.full(shown.size, value), cmap="viridis", norm=norm, zorder=4,
            linewidths=0.0,
        )  # fmt: skip
    _nominal(axis, sweep, curve)
    axis.axvspan(0.0, reals[1], color=RED, alpha=0.10, linewidth=0.0, zorder=0)
    axis.axvline(0.0, color=DARK, linewidth=0.9, zorder=1)
    axis.set_xlim(*reals)
    axis.set_ylim(imags[0] - 0.02 * imags[1], imags[1])
    axis.set_xlabel("real part (1/s)")
    unit = f" ({sweep.unit})" if sweep.unit else ""
    canvas.colorbar(
        mpl.cm.ScalarMappable(norm=norm, cmap="viridis"), ax=axis, pad=0.02, aspect=30, label=f"{sweep.key}{unit}"
    )


def _nominal(axis: Axes, sweep: Sweep, curve: Curve) -> None:
    """Rings round the eigenvalues at the value nearest to the one in use."""
    distance = np.abs(np.log(curve.values / sweep.nominal)) if sweep.logarithmic else abs(curve.values - sweep.nominal)
    e = curve.eigenvalues[int(np.argmin(distance))]
    e = e[e.imag >= 0.0]
    axis.scatter(e.real, e.imag, s=42, facecolors="none", edgecolors=DARK, linewidths=0.9, zorder=5)

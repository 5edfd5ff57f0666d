"""What the figure of a run shows: its panels, and the channels of a result that belong into each.

DC voltage, power, frequency, rotor speed, pitch angle, and wind, or the power of generator and load where the wind is
constant.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gustform_cli.run_data import Curve, RunData


@dataclass(frozen=True)
class Line:
    """What to draw: channels whose name ends like this, and how to call them."""

    pattern: str
    label: str
    scale: Callable[[Curve], NDArray[np.float64]] = lambda curve: curve.values


@dataclass(frozen=True)
class Panel:
    """One pair of axes over time."""

    title: str
    unit: str
    lines: tuple[Line, ...]
    least: float  # smallest height of the value axis: a still quantity is drawn as a line, not as its round-off


def _mega(curve: Curve) -> NDArray[np.float64]:
    return curve.values / 1e6


_POWER = Panel(
    "Power",
    "pu",
    (Line(r"\.P_wt", "from the wind"), Line(r"\.P_gsc", "grid-side converter")),
    0.02,
)
_PLANT = Panel(
    "Active power in the grid",
    "MW",
    (Line(r"\.P", "{component}", _mega),),
    1.0,
)
WIND = Panel("Wind", "m/s", (Line(r"\.wind", "rotor-effective wind"),), 1.0)
FREQUENCY = Panel("Frequency", "Hz", (Line(r"\.frequency", "{role} ({component})"),), 0.05)
_PANELS = (
    Panel("DC voltage", "pu", (Line(r"\.v_dc", "DC voltage"),), 0.01),
    _POWER,
    FREQUENCY,
    Panel("Rotor speed", "pu", (Line(r"\.omega_r", "rotor"),), 0.02),
    Panel("Pitch angle", "deg", (Line(r"\.beta", "blades"),), 1.0),
)


# Panels with their curves: label and values.
Filled = list[tuple[Panel, list[tuple[str, NDArray[np.float64]]]]]


def filled_panels(run: RunData) -> Filled:
    """The panels that the run has channels for."""
    filled: Filled = []
    for panel in (*_PANELS, _PLANT if still(run, WIND) else WIND):
        curves = _curves(run, panel)
        if curves:
            filled.append((panel, curves))
    return filled


def still(run: RunData, panel: Panel) -> bool:
    """Whether nothing in the panel moves."""
    return all(np.ptp(values) < 1e-6 for _, values in _curves(run, panel))


def _curves(run: RunData, panel: Panel) -> list[tuple[str, NDArray[np.float64]]]:
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

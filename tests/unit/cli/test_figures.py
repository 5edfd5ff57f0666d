"""The axis of time of long runs; what else a figure shows is tested where runs are."""

from __future__ import annotations

from typing import Any

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gustform_cli.figures import _moment, _name_time

DAY = 86_400.0


@pytest.mark.parametrize(
    ("span", "label", "ticks"),
    [
        (90.0, "time (s)", None),
        (3 * 3600.0, "time (h)", ["0", "0.5", "1", "1.5", "2", "2.5", "3"]),
        (DAY, "time (h)", ["0", "3", "6", "9", "12", "15", "18", "21", "24"]),
        (7 * DAY, "time (d)", ["0", "1", "2", "3", "4", "5", "6", "7"]),
        (365 * DAY, "time (d)", ["0", "50", "100", "150", "200", "250", "300", "350"]),
    ],
)
def test_the_axis_has_a_unit_that_fits(span: float, label: str, ticks: list[str] | None) -> None:
    figure = Figure()
    canvas: Any = FigureCanvasAgg(figure)  # untyped in some versions
    axis = figure.subplots()
    axis.set_xlim(0.0, span)
    _name_time(axis, span)
    canvas.draw()
    assert axis.get_xlabel() == label
    if ticks is not None:
        shown = [tick.label1.get_text() for tick in axis.xaxis.get_major_ticks() if 0.0 <= tick.get_loc() <= span]
        assert shown == ticks


def test_moments_are_in_the_unit_of_the_axis() -> None:
    assert _moment(42.66, 90.0, 1) == "42.7 s"
    assert _moment(24_941.0, DAY, 1) == "6.93 h"
    assert _moment(9.58 * DAY, 365 * DAY, 1) == "9.58 d"

"""Charts as inline SVG. Colours are classes of the page's style sheet, so that they follow light, dark and print.

A chart is a <figure>: title and legend as text, which keeps its size on a phone, and the drawing with a description
for those who cannot see it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gustform_cli.report.axis import Axis
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import significant

Floats = NDArray[np.float64]

COLOURS = 6  # classes c1 ... c6 of the style sheet; more lines begin again
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 14.0, 10.0, 38.0
_LETTER = 6.8  # width of one at the size of ticks
_DOTTED_POINTS = 40  # a line with fewer shows them
_MOST_POINTS = 900  # of a line: two for each pixel it can have
_TITLED_POINTS = 400  # of a scatter; more are drawn without their names


@dataclass(frozen=True)
class Size:
    """Of a drawing, in units of which a letter has twelve."""

    width: float
    height: float


LARGE, SMALL = Size(460.0, 235.0), Size(340.0, 215.0)  # two and three side by side


@dataclass(frozen=True)
class Line:
    """One curve; values of several instances, (n, k), become a band with their mean."""

    label: str
    x: Floats
    y: Floats


@dataclass(frozen=True)
class Mark:
    """A point with a text below or above it."""

    x: float
    y: float
    text: str
    below: bool = True


@dataclass(frozen=True)
class Vertical:
    """A moment: "event" or "trip"; the text may be empty."""

    x: float
    text: str = ""
    kind: str = "event"


@dataclass(frozen=True)
class Points:
    """A cloud; `names` say what each point is."""

    label: str
    x: Floats
    y: Floats
    names: Sequence[str] = ()


def lines(
    title: str,
    x: Axis,
    y: Axis,
    curves: Sequence[Line],
    marks: Sequence[Mark] = (),
    at: Sequence[Vertical] = (),
    size: Size = LARGE,
) -> Html:
    """Curves over a common axis."""
    frame = _Frame(x, y, size)
    drawn: list[Content] = [frame.grid(), [_vertical(frame, moment) for moment in at]]
    for number, curve in enumerate(curves):
        colour, values = f"c{number % COLOURS + 1}", curve.y
        if values.ndim > 1:
            x_band, low, high = _thin_band(curve.x, values.min(axis=1), values.max(axis=1))
            drawn.append(tag("path", class_=f"band {colour}", d=frame.outline(x_band, low, high)))
            values = values.mean(axis=1)
        drawn.append(tag("path", class_=f"line {colour}", d=frame.path(*_thin(curve.x, values))))
        if values.size <= _DOTTED_POINTS:
            drawn.append(tag("path", class_=f"dots {colour}", d=frame.dots(curve.x, values)))
    drawn += [_mark(frame, mark) for mark in marks]
    named = [curve.label + (f", mean and range of {curve.y.shape[1]}" if curve.y.ndim > 1 else "") for curve in curves]
    ranges = "; ".join(
        f"{name}: from {significant(float(np.min(curve.y)))} to {significant(float(np.max(curve.y)))}"
        for name, curve in zip(named, curves, strict=True)
    )
    legend = named if len(curves) > 1 or any(curve.y.ndim > 1 for curve in curves) else []
    return _figure(title, y.label, frame, drawn, f"{title} over {x.label}; {ranges}", legend)


def bars(title: str, x: Axis, y: Axis, edges: Floats, heights: Floats, alt: str) -> Html:
    """A histogram: one bar between each two edges."""
    frame = _Frame(x, y, SMALL)
    base = frame.y(0.0)
    drawn = [
        tag(
            "rect",
            class_="bar c1",
            x=f"{frame.x(left):.1f}",
            y=f"{frame.y(height):.1f}",
            width=f"{max(0.5, frame.x(right) - frame.x(left) - 0.8):.1f}",
            height=f"{max(0.0, base - frame.y(height)):.1f}",
        )
        for left, right, height in zip(edges, edges[1:], heights, strict=False)
        if height > 0.0
    ]
    return _figure(title, y.label, frame, [frame.grid(), drawn], alt, [])


def scatter(title: str, x: Axis, y: Axis, clouds: Sequence[Points], trend: Line | None = None, alt: str = "") -> Html:
    """Points, and a line through their means."""
    frame = _Frame(x, y, SMALL)
    drawn: list[Content] = [frame.grid()]
    titled = sum(cloud.x.size for cloud in clouds) <= _TITLED_POINTS
    for number, cloud in enumerate(clouds):
        colour = f"c{number % COLOURS + 1}"
        if titled and cloud.names:
            drawn += [
                tag("circle", tag("title", name), class_=f"dot {colour}", cx=f"{px:.1f}", cy=f"{py:.1f}", r="3.2")
                for px, py, name in zip(*frame.pixels(cloud.x, cloud.y), cloud.names, strict=True)
            ]
        else:  # one path for all: a tenth of the bytes
            drawn.append(tag("path", class_=f"dots cloud {colour}", d=frame.dots(cloud.x, cloud.y)))
    if trend is not None:
        drawn.append(tag("path", class_="trend", d=frame.path(trend.x, trend.y)))
    legend = [cloud.label for cloud in clouds] if len(clouds) > 1 else []
    return _figure(title, y.label, frame, drawn, alt or f"{title} over {x.label}", legend)


class _Frame:
    """Where values stand in the drawing, and the grid behind them."""

    def __init__(self, x: Axis, y: Axis, size: Size) -> None:
        self._x, self._y = x, y
        self.size = size
        self.right, self.bottom = size.width - _RIGHT, size.height - _BOTTOM

    def x(self, value: float) -> float:
        return _LEFT + self._x.place(value) * (self.right - _LEFT)

    def y(self, value: float) -> float:
        return _TOP + (1.0 - self._y.place(value)) * (self.bottom - _TOP)

    def pixels(self, x: Floats, y: Floats) -> tuple[list[float], list[float]]:
        return [self.x(value) for value in x.tolist()], [self.y(value) for value in y.tolist()]

    def path(self, x: Floats, y: Floats) -> str:
        """A line that is broken where there is no value."""
        known = np.isfinite(x) & np.isfinite(y)
        begins = np.flatnonzero(known & ~np.concatenate([[False], known[:-1]]))
        ends = np.flatnonzero(known & ~np.concatenate([known[1:], [False]])) + 1
        return "".join(f"M{self._joined(x[b:e], y[b:e])}" for b, e in zip(begins, ends, strict=True))

    def dots(self, x: Floats, y: Floats) -> str:
        """Points as one path of strokes without length, whose ends are round."""
        known = np.isfinite(x) & np.isfinite(y)
        return "".join(f"M{px:.1f} {py:.1f}h0" for px, py in zip(*self.pixels(x[known], y[known]), strict=True))

    def outline(self, x: Floats, low: Floats, high: Floats) -> str:
        """The area between two lines."""
        known = np.isfinite(low) & np.isfinite(high)
        x, low, high = x[known], low[known], high[known]
        return f"M{self._joined(np.concatenate([x, x[::-1]]), np.concatenate([low, high[::-1]]))}Z"

    def _joined(self, x: Floats, y: Floats) -> str:
        # Beyond the frame is cut by the drawing; far beyond it would be nothing but long numbers.
        points = (f"{px:.1f} {min(max(py, -999.0), 999.0):.1f}" for px, py in zip(*self.pixels(x, y), strict=True))
        return "L".join(points) if x.size > 1 else f"{next(points, '0 0')}h0"

    def grid(self) -> Content:
        right, bottom = self.right, self.bottom
        drawn: list[Content] = []
        for tick, text in zip(self._y.ticks, self._y.texts, strict=True):
            y = self.y(tick)
            drawn.append(tag("path", class_="grid", d=f"M{_LEFT:g} {y:.1f}H{right:g}"))
            drawn.append(tag("text", text, class_="tick", x=_LEFT - 6.0, y=f"{y + 4:.1f}", text_anchor="end"))
        letters = int(2.0 * (right - _LEFT) / max(1, len(self._x.ticks)) / _LETTER)
        for number, (tick, text) in enumerate(zip(self._x.ticks, self._x.texts, strict=True)):
            x, y = self.x(tick), bottom + 15.0
            drawn.append(tag("path", class_="grid", d=f"M{x:.1f} {_TOP:g}V{bottom:g}"))
            if self._x.texts_are_long:
                y += 13.0 * (number % 2)
                text = text if len(text) <= letters else f"{text[: letters - 1]}…"
                half = 0.5 * _LETTER * len(text)
                x = min(max(x, half), self.size.width - half)
            drawn.append(tag("text", text, class_="tick", x=f"{x:.1f}", y=y, text_anchor="middle"))
        drawn.append(tag("path", class_="axis", d=f"M{_LEFT:g} {_TOP:g}V{bottom:g}H{right:g}"))
        if not self._x.texts_are_long:  # names speak for themselves, and take the room
            drawn.append(
                tag("text", self._x.label, class_="label", x=right, y=self.size.height - 6.0, text_anchor="end")
            )
        return drawn


def _figure(title: str, unit: str, frame: _Frame, drawn: Content, alt: str, legend: Sequence[str]) -> Html:
    swatches = [
        tag("span", tag("i", class_=f"swatch c{k % COLOURS + 1}"), name, class_="key") for k, name in enumerate(legend)
    ]
    caption = tag(
        "figcaption",
        tag("b", title),
        tag("span", unit, class_="unit") if unit else None,
        tag("span", swatches, class_="legend") if swatches else None,
    )
    return tag("figure", caption, svg(frame.size, alt, drawn), class_="chart")


def svg(size: Size, alt: str, drawn: Content) -> Html:
    """A drawing with its description."""
    return tag("svg", drawn, viewBox=f"0 0 {size.width:g} {size.height:g}", role="img", aria_label=alt)


def _vertical(frame: _Frame, moment: Vertical) -> Content:
    x = frame.x(moment.x)
    line = tag("path", class_=moment.kind, d=f"M{x:.1f} {_TOP:g}V{frame.bottom:g}")
    if not moment.text:
        return line
    late = x > 0.6 * frame.size.width
    y = frame.bottom - 7.0 if moment.kind == "trip" else _TOP + 10.0
    anchor = "end" if late else "start"
    return [
        line,
        tag("text", moment.text, class_="note", x=f"{x + (-5 if late else 5):.1f}", y=f"{y:g}", text_anchor=anchor),
    ]


def _mark(frame: _Frame, mark: Mark) -> Content:
    x, y = frame.x(mark.x), frame.y(mark.y)
    share = (x - _LEFT) / (frame.right - _LEFT)
    anchor = "end" if share > 0.75 else "start" if share < 0.25 else "middle"
    return [
        tag("circle", class_="mark", cx=f"{x:.1f}", cy=f"{y:.1f}", r="3"),
        tag(
            "text",
            mark.text,
            class_="note",
            x=f"{x:.1f}",
            y=f"{y + (15 if mark.below else -8):.1f}",
            text_anchor=anchor,
        ),
    ]


def _thin(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The smallest and largest value of each pixel, in the order in which they come, and both ends."""
    if x.size <= _MOST_POINTS:
        return x, y
    rows = 2 * -(-x.size // _MOST_POINTS)
    whole = x.size // rows * rows
    bins = np.nan_to_num(y[:whole].reshape(-1, rows), nan=0.0)
    first = np.arange(0, whole, rows)
    low, high = first + bins.argmin(axis=1), first + bins.argmax(axis=1)
    kept = np.unique(np.concatenate([[0], low, high, [x.size - 1]]))
    return x[kept], y[kept]


def _thin_band(x: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats, Floats]:
    """The widest range of each pixel, at its middle."""
    if x.size <= _MOST_POINTS:
        return x, low, high
    rows = -(-x.size // _MOST_POINTS)
    whole = x.size // rows * rows
    bins = [values[:whole].reshape(-1, rows) for values in (x, low, high)]
    return bins[0].mean(axis=1), bins[1].min(axis=1), bins[2].max(axis=1)

"""A heat map as inline SVG: one coloured cell for each pair of two axes, with its number where there is room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gustform_cli.report.charts import LARGE, Size, svg
from gustform_cli.report.markup import Content, Html, tag

_WIDTH = LARGE.width
_BELOW = 44.0  # for the ticks and the names of the axes

# Viridis (Smith, van der Walt), of even steps that the colour-blind can read; and Brewer's blue to red for what has a
# sign.
VIRIDIS = ("440154", "482878", "3e4a89", "31688e", "26828e", "1f9e89", "35b779", "6dcd59", "b4de2c", "fde725")
BLUE_RED = ("2166ac", "4393c3", "92c5de", "d1e5f0", "f7f7f7", "fddbc7", "f4a582", "d6604d", "b2182b")


def _colour(colours: Sequence[str], share: float) -> tuple[int, int, int]:
    places = np.linspace(0.0, 1.0, len(colours))
    parts = [[int(colour[k : k + 2], 16) for colour in colours] for k in (0, 2, 4)]
    red, green, blue = (round(float(np.interp(share, places, part))) for part in parts)
    return red, green, blue


def heat_map(
    title: str,
    unit: str,
    columns: tuple[str, Sequence[str]],
    rows: tuple[str, Sequence[str]],
    values: NDArray[np.float64],
    written: Sequence[Sequence[str]],
    alt: str,
    colours: Sequence[str] = VIRIDIS,
    span: tuple[float, float] | None = None,
) -> Html:
    """Values over two axes, (rows, columns), the first row at the bottom; NaN stays empty. Cells bear their numbers.

    `span`: what the ends of the colours stand for, the smallest and the largest value if left out.
    """
    (across, over), (up, beside) = columns, rows
    high, wide = values.shape
    left, bottom = 14.0 + 6.6 * max(len(text) for text in beside), _BELOW
    height = min(34.0 * high, 380.0)
    cell_x, cell_y = (_WIDTH - left - 4.0) / wide, height / high
    low, top = span if span is not None else (float(np.nanmin(values)), float(np.nanmax(values)))
    drawn: list[Content] = []
    for i in range(high):
        y = 6.0 + (high - 1 - i) * cell_y
        for j in range(wide):
            if not np.isfinite(values[i, j]):
                continue
            share = (values[i, j] - low) / (top - low) if top > low else 0.5
            red, green, blue = _colour(colours, float(share))
            name = f"{across} {over[j]}, {up} {beside[i]}: {written[i][j]} {unit}".rstrip()
            drawn.append(
                tag(
                    "rect",
                    tag("title", name),
                    x=f"{left + j * cell_x:.1f}",
                    y=f"{y:.1f}",
                    width=f"{cell_x - 1.0:.1f}",
                    height=f"{cell_y - 1.0:.1f}",
                    fill=f"rgb({red},{green},{blue})",
                )
            )
            if 6.4 * len(written[i][j]) < cell_x and cell_y >= 14.0:
                bright = 0.3 * red + 0.59 * green + 0.11 * blue > 130
                place = {"x": f"{left + (j + 0.5) * cell_x:.1f}", "y": f"{y + 0.5 * cell_y + 3.5:.1f}"}
                drawn.append(tag("text", written[i][j], class_="cell on-bright" if bright else "cell on-dark", **place))
        if cell_y >= 11.0 or i % (high // 12 + 1) == 0:
            drawn.append(
                tag(
                    "text",
                    beside[i],
                    class_="tick",
                    x=f"{left - 6:.1f}",
                    y=f"{y + 0.5 * cell_y + 4:.1f}",
                    text_anchor="end",
                )
            )
    # Long names stand on two or three lines in turn; where they do not fit even so, every so many is written.
    widest = 6.8 * max(len(text) for text in over) + 6.0
    lines = min(3, max(1, int(np.ceil(widest / cell_x))))
    every = max(1, int(np.ceil(widest / (lines * cell_x))))
    for j in range(0, wide, every):
        x, y = left + (j + 0.5) * cell_x, height + 20.0 + 14.0 * (j // every % lines)
        # The outermost ones must not be cut.
        x = min(max(x, 0.5 * widest), _WIDTH - 0.5 * widest)
        drawn.append(tag("text", over[j], class_="tick", x=f"{x:.1f}", y=f"{y:.1f}", text_anchor="middle"))
    bottom += 14.0 * (lines - 1) - (16.0 if not across and not up else 0.0)
    whole = height + 6.0 + bottom
    drawn.append(tag("text", across, class_="label", x=f"{_WIDTH - 4:.1f}", y=f"{whole - 4:.1f}", text_anchor="end"))
    if up:
        drawn.append(tag("text", f"↑ {up}", class_="label", x="4", y=f"{whole - 4:.1f}"))
    return tag(
        "figure",
        tag("figcaption", tag("b", title), tag("span", unit, class_="unit") if unit else None),
        svg(Size(_WIDTH, whole), alt, drawn),
        class_="chart",
    )

"""A heat map as inline SVG: one coloured cell for each pair of two axes, with its number where there is room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gustform_cli.report.charts import LARGE, Size, svg
from gustform_cli.report.markup import Content, Html, tag

_WIDTH = LARGE.width
_BELOW = 44.0  # for the ticks and the names of the axes

# Viridis (Smith, van der Walt), a colour map of even steps that the colour-blind can read, at ninths.
_VIRIDIS = np.array(
    [
        (68, 1, 84), (72, 40, 120), (62, 74, 137), (49, 104, 142), (38, 130, 142),
        (31, 158, 137), (53, 183, 121), (109, 205, 89), (180, 222, 44), (253, 231, 37),
    ],
    dtype=np.float64,
)  # fmt: skip


def _viridis(share: float) -> tuple[int, int, int]:
    places = np.linspace(0.0, 1.0, len(_VIRIDIS))
    red, green, blue = (round(float(np.interp(share, places, _VIRIDIS[:, k]))) for k in range(3))
    return red, green, blue


def heat_map(
    title: str,
    unit: str,
    columns: tuple[str, Sequence[str]],
    rows: tuple[str, Sequence[str]],
    values: NDArray[np.float64],
    written: Sequence[Sequence[str]],
    alt: str,
) -> Html:
    """Values over two axes, (rows, columns), the first row at the bottom; NaN stays empty. Cells bear their numbers."""
    (across, over), (up, beside) = columns, rows
    high, wide = values.shape
    left, bottom = 14.0 + 6.6 * max(len(text) for text in beside), _BELOW
    height = min(34.0 * high, 380.0)
    cell_x, cell_y = (_WIDTH - left - 4.0) / wide, height / high
    low, top = float(np.nanmin(values)), float(np.nanmax(values))
    drawn: list[Content] = []
    for i in range(high):
        y = 6.0 + (high - 1 - i) * cell_y
        for j in range(wide):
            if not np.isfinite(values[i, j]):
                continue
            share = (values[i, j] - low) / (top - low) if top > low else 0.5
            red, green, blue = _viridis(float(share))
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
    widest = 6.6 * max(len(text) for text in over) + 6.0
    every = max(1, int(np.ceil(widest / cell_x)))
    for j in range(0, wide, every):
        x = left + (j + 0.5) * cell_x
        drawn.append(tag("text", over[j], class_="tick", x=f"{x:.1f}", y=f"{height + 20:.1f}", text_anchor="middle"))
    whole = height + 6.0 + bottom
    drawn.append(tag("text", across, class_="label", x=f"{_WIDTH - 4:.1f}", y=f"{whole - 4:.1f}", text_anchor="end"))
    drawn.append(tag("text", f"↑ {up}", class_="label", x="4", y=f"{whole - 4:.1f}"))
    return tag(
        "figure",
        tag("figcaption", tag("b", title), tag("span", unit, class_="unit") if unit else None),
        svg(Size(_WIDTH, whole), alt, drawn),
        class_="chart",
    )

"""A figure as a small PNG: line drawings have few colours, and a palette of them takes a third of the space."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gustform.language.errors import GustformError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = 64  # palette, half tones at the edges of lines among them


def save(figure: Figure, file: Path, dpi: float = 150.0, *, scale: bool = False) -> Path:
    """Draw the figure into the file; GF7001 if it cannot be written. `scale`: small marks have colours of a continuous
    scale, which a palette that goes by area would merge."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image  # comes with matplotlib, which needs it for this very purpose

    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)  # its methods carry no types
    canvas.draw()
    drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    colours, method = (256, Image.Quantize.MAXCOVERAGE) if scale else (_COLOURS, Image.Quantize.MEDIANCUT)
    palette = drawn.quantize(colours, method=method, dither=Image.Dither.NONE)
    try:
        palette.save(file, optimize=True)
    except (OSError, ValueError) as error:
        raise GustformError(
            "GF7001", f"the figure {str(file)!r} cannot be written; {error}", hint="--out with another folder"
        ) from None
    return file

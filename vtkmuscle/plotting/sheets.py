"""Sheets of rendered panels and of curves, without pyplot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vtkmuscle.io.writing import replacing
from vtkmuscle.plotting.views import View

DOTS_PER_INCH = 150
#: Font size of a legend [points].
LEGEND_FONT = 11


@dataclass(frozen=True, eq=False)
class Panel:
    """A rendered picture (height, width, 3) with title and view."""

    image: NDArray[np.uint8]
    title: str
    view: View

    @property
    def inches(self) -> tuple[float, float]:
        """Width and height on paper, independent of resolution."""
        width, height = self.view.size
        return width / DOTS_PER_INCH, height / DOTS_PER_INCH

    def add_to(self, figure: Figure, corner: tuple[float, float], units: str) -> None:
        """Add the panel, its title and scale bar at a lower left corner [inches]."""
        (x, y), (width, height), inches = corner, self.inches, figure.dpi_scale_trans
        figure.add_artist(Pixels(self.image, corner))
        words: dict[str, Any] = {"transform": inches, "va": "bottom"}
        figure.text(x + width / 2.0, y + height + 6.0 / 72.0, self.title, ha="center", fontsize=13, **words)
        per_inch = 2.0 * self.view.half_height / height
        third = per_inch * width / 3.0
        power = 10.0 ** math.floor(math.log10(third))
        length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= third)
        left, low = x + 0.03 * width, y + 0.025 * height
        bar = Line2D([left, left + length / per_inch], [low, low], transform=inches, color="black")
        bar.set(linewidth=2.5, solid_capstyle="butt")
        figure.add_artist(bar)
        figure.text(left, low + 0.012 * height, f"{length:g} {units}", fontsize=10, **words)


class Pixels(Artist):
    """An image (height, width, 3) on a figure, pixel for pixel, at a lower left corner [inches]."""

    def __init__(self, image: NDArray[np.uint8], corner: tuple[float, float]) -> None:
        super().__init__()
        self.image, self.corner = image, corner

    def draw(self, renderer: Any) -> None:
        """Draw the image."""
        opaque = np.full((*self.image.shape[:2], 4), 255, dtype=np.uint8)
        opaque[..., :3] = self.image[::-1]
        figure = self.get_figure()
        assert figure is not None
        x, y = (round(figure.dpi * side) for side in self.corner)
        graphics = renderer.new_gc()
        renderer.draw_image(graphics, x, y, opaque)
        graphics.restore()


def legend_columns(width: float, labels: Sequence[str]) -> int:
    """Return the number of legend columns in a width [inches]."""
    letters = max((len(label) for label in labels), default=1)
    # A letter is 0.095 inches wide on average.
    return max(1, int(width / (0.5 + 0.095 * letters)))


def sheet(panels: Sequence[Panel], title: str, units: str, *, legend: Sequence[str] = ()) -> Figure:
    """Return a figure of panels in rows above a legend."""
    columns = len(panels) if len(panels) <= 4 else math.ceil(len(panels) / 2)
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    gap, header, top, bottom = 0.12, 0.34, 0.45 if title else 0.0, 0.85  # inches
    widths = [sum(p.inches[0] + gap for p in row) + gap for row in rows]
    heights = [max(p.inches[1] for p in row) + header for row in rows]
    width = max(5.0, *widths)
    # A row of the legend is 0.28 inches high.
    bottom += 0.28 * (math.ceil(len(legend) / legend_columns(width, legend)) - 1 if legend else 0)
    height = top + bottom + sum(heights)
    figure = blank_figure(width, height)
    if title:
        figure.text(0.5, 1.0 - 0.25 / height, title, ha="center", va="center", fontsize=17)
    y = height - top
    for row, row_width, row_height in zip(rows, widths, heights, strict=True):
        x = (width - row_width) / 2.0 + gap
        for panel in row:
            panel.add_to(figure, (x, y - header - panel.inches[1]), units)
            x += panel.inches[0] + gap
        y -= row_height
    return figure


def blank_figure(width: float, height: float, layout: Any = None) -> Figure:
    """Return a white figure of a size [inches], with a layout of matplotlib."""
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, facecolor="white", layout=layout)
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: Path, form: str = "png", dpi: float = DOTS_PER_INCH) -> None:
    """Write a figure as png, pdf or svg, all or nothing; text and lines stay vectors in pdf and svg."""
    options: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}}
    if form != "png":
        options = {"metadata": {{"pdf": "CreationDate", "svg": "Date"}[form]: None}}
    text_stays_text = {"pdf.fonttype": 42, "svg.fonttype": "none"}
    with replacing(path) as partial, rc_context(text_stays_text):
        figure.savefig(partial, format=form, dpi=dpi, **options)

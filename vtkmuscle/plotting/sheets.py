"""Sheets of rendered panels and sheets of curves, set with matplotlib's objects (no pyplot)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from vtkmuscle.plotting.views import View

DOTS_PER_INCH = 150
#: Size of a legend's letters [points], their mean width and the height of a row of them [inches].
LEGEND_FONT = 11
LETTER = 0.095
LEGEND_ROW = 0.28


@dataclass(frozen=True, eq=False)
class Panel:
    """One rendered picture of a sheet: its pixels (height, width, 3), its title and its view."""

    image: NDArray[np.uint8]
    title: str
    view: View

    @property
    def inches(self) -> tuple[float, float]:
        """Its width and height on paper, whatever its detail."""
        width, height = self.view.size
        return width / DOTS_PER_INCH, height / DOTS_PER_INCH


def legend_columns(width: float, labels: Sequence[str]) -> int:
    """Return in how many columns a legend fits into a figure of some width [inches]."""
    letters = max((len(label) for label in labels), default=1)
    return max(1, int(width / (0.5 + LETTER * letters)))


def sheet(panels: Sequence[Panel], title: str, units: str, *, legend: Sequence[str] = ()) -> Figure:
    """Return a figure of panels in rows, pixel for pixel, with room below for a legend of some labels."""
    columns = len(panels) if len(panels) <= 4 else math.ceil(len(panels) / 2)
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    gap, head, top, bottom = 0.12, 0.34, 0.45 if title else 0.0, 0.85  # inches
    widths = [sum(p.inches[0] + gap for p in row) + gap for row in rows]
    heights = [max(p.inches[1] for p in row) + head for row in rows]
    width = max(5.0, *widths)
    bottom += LEGEND_ROW * (math.ceil(len(legend) / legend_columns(width, legend)) - 1 if legend else 0)
    height = top + bottom + sum(heights)
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    if title:
        figure.text(0.5, 1.0 - 0.25 / height, title, ha="center", va="center", fontsize=17)
    y = height - top
    for row, row_width, row_height in zip(rows, widths, heights, strict=True):
        x = (width - row_width) / 2.0 + gap
        for panel in row:
            w, h = panel.inches
            axes = figure.add_axes((x / width, (y - head - h) / height, w / width, h / height))
            hang(axes, panel, units)
            x += w + gap
        y -= row_height
    return figure


def hang(axes: Axes, panel: Panel, units: str) -> None:
    """Show a panel on axes of its shape, with its title and a scale bar."""
    axes.imshow(_opaque(panel.image), interpolation="none", aspect="auto")
    axes.set_axis_off()
    axes.set_title(panel.title, fontsize=13, y=1.0)  # where it would be: looking for it takes time
    _scale_bar(axes, panel, units)


def _opaque(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image with the channel that matplotlib would add at twice the cost."""
    found = np.full((*image.shape[:2], 4), 255, dtype=np.uint8)
    found[..., :3] = image
    return found


def save_figure(figure: Figure, path: Path, dpi: float = DOTS_PER_INCH) -> None:
    """Write a figure whose canvas is Agg's as a .png, .pdf or .svg: what is no picture in lines and letters.

    A PNG as ``savefig`` does, in a third of its time.
    """
    figure.set_dpi(dpi)
    if path.suffix != ".png":
        with rc_context({"pdf.fonttype": 42, "svg.fonttype": "none"}):  # letters stay letters
            date = {".pdf": "CreationDate", ".svg": "Date"}[path.suffix]
            figure.savefig(path, dpi=dpi, metadata={date: None})
        return
    canvas = figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    image = Image.frombuffer("RGBA", canvas.get_width_height(physical=True), canvas.buffer_rgba())
    # White and flat colours are runs of one value.
    image.convert("RGB").save(path, compress_level=1, compress_type=zlib.Z_RLE, dpi=(figure.dpi,) * 2)


def _scale_bar(axes: Axes, panel: Panel, units: str) -> None:
    height, width = panel.image.shape[:2]
    per_pixel = 2.0 * panel.view.half_height / height
    third = per_pixel * width / 3.0
    power = 10.0 ** math.floor(math.log10(third))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= third)
    x, y = 0.03 * width, 0.975 * height
    axes.plot([x, x + length / per_pixel], [y, y], color="black", linewidth=2.5, solid_capstyle="butt")
    axes.text(x, y - 0.012 * height, f"{length:g} {units}", fontsize=10, va="bottom")
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)


def curves(title: str, time_label: str, value_label: str) -> tuple[Figure, Axes]:
    """Return a figure with one pair of axes for curves over time."""
    figure = Figure(figsize=(7.0, 4.6), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.12, 0.115, 0.86, 0.805))
    axes.set_title(title, y=1.0)
    axes.set_xlabel(time_label)
    axes.set_ylabel(value_label)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes

"""Sheets of rendered panels and of curves, without pyplot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from vtkmuscle.io.writing import replacing
from vtkmuscle.plotting.views import View

#: Pixels per inch of a picture in a figure, as journals ask for.
DOTS_PER_INCH = 300
#: Pixels per inch of a run's figures: 1063 across, the width of a page in a browser.
SCREEN = 150.0
#: Width of a figure, two columns of a journal; and of an inch [mm].
WIDTH, INCH = 180.0, 25.4
#: Letters and lines of figures in a journal, which asks for 7 points at least.
_STYLE = {"font.size": 8.0, "axes.linewidth": 0.6, "legend.columnspacing": 1.2, "legend.handlelength": 1.5}
#: Least width of a panel, and the gap beside it; height of the curves of a coordinate, and of the picture of
#: the muscle beside them, at most [inches].
INCHES = {"panel": 1.5, "gap": 0.06, "curves": 2.4, "picture": 2.1}


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
        title = fill(self.title, letters_in(width))
        figure.text(x + width / 2.0, y + height + 3.0 / 72.0, title, ha="center", **words)
        per_inch = 2.0 * self.view.half_height / height
        third = per_inch * width / 3.0
        power = 10.0 ** math.floor(math.log10(third))
        length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= third)
        left, low = x + 0.03 * width, y + 0.025 * height
        bar = Line2D([left, left + length / per_inch], [low, low], transform=inches, color="black")
        bar.set(linewidth=1.5, solid_capstyle="butt")
        figure.add_artist(bar)
        figure.text(left, low + 0.012 * height, f"{length:g} {units}", **words)


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
    widest = 8 + max((len(label) for label in labels), default=1)  # with the handle and gaps
    return max(1, min(len(labels), letters_in(width) // widest))


def letters_in(width: float) -> int:
    """Return how many letters of 0.55 em, the mean width, a line [inches] holds."""
    return int(width * 72.0 / (0.55 * rcParams["font.size"]))


def fitted(views: Sequence[View], width: float) -> list[View]:
    """Return views with the picture sizes at which their rows fill a figure's width [mm], at most."""
    rows = _rows(views, width)
    widest = max(sum(view.size[0] for view in row) for row in rows) / DOTS_PER_INCH
    scale = min(1.0, (width / INCH - INCHES["gap"] * (len(rows[0]) + 1)) / widest)
    return [replace(view, area=view.area * scale**2) for view in views]


def _rows(items: Sequence[Any], width: float) -> list[Sequence[Any]]:
    """Return items in balanced rows in a width [mm]."""
    columns = math.ceil(len(items) / math.ceil(len(items) / max(1, int(width / INCH / INCHES["panel"]))))
    return [items[i : i + columns] for i in range(0, len(items), columns)]


def sheet(panels: Sequence[Panel], title: str, units: str, width: float, *, bottom: float = 0.45) -> Figure:
    """Return a figure of panels in rows, with room at the bottom [inches]."""
    rows, wide, gap = _rows(panels, width), width / INCH, INCHES["gap"]
    titles = [fill(panel.title, letters_in(panel.inches[0])) for panel in panels]
    header = 0.06 + 0.14 * max(words.count("\n") + 1 for words in titles)  # inches
    top = 0.25 if title else 0.0
    heights = [max(p.inches[1] for p in row) + header for row in rows]
    height = top + bottom + sum(heights)
    figure = blank_figure(wide, height, title=title)
    y = height - top
    for row, row_height in zip(rows, heights, strict=True):
        x = (wide - sum(p.inches[0] + gap for p in row) + gap) / 2.0
        for panel in row:
            panel.add_to(figure, (x, y - header - panel.inches[1]), units)
            x += panel.inches[0] + gap
        y -= row_height
    return figure


def set_style() -> None:
    """Set matplotlib's parameters for a journal, without those of a matplotlibrc in the working folder."""
    rcdefaults()
    rcParams.update(_STYLE | {"text.parse_math": False})  # a name may have two dollar signs


def blank_figure(width: float, height: float, layout: Any = None, *, title: str = "") -> Figure:
    """Return a white figure. Of a size [inches], with a title across its top and a layout of matplotlib."""
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, facecolor="white", layout=layout)
    FigureCanvasAgg(figure)
    if title:
        size = rcParams["font.size"] * min(1.2, letters_in(width) / len(title))
        figure.suptitle(title, size=size, **({} if layout else {"y": 1.0 - 0.15 / height, "va": "center"}))
    return figure


def save_sheets(table: Any, figure: Figure, folder: Path, name: str, *, digits: int) -> list[Path]:
    """Write a table and a figure of the same name to a folder, and return the files."""
    save_figure(figure, folder / f"{name}.png")
    return [table.to_csv(folder / f"{name}.csv", digits=digits), folder / f"{name}.png"]


def save_figure(figure: Figure, path: Path, form: str = "png", dpi: float = SCREEN) -> None:
    """Write a figure as png, pdf or svg, all or nothing; vectors stay."""
    options: dict[str, Any] = {"pil_kwargs": {"compress_level": 1}}
    if form != "png":
        options = {"metadata": {{"pdf": "CreationDate", "svg": "Date"}[form]: None}}
    with replacing(path) as partial, rc_context({"pdf.fonttype": 42, "svg.fonttype": "none"}):  # text
        figure.savefig(partial, format=form, dpi=dpi, **options)

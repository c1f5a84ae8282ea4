"""Self-contained HTML pages of sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from vtkmuscle import __version__
from vtkmuscle.core.types import Floats
from vtkmuscle.io.writing import write_text


class Cell(NamedTuple):
    """A cell with a mark, ``"look"``, ``"failed"`` or ""."""

    text: str
    mark: str


@dataclass(frozen=True)
class Section:
    """A section of a page: a table with a header, in which verdicts are marked, SVG drawings and pictures.

    ``words`` says that cells are words rather than numbers; drawings are titles and SVG, pictures captions
    and PNG in base 64.
    """

    title: str
    note: str = ""
    rows: Sequence[Sequence[str | Cell]] = ()
    words: bool = False
    drawings: Sequence[tuple[str, str]] = ()
    pictures: Sequence[tuple[str, str]] = ()


def write_page(path: Path, name: str, kind: str, lead: str, sections: Sequence[Section]) -> Path:
    """Write a page of a kind, and return it."""
    facts = {"name": name, "kind": kind, "lead": lead, "sections": sections}
    write_text(path, rendered("sections.html", **facts))
    return path


def part(name: str) -> Markup:
    """Return a file of the page unescaped. The package's files contain no end of a script."""
    return Markup((files("vtkmuscle.report") / "page" / name).read_text(encoding="utf-8"))


def rendered(template: str, **values: Any) -> str:
    """Return the text of a page from a template in ``page``."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("vtkmuscle.report", "page"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    page = environment.get_template(template)
    return page.render(version=__version__, style=part("style.css"), **values)


def shown_rows(table: Mapping[str, NDArray[Any]]) -> list[Sequence[str]]:
    """Return a table's header and rows as text, with four digits. A missing number is ""."""
    return [tuple(table), *zip(*(map(_shown, column.tolist()) for column in table.values()), strict=True)]


def _shown(value: Any) -> str:
    if value is None or value != value:  # noqa: PLR0124
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


#: Width and height of a curve [pixels].
_SIZE = (220, 50)


def svg_curve(x: Floats, y: Floats, x_unit: str, y_unit: str) -> str:
    """Return a curve with zero line and numbers at the ends as SVG, without outliers as at jumps."""
    low, high = np.clip(np.percentile(y, [2.0, 98.0]), [-np.inf, 0.0], [0.0, np.inf])
    width, height = _SIZE
    across = width * (x - x[0]) / np.ptp(x)
    up, zero = height * (high - np.array([np.clip(y, low, high), 0.0 * y])) / ((high - low) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    labels = [(-4, 9, "end", f"{high:.0f} {y_unit}"), (-4, height, "end", f"{low:.0f}")]
    labels += [(0, height + 13, "start", f"{x[0]:.4g}"), (width, height + 13, "end", f"{x[-1]:.4g} {x_unit}")]
    form = '<text x="{}" y="{}" text-anchor="{}" font-size="10">{}</text>'
    texts = "".join(form.format(*label) for label in labels)
    return (
        f'<svg width="{width + 45}" height="{height + 16}" viewBox="-45 -1 {width + 45} {height + 16}">'
        f'<line x1="0" x2="{width}" y1="{zero[0]:.1f}" y2="{zero[0]:.1f}" stroke="#bbb"/>'
        f'<polyline points="{points}" fill="none" stroke="#06c"/>{texts}</svg>'
    )

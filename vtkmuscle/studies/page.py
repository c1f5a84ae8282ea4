"""The page of a study: one HTML file that needs nothing else, in the look of a run's."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from vtkmuscle._version import __version__
from vtkmuscle.io.writing import write_text
from vtkmuscle.report.tables import Cell, Sheet
from vtkmuscle.run.verdict import VERDICTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes
    ----------
    title, note : str
        Above it, and what it shows.
    rows : sequence of sequence of str
        A table, its head first, in which verdicts are marked.
    words : bool
        Whether its cells are words rather than numbers.
    drawings : sequence of (str, str)
        Titles and SVG.
    pictures : sequence of (str, str, str)
        Words, a verdict and a PNG in base 64.
    """

    title: str
    note: str = ""
    rows: Sequence[Sequence[str]] = ()
    words: bool = False
    drawings: Sequence[tuple[str, str]] = ()
    pictures: Sequence[tuple[str, str, str]] = ()

    @property
    def sheet(self) -> Sheet:
        """The table as pages have it."""
        head, *body = self.rows
        marked = [[Cell(text, text if text in VERDICTS else "") for text in row] for row in body]
        return Sheet(self.note or self.title, list(head), marked, words=self.words)


def write_page(path: Path, name: str, kind: str, lead: str, sections: Sequence[Section]) -> Path:
    """Write the page of a study of a kind, and return it."""
    import jinja2  # noqa: PLC0415 -- only pages need it

    places = ("vtkmuscle.studies", "templates"), ("vtkmuscle.report", "page")
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(*place) for place in places]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    style = (files("vtkmuscle.report") / "page" / "style.css").read_text(encoding="utf-8")
    facts = {"name": name, "kind": kind, "lead": lead, "sections": sections}
    page = environment.get_template("study.html")
    write_text(path, page.render(version=__version__, style=style, **facts))
    return path


def svg_of(figure: Figure, salt: str, names: Mapping[str, str] | None = None) -> str:
    """Return a drawing as SVG, the same each time; what has an id is named where the pointer is on it."""
    import matplotlib as mpl  # noqa: PLC0415 -- slow to import

    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": salt, "svg.fonttype": "none"}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    text = file.getvalue()
    for id_, name in (names or {}).items():
        text = text.replace(f'<g id="{id_}">', f'<g id="{id_}"><title>{escape(name)}</title>')
    return text[text.index("<svg") :]

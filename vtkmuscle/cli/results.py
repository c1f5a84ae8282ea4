"""What is made of a run's results: ``vtkmuscle report``, ``figures`` and ``compare``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vtkmuscle.cli.messages import one_clear_error
from vtkmuscle.cli.options import LiteratureOption, OutOption, named

if TYPE_CHECKING:
    from vtkmuscle.run import Result


def report(
    results: Annotated[Path, typer.Argument(help="Folder of a run's results.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="HTML", parser=named, help="Default: report.html in that folder."
        ),
    ] = None,
    literature: LiteratureOption = None,
) -> None:
    """Write the page of a finished run again: the scene, curves, tables and verdicts in one file."""
    with one_clear_error(out):
        from vtkmuscle.run.store import PAGE

        typer.echo(f"wrote {_loaded(results, literature).write_report(out or results / PAGE)}")


def _loaded(results: Path, literature: Path | None) -> Result:
    """Return the results in a folder, with published moment arms where a table of them is given."""
    from vtkmuscle.run import Result

    found = Result.load(results)
    return found if literature is None else found.with_literature(literature)


def figures(
    results: Annotated[Path, typer.Argument(help="Folder of a run's results.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="PATH", parser=named, help="Default: figures in that folder."),
    ] = None,
    form: Annotated[str, typer.Option("--form", metavar="png|pdf|svg", help="Of the files.")] = "png",
    dpi: Annotated[float, typer.Option("--dpi", help="Pixels per inch of pictures.")] = 300.0,
    literature: LiteratureOption = None,
) -> None:
    """Draw the figures of a finished run again, for a journal: as PDF or SVG, at any resolution."""
    with one_clear_error(out):
        found = _loaded(results, literature).write_figures(out or results / "figures", form=form, dpi=dpi)
        typer.echo(f"wrote {len(found)} figures to {found[0].parent}")


def compare(
    results: Annotated[list[Path], typer.Argument(help="Folders of results; the first is compared to.")],
    out: OutOption = None,
    literature: LiteratureOption = None,
    opensim: Annotated[
        Path | None,
        typer.Option("--opensim", metavar="OSIM", help="A model whose muscles are compared, too."),
    ] = None,
) -> None:
    """Lay runs over one another: curves, differences with errors, one page and one table.

    Settings, sides and subjects match by the names of muscles and coordinates. Without --out it writes to
    comparison, in the folder you are in.
    """
    with one_clear_error(out):
        from vtkmuscle.comparison import compare as compared

        for path in compared(results, literature=literature, opensim=opensim).write(
            out or Path("comparison")
        ):
            typer.echo(f"wrote {path}")

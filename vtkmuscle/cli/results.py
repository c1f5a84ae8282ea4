"""Reports, figures, comparisons and models from a run's results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vtkmuscle.cli.options import LiteratureOption, OutOption, out_option
from vtkmuscle.core.errors import InputError

if TYPE_CHECKING:
    from vtkmuscle.run import Result


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """The options of an export of muscles."""

    form: Annotated[
        str, typer.Option(help="For OpenSim: functions of coordinates, or points and cylinders.")
    ] = "functions"
    groups: Annotated[int, typer.Option(min=1, help="For OpenSim: groups of fibres per muscle, at most.")] = 1
    into: Annotated[Path | None, typer.Option(help="For OpenSim: a model to put the muscles into.")] = None
    replace: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OURS=THEIRS", help="A muscle of the scene, and that of the model which it replaces."
        ),
    ] = None
    specific_tension: Annotated[float, typer.Option(help="Force per cross-section, in N/cm^2.")] = 60.0
    mass: Annotated[
        list[str] | None, typer.Option(metavar="BODY=KG", help="Mass of a body of a new model.")
    ] = None
    geometry_only: Annotated[
        bool, typer.Option("--geometry-only", help="Paths without muscles' properties.")
    ] = False


def export_muscles(source: Path, out: Path, options: ExportOptions) -> None:
    """Write a model; print the differences from the run."""
    from vtkmuscle.opensim import write_mujoco, write_opensim
    from vtkmuscle.opensim.from_run import GEOMETRY_ONLY

    settings: dict[str, Any] = {
        "groups": options.groups,
        "specific_tension": options.specific_tension,
        "masses": {body: _kilograms(text) for body, text in pairs(options.mass, "--mass").items()},
    }
    if options.geometry_only:
        settings["kind"] = GEOMETRY_ONLY
    replace = pairs(options.replace)
    if out.suffix.lower() == ".osim":
        written = write_opensim(
            source, out, into=options.into, replace=replace, form=options.form, **settings
        )
    elif options.into is not None or replace:
        raise InputError("--into", "muscles are put into models of OpenSim only", "leave it out")
    else:
        written = write_mujoco(source, out, **settings)
    for muscle in written:
        typer.echo(f"{muscle.out.name}: {muscle}")
        if parameters := muscle.out.parameters:
            typer.echo("  " + ", ".join(f"{name} {value:.4g}" for name, value in parameters.items()))
    typer.echo(f"wrote {out}, and the errors in {out.stem}_errors.csv")


def _kilograms(text: str) -> float:
    from vtkmuscle.io.csv_table import number_in

    mass = number_in(text)
    if not 0.0 <= mass < inf:
        raise InputError("--mass", f"{text!r} is no mass", "write BODY=KG, e.g. femur=8.5")
    return mass


def pairs(texts: Sequence[str] | None, option: str = "--replace") -> dict[str, str]:
    """Return the pairs OURS=THEIRS of an option."""
    names = {}
    for text in texts or ():
        ours, _, theirs = text.partition("=")
        if not ours or not theirs:
            raise InputError(option, f"{text!r} is no pair", "write both sides of the =")
        names[ours] = theirs
    return names


def check(
    model: Annotated[Path, typer.Argument(help="A model of OpenSim, .osim.")],
    out: Annotated[
        Path | None, out_option("HTML", "The page, .html. Default: MODEL_check.html here.")
    ] = None,
    repair: Annotated[
        Path | None, typer.Option(help="Write the model with paths fitted to those of a scene.")
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="For --repair: a scene.toml, or the folder of its results.")
    ] = None,
    replace: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OURS=THEIRS", help="For --repair: a muscle of the scene, and that of the model."
        ),
    ] = None,
) -> None:
    """Find jumps and sign changes in OpenSim muscles.

    Each muscle is swept over the ranges of its coordinates. A page and a table (.csv) list the findings with
    their poses. With the surfaces of a scene, fitted paths can replace the model's paths.
    """
    if model.suffix.lower() == ".toml":
        raise InputError(
            model, "this is no model of OpenSim", "a scene is checked as it is run: vtkmuscle run"
        )
    from vtkmuscle.opensim import check_model, write_opensim

    if (repair is None) != (scene is None) or (repair is not None and not replace):
        raise InputError(
            "--repair", "a repair takes a scene and muscles to replace", "give --scene and --replace too"
        )
    page = out or Path(f"{model.stem}_check.html")
    if repair is not None and scene is not None:
        for new in write_opensim(scene, repair, into=model, replace=pairs(replace)):
            typer.echo(f"{new.out.name}: {new}")
        model = repair
    checked = check_model(model)
    typer.echo(checked)
    kinds = [finding.what for finding in checked.findings]
    for finding in checked.findings:
        if "jumps" in finding.what:
            where = ", ".join(f"{name} {value:.4g}" for name, value in checked.shown(finding).items())
            typer.echo(f"{finding.muscle}: {finding.what} by {1000.0 * finding.size:.1f} mm at {where}")
    typer.echo(f"{kinds.count('moment arm changes sign')} moment arms change their sign")
    typer.echo(f"wrote {page}, {checked.write(page)}")


def report(
    results: Annotated[Path, typer.Argument(help="Folder of a run's results.")],
    out: Annotated[Path | None, out_option("HTML", "Default: report.html in that folder.")] = None,
    literature: LiteratureOption = None,
) -> None:
    """Write the page of a finished run again: scene, curves, tables, verdicts."""
    from vtkmuscle.run.store import PAGE

    typer.echo(f"wrote {_loaded(results, literature).write_report(out or results / PAGE)}")


def _loaded(results: Path, literature: Path | None) -> Result:
    """Return the results in a folder, with optional published moment arms."""
    from vtkmuscle.run import Result

    result = Result.load(results)
    return result if literature is None else result.with_literature(literature)


def figures(
    results: Annotated[Path, typer.Argument(help="Folder of a run's results.")],
    out: Annotated[Path | None, out_option("PATH", "Default: figures in that folder.")] = None,
    form: Annotated[str, typer.Option(metavar="png|pdf|svg", help="Of the files.")] = "png",
    dpi: Annotated[float, typer.Option(help="Pixels per inch of pictures.")] = 300.0,
    literature: LiteratureOption = None,
) -> None:
    """Draw the figures of a finished run again."""
    files = _loaded(results, literature).write_figures(out or results / "figures", form=form, dpi=dpi)
    typer.echo(f"wrote {len(files)} figures to {files[0].parent}")


def compare(
    results: Annotated[list[Path], typer.Argument(help="Folders of results; the first is the reference.")],
    out: OutOption = None,
    literature: LiteratureOption = None,
    opensim: Annotated[
        Path | None, typer.Option(metavar="OSIM", help="A model whose muscles are compared, too.")
    ] = None,
) -> None:
    """Compare runs: a table of differences, and a figure of curves.

    Settings, sides and subjects match by the names of muscles and coordinates. Without --out results go to
    comparison in the working folder.
    """
    from vtkmuscle.comparison import compare as compared

    for path in compared(results, literature=literature, opensim=opensim).write(out or Path("comparison")):
        typer.echo(f"wrote {path}")

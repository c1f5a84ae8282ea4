"""Models, reports and figures of results, and scenes from label maps, meshes and landmarks."""

from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from json import dumps
from math import inf
from pathlib import Path
from signal import SIGINT
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

import vtkmuscle
from vtkmuscle import io
from vtkmuscle.cli import options as shared
from vtkmuscle.core.errors import InputError

if TYPE_CHECKING:
    from vtkmuscle.labels.draft import Draft
    from vtkmuscle.opensim.checking import ModelCheck


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """The options of an export of muscles."""

    form: Annotated[str, Option(help="For OpenSim: functions, or points.")] = "functions"
    groups: Annotated[int, Option(min=1, help="For OpenSim: groups of fibres per muscle, at most.")] = 1
    into: Annotated[Path | None, Option(help="For OpenSim: a model to put the muscles into.")] = None
    replace: Annotated[list[str] | None, Option(metavar="OURS=THEIRS", help="A muscle to replace.")] = None
    specific_tension: Annotated[float, Option(help="Force per cross-section, in N/cm^2.")] = 60.0
    mass: Annotated[list[str] | None, Option(metavar="BODY=KG", help="Mass of a new body.")] = None
    geometry_only: Annotated[bool, Option("--geometry-only", help="Paths alone.")] = False
    tubes: Annotated[bool, Option("--tubes", help="For USD: fibres as meshes of tubes.")] = False
    overwrite: shared.OverwriteOption = False


@shared.with_options
def export(
    source: Annotated[Path, Argument(help="Folder of a run's results, or a scene.toml.")],
    out: Annotated[Path, Argument(help=".osim; .xml for MuJoCo; .usd, .usdc or .usda for an animation.")],
    *,
    options: ExportOptions,
) -> None:
    """Export the muscles of a scene with joints to OpenSim or MuJoCo, or a run's frames to USD.

    The source is a folder of results, or a scene, which is run first. Differences of lengths and moment arms
    from the run are printed and written. The written model is checked, as by ``check``. An animation of USD
    has bones, muscles and fibres, for Blender.
    """
    if out.suffix.lower().startswith(".usd"):
        _animate(source, out, options)
        return
    from vtkmuscle.cli.running import progress_bars
    from vtkmuscle.opensim import check_model
    from vtkmuscle.opensim.from_run import GEOMETRY_ONLY
    from vtkmuscle.opensim.model import own_name

    names = ["into", "overwrite", "groups", "specific_tension", *["form"] * (out.suffix.lower() == ".osim")]
    settings: dict[str, Any] = {name: getattr(options, name) for name in names}
    settings |= {"kind": GEOMETRY_ONLY} if options.geometry_only else {}
    masses = {body: _kilograms(text) for body, text in shared.pairs(options.mass, "--mass").items()}
    settings |= {"replace": shared.pairs(options.replace), "masses": masses}
    with progress_bars() as progress:
        muscles = vtkmuscle.export(source, out, workers=None, progress=progress, **settings)
    for muscle in muscles:
        typer.echo(f"{muscle.out.name}: {muscle}")
        if parameters := muscle.out.parameters:
            typer.echo("  " + ", ".join(f"{name} {value:.4g}" for name, value in parameters.items()))
    typer.echo(f"wrote {out}, and the errors in {own_name(out)}_errors.csv")
    if out.suffix.lower() == ".osim" and not masses and options.into is None:
        typer.echo("No body of the model has a mass, so it cannot be simulated; give --mass BODY=KG.")
    if out.suffix.lower() == ".xml" and find_spec("mujoco") is None:
        typer.echo("The model is not checked: install the extra mujoco, and run vtkmuscle check.")
    else:
        _say(check_model(out))


def _animate(source: Path, out: Path, options: ExportOptions) -> None:
    """Write the animation of a run, or of a scene, which is run first."""
    from vtkmuscle.run.animation import check_format

    check_format(out)  # before a run
    with io.Outputs.for_file(out, [source], overwrite=options.overwrite):
        result = vtkmuscle.Result.load(source) if source.is_dir() else vtkmuscle.Scene.load(source).run()
        result.write_usd(out, tubes=options.tubes)
    typer.echo(f"wrote {out}, with {len(result.frames)} frame{'s' * (len(result.frames) != 1)}")


def _say(checked: "ModelCheck") -> None:
    """Print a check's coverage and findings."""
    from vtkmuscle.opensim.checking import FIBRES_OUTSIDE

    typer.echo(checked)
    for finding in checked.findings:
        if "jumps" in finding.what:
            where = ", ".join(f"{name} {value:.4g}" for name, value in finding.pose.items())
            unit = "\u2030" if finding.unit == "m" and "arm" in finding.what else "mm"
            typer.echo(f"{finding.muscle}: {finding.what} by {1000.0 * finding.size:.1f} {unit} at {where}")
    differ = "moment arms differ between the sides"
    for word, words in (("sign", "moment arms change sign"), ("differ", differ), ("fibre", FIBRES_OUTSIDE)):
        names = [finding.muscle for finding in checked.findings if word in finding.what]
        typer.echo(f"{len(names if word == 'sign' else set(names))} {words}")


def _kilograms(text: str) -> float:
    from vtkmuscle.io.csv_table import number_in

    mass = number_in(text)
    if not 0.0 <= mass < inf:
        raise InputError("--mass", f"{text!r} is no mass", "write BODY=KG, e.g. femur=8.5")
    return mass


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """The options of a check of a model."""

    repair: Annotated[Path | None, Option(help="Write the model with a scene's paths.")] = None
    scene: Annotated[Path | None, Option(help="For --repair: a scene.toml, or its results.")] = None
    replace: Annotated[list[str] | None, Option(metavar="OURS=THEIRS", help="For --repair.")] = None
    fail_above: Annotated[float | None, Option(metavar="MM", help="Exit with 1 above this size.")] = None
    json: Annotated[bool, Option("--json", help="Print findings as JSON.")] = False
    overwrite: shared.OverwriteOption = False


@shared.with_options
def check(
    model: Annotated[Path, Argument(help="A model of OpenSim (.osim) or MuJoCo (.xml).")],
    out: Annotated[Path | None, shared.out_option("HTML", "Page. Default: MODEL_check.html here.")] = None,
    *,
    options: CheckOptions,
) -> None:
    """Find jumps and sign changes in a model's muscles, and fibres out of their range.

    Each muscle is swept over the ranges of its coordinates. A page and a table (.csv) list the findings with
    their poses. With the surfaces of a scene, fitted paths can replace the model's paths.
    """
    if model.suffix.lower() == ".toml":
        raise InputError(model, "this is no model of muscles", "a run checks a scene: vtkmuscle run")
    from vtkmuscle.cli.running import progress_bars
    from vtkmuscle.opensim import check_model
    from vtkmuscle.opensim.model import own_name

    repair, scene, replace = options.repair, options.scene, options.replace
    if (repair is None) != (scene is None) or (repair is not None and not replace):
        raise InputError("--repair", "a repair takes a scene and muscles", "give --scene and --replace too")
    if repair is not None and model.suffix.lower() == ".xml":
        raise InputError("--repair", "a repair is of a model of OpenSim", "give an .osim file")
    page = out or Path(f"{own_name(repair or model)}_check.html")
    pages = io.Outputs.for_file(page, [model, scene], overwrite=options.overwrite)
    if page.suffix.lower() not in (".html", ".htm"):
        raise InputError(page, "a check is an HTML page", "end the name in .html")
    pages.check(page.with_suffix(".csv"))
    if repair is not None and scene is not None:
        theirs, overwrite = shared.pairs(replace), options.overwrite
        for new in vtkmuscle.export(scene, repair, into=model, replace=theirs, overwrite=overwrite):
            typer.echo(f"{new.out.name}: {new}", err=options.json)
        model = repair
    with progress_bars(quiet=options.json) as bars:
        checked = check_model(model, progress=partial(bars, model.name, "sweeping"), partial=True)
    with pages:
        table = checked.write(page)
    if options.json:
        typer.echo(dumps(checked.to_dict(), indent=1))
    else:
        _say(checked)
        typer.echo(f"wrote {page}, {table}")
    if checked.left:
        raise typer.Exit(128 + SIGINT)  # as in shells
    if options.fail_above is None:
        return
    if not (evaluated := checked.evaluated.intersection(checked.model.muscles or checked.model.paths)):
        shared.print_error(f"error: --fail-above: no muscle of {model} could be evaluated; see the reasons")
    sizes = [1e3 * f.size for f in checked.findings if not f.what.startswith(("fibre", "moment arms of"))]
    if not evaluated or max(sizes, default=0.0) > options.fail_above:
        raise typer.Exit(shared.Status.FAILED)


def report(
    results: Annotated[Path, Argument(help="Folder of a run's results.")],
    out: Annotated[Path | None, shared.out_option("HTML", "Default: report.html in that folder.")] = None,
    literature: shared.LiteratureOption = None,
    overwrite: shared.OverwriteOption = False,
) -> None:
    """Write the page of a finished run again: scene, curves, tables, verdicts."""
    from vtkmuscle.run.store import PAGE

    page = out or results / PAGE
    with io.Outputs.for_file(page, [results, literature], overwrite=overwrite, ours=[results / PAGE]):
        _loaded(results, literature).write_report(page)
    typer.echo(f"wrote {page}")


def _loaded(results: Path, literature: Path | None) -> "vtkmuscle.Result":
    """Return the results in a folder, with optional published moment arms."""
    result = vtkmuscle.Result.load(results)
    return result if literature is None else result.with_literature(literature)


def figures(
    results: Annotated[Path, Argument(help="Folder of a run's results.")],
    out: Annotated[Path | None, shared.out_option("PATH", "Default: figures in that folder.")] = None,
    form: Annotated[str, Option(metavar="png|pdf|svg", help="Of the files.")] = "png",
    dpi: Annotated[float, Option(help="Pixels per inch of pictures.")] = 300.0,
    width: Annotated[float, Option(help="Width on paper, in mm: 85 for a column, 180 for two.")] = 180.0,
    literature: shared.LiteratureOption = None,
    overwrite: shared.OverwriteOption = False,
) -> None:
    """Draw the figures of a finished run again."""
    from vtkmuscle.run.store import ResultFolder

    drawn = (ResultFolder(results).report() or {}).get("figures") or {}
    ours = [results / "figures" / name for name in drawn.get("written", ())]
    folder = out or results / "figures"
    with io.Outputs(folder, inputs=filter(None, [results, literature]), overwrite=overwrite, ours=ours):
        files = _loaded(results, literature).write_figures(folder, form=form, dpi=dpi, width=width)
    typer.echo(f"wrote {len(files)} figures to {files[0].parent}")


def compare(
    results: Annotated[list[Path], Argument(help="Folders of results; the first is the reference.")],
    out: shared.OutOption = None,
    literature: shared.LiteratureOption = None,
    overwrite: shared.OverwriteOption = False,
) -> None:
    """Compare runs: a table of differences, and a figure of curves.

    Settings, sides and subjects match by the names of muscles and coordinates. Means are over each run,
    differences over the common part. Without --out results go to comparison in the working folder.
    """
    folder = out or Path("comparison")
    with io.Outputs(folder, inputs=filter(None, [*results, literature]), overwrite=overwrite):
        written = vtkmuscle.compare(results, literature=literature).write(folder)
    for path in written:
        typer.echo(f"wrote {path}")


FrameOption = Annotated[str, Option("--frame", metavar="LPS|RAS", help="Frame: x to the left, or right.")]


@dataclass(frozen=True, kw_only=True)
class LabelOptions:
    """The options of a scene from labels."""

    names: Annotated[str | None, Option(help="musclemap, a task of TotalSegmentator, or a .csv.")] = None
    edge: Annotated[float | None, Option(metavar="MM", help="Edges. Default: 2 voxels, at most 3 mm.")] = None
    frame: FrameOption = "LPS"
    overwrite: shared.OverwriteOption = False
    quiet: shared.QuietOption = False


@shared.with_options
def from_labels(
    label_map: Annotated[Path, Argument(metavar="MAP", help="A .nii.gz, .nrrd, .mha or .dcm, or a folder.")],
    out: shared.FolderOption,
    landmarks: Annotated[list[Path] | None, Argument(help="Files MUSCLE_origin or MUSCLE_insertion.")] = None,
    *,
    options: LabelOptions,
) -> None:
    """Make a scene from a segmentation: surfaces, attachment areas, fitted joints.

    Missing input is guessed: guesses.csv and comments in scene.toml list each guess with a confidence. A
    tendon is drawn to landmarks beyond a muscle's label. A muscle that fails is reported with the reason; the
    scene has the remaining muscles.
    """
    settings: dict[str, Any] = {**vars(options), "landmarks": landmarks or ()}
    quiet = settings.pop("quiet")
    _tell(vtkmuscle.from_labels(label_map, out, announce=partial(shared.say, quiet), **settings), quiet)


@dataclass(frozen=True, kw_only=True)
class InitOptions:
    """The options of a scene from meshes."""

    bone: Annotated[list[str] | None, Option(metavar="NAME", help="Name of a bone; repeatable.")] = None
    muscle: Annotated[list[str] | None, Option(metavar="NAME", help="Name of a muscle; repeatable.")] = None
    repair: Annotated[bool, Option("--repair", help="Repair muscles: small holes, sides, crumbs.")] = False
    frame: FrameOption = "LPS"
    overwrite: shared.OverwriteOption = False
    quiet: shared.QuietOption = False


@shared.with_options
def init(
    files: Annotated[list[Path], Argument(help="Meshes, landmarks MUSCLE_origin or _insertion, an .osim.")],
    out: shared.FolderOption = Path(),
    *,
    options: InitOptions,
) -> None:
    """Write a scene.toml from meshes and landmarks, guessing missing input.

    Names identify bones and muscles, sizes the unit, contact or landmarks the areas, fits to bones or an
    OpenSim model the joints. guesses.csv and comments in scene.toml list each guess with a confidence.
    """
    settings: dict[str, Any] = {name: getattr(options, name) for name in ("frame", "repair", "overwrite")}
    settings |= {"bones": options.bone or (), "muscles": options.muscle or ()}
    _tell(vtkmuscle.init(files, out, **settings), options.quiet)


def _tell(draft: "Draft", quiet: bool) -> None:
    """Print the unsure guesses of a draft, and how to go on."""
    from vtkmuscle.labels.guesses import LEFT_OUT, LOOK, table_of
    from vtkmuscle.labels.page import PAGE

    folder = draft.file.parent
    unsure = [guess for guess in draft.guesses if guess.confidence < LOOK and guess.value != LEFT_OUT]
    shared.say(quiet, f"{len(draft.guesses)} guesses are in {folder / PAGE}{'; check these:' * bool(unsure)}")
    for confidence, what, guess, why in table_of(unsure)[1:]:
        shared.say(quiet, f"  {confidence}  {what}: {guess}; {why}")
    for name, why in draft.left_out.items():
        typer.echo(f"left out: {name}: {why}", err=True)
    if draft.lacks:
        typer.echo(f"the scene cannot run yet: {draft.lacks}", err=True)
        made = [folder / kind for kind in ("bones", "muscles") if (folder / kind).is_dir()]
        words = f", and surfaces in {' and '.join(map(str, made))}" if made else ""
        shared.say(quiet, f"wrote {draft.file}, and volumes.csv with the architecture of muscles{words}")
        return
    words = f"wrote {draft.file}, with {', '.join(draft.muscles)}: check the guesses, then run"
    shared.say_run(quiet, words, draft.file)

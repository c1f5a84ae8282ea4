"""The command line: ``vtkmuscle run``, ``demo``, ``tradeoff``, ``info``, ``export`` and ``paraview-path``.

Nothing heavy is imported before a command needs it, so that ``vtkmuscle --help`` answers at once.
"""

from __future__ import annotations

import inspect
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from rich.console import Console

from vtkmuscle import __version__
from vtkmuscle.isolation import leave_out_working_folder

if TYPE_CHECKING:
    from vtkmuscle.scene import Scene

#: Exit status where a muscle failed and all else was written, for input that cannot be used, and for Ctrl-C
#: (128 + SIGINT, as shells have it).
FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130


class TerminatedError(KeyboardInterrupt):
    """The process was asked to end by a signal: by a batch system, a container, or a closed terminal."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


#: Bones and muscles are 20 mm to 2 m long; what is shorter than this in its file is not in millimetres.
_SHORTEST_IN_MILLIMETRES = 10.0
_LONGEST_IN_METRES = 2.5

app = typer.Typer(
    name="vtkmuscle",
    help="Deform muscles with moving bones, fill them with fibres, and measure them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _named(text: str) -> Path:
    """Return a path; an empty text, as of a shell variable that is not set, is not the working folder."""
    if not text:
        raise typer.BadParameter("it is empty; give the name of a folder")
    return Path(text)


OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="PATH", parser=_named, help="Folder to write to.", show_default=False
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")]


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of commands that run a scene."""

    frames: Annotated[
        str | None,
        typer.Option(
            metavar="A:B",
            help="Frames to write, counted from 0; B is not included. Default: all.",
            show_default=False,
        ),
    ] = None
    quiet: QuietOption = False
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True
    series: Annotated[
        str,
        typer.Option(
            "--format", metavar="pvd|vtkhdf", help="Time series: a .vtp file per frame, or one file for all."
        ),
    ] = "pvd"
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Muscles that are deformed side by side; the results are the same. "
            "Default: one per processor.",
            show_default=False,
        ),
    ] = None
    verbose: Annotated[
        bool,
        typer.Option(
            "--verbose",
            help="Print figures of each frame as it is done: how far the solve got, how the shape was kept.",
        ),
    ] = False
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite",
            help="Replace results of another scene, and files that no run has written; never the inputs.",
        ),
    ] = False
    quality: Annotated[
        str | None,
        typer.Option(
            metavar="preview|balanced|accurate",
            help="Preset of the solver, in place of the scene's; what the scene's solver table sets stays.",
            show_default=False,
        ),
    ] = None


def _with_run_options(command: Callable[..., None]) -> Callable[..., None]:
    """Spell out a command's last parameter, ``options``, for typer, which reads the signature."""
    own = inspect.signature(command, eval_str=True)
    *before, _ = own.parameters.values()
    hints = get_type_hints(RunOptions, include_extras=True)
    spelt = [
        inspect.Parameter(
            option.name, inspect.Parameter.KEYWORD_ONLY, default=option.default, annotation=hints[option.name]
        )
        for option in fields(RunOptions)
    ]

    def spelt_out(*arguments: Any, **keywords: Any) -> None:
        options = RunOptions(**{option.name: keywords.pop(option.name) for option in fields(RunOptions)})
        command(*arguments, **keywords, options=options)

    spelt_out.__name__, spelt_out.__doc__ = command.__name__, command.__doc__
    spelt_out.__signature__ = own.replace(parameters=[*before, *spelt])  # type: ignore[attr-defined]
    spelt_out.__annotations__ = {one.name: one.annotation for one in (*before, *spelt)}
    return spelt_out


def main() -> None:
    """Run the command line; the console entry point."""
    leave_out_working_folder()
    for name in ("SIGTERM", "SIGHUP"):  # the latter is not known to Windows
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _terminate)
    app()


def _terminate(number: int, _frame: object) -> None:
    """Stop as on Ctrl-C: finished frames are measured and listed."""
    raise TerminatedError(number)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"vtkmuscle {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@app.command()
@_with_run_options
def run(
    scene: Annotated[Path, typer.Argument(help="A scene.toml.", show_default=False)],
    out: OutOption = None,
    *,
    options: RunOptions,
) -> None:
    """Run a scene: deform its muscles, carry their fibres along, measure, and write all of it.

    Without --out it writes to NAME_out, in the folder you are in.
    """
    with _one_clear_error(None):
        from vtkmuscle.scene import Scene

        loaded = Scene.load(scene)
    _run(loaded, out or Path(f"{loaded.name}_out"), options)


@app.command()
@_with_run_options
def demo(
    out: OutOption = None,
    *,
    options: RunOptions,
) -> None:
    """Run a phantom hip, and write its scene too, as a model for your own.

    Without --out it writes to vtkmuscle_demo.
    """
    folder = out or Path("vtkmuscle_demo")
    with _one_clear_error(folder):
        from vtkmuscle import phantoms
        from vtkmuscle.run.unchanged import save_unless_changed
        from vtkmuscle.scene import Scene

        scene = Scene.from_phantom(phantoms.hip())
        loaded = Scene.load(path := save_unless_changed(scene, folder / "scene", overwrite=options.overwrite))
    _say(options.quiet, f"The scene is {path}: edit it, or put your own surfaces there, and run it with")
    _say(options.quiet, f"  vtkmuscle run {path}")
    _run(loaded, folder, options)


@app.command()
def info(
    files: Annotated[
        list[Path],
        typer.Argument(help="Meshes, or folders of results.", show_default=False),
    ],
) -> None:
    """Say what meshes are: size, closed or not, manifold or not, pieces, volume, a guess of the unit.

    Of a folder of results it says which frames are there.
    """
    with _one_clear_error(None):
        for file in files:
            typer.echo(f"{file}")
            for word, value in _facts(file).items():
                typer.echo(f"  {word:<12}{value}")


@app.command()
def export(
    source: Annotated[
        Path, typer.Argument(help="Folder of a run's results, or a .pvd file.", show_default=False)
    ],
    out: Annotated[Path, typer.Argument(help=".gltf for a web page, or .vtkhdf.", show_default=False)],
    time: Annotated[
        float | None, typer.Option("--time", help="Which pose. Default: the last.", show_default=False)
    ] = None,
) -> None:
    """Export a pose of a run's results for a web page (glTF), or a .pvd series as one .vtkhdf file."""
    with _one_clear_error(None):
        if out.suffix.lower() == ".vtkhdf":
            from vtkmuscle.io import read_series, write_vtkhdf
            from vtkmuscle.run.poses import merged

            series = read_series(source)
            write_vtkhdf(out, series.times, lambda number: merged(series.frame(number)))
        else:
            from vtkmuscle.plotting import export_scene
            from vtkmuscle.run.poses import read_pose

            pose = read_pose(source, time)
            export_scene(out, pose.bones, pose.muscles, fibres=pose.fibres)


@app.command()
def tradeoff(
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="A scene.toml, or 'demo': the phantom hip.", show_default=False),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="PATH", parser=_named, help="Folder to write to.", show_default=False
        ),
    ],
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only",
            metavar="NAME",
            help="Group or beginning of names of settings; may be repeated.",
            show_default=False,
        ),
    ] = None,
    muscle: Annotated[
        list[str] | None,
        typer.Option("--muscle", metavar="NAME", help="Muscle; may be repeated.", show_default=False),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames", metavar="A:B:STEP", help="Frames to compare. Default: each fifth.", show_default=False
        ),
    ] = None,
    every: Annotated[
        int,
        typer.Option("--every", metavar="N", min=1, help="Leave all but each Nth frame of the motion out."),
    ] = 1,
    quiet: QuietOption = False,
) -> None:
    """Measure what speed costs in accuracy: run a scene with many settings, each against a converged run.

    Finished settings are kept in OUT and not run again; stop and start it as you like.
    """
    with _one_clear_error(None):
        from vtkmuscle.run import frame_numbers
        from vtkmuscle.scene import Scene
        from vtkmuscle.tradeoff import thinned, trade_off, write_plots, write_tables

        if scene == "demo":
            from vtkmuscle import phantoms

            loaded = Scene.from_phantom(phantoms.hip())
        else:
            loaded = Scene.load(scene)
        motion = thinned(loaded.motion, every, len(loaded.motion.times) - 1)
        loaded = replace(loaded, motion=motion)
        compared = None if frames is None else frame_numbers(frames, len(motion.times))
        study = trade_off(
            loaded,
            out,
            only=only or (),
            muscles=muscle or (),
            compared=compared,
            tell=lambda words: _say(quiet, words),
        )
        for path in [*write_tables(out, study), *write_plots(out, study)]:
            _say(quiet, f"wrote {path}")


@app.command("paraview-path")
def paraview_path(
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder",
            metavar="PATH",
            parser=_named,
            help="Folder for the links; by default one in your cache.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Print what to set for ParaView, pvpython and pvbatch to find the filters.

    It fills a folder with links to vtkmuscle, numpy, scipy and numba, for a ParaView whose Python is of the
    same version as this one, and prints commands for your shell:

      eval "$(vtkmuscle paraview-path)"; paraview
    """
    with _one_clear_error(None):
        from vtkmuscle.paraview import environment

        links = (folder or environment.default_folder()).absolute()
        environment.link_packages(links)
    for command in environment.shell_commands(links):
        typer.echo(command)


def _run(scene: Scene, out: Path, options: RunOptions) -> None:
    from vtkmuscle.run.verdict import reasons_of

    if options.quality is not None:
        with _one_clear_error(None):
            scene = scene.with_quality(options.quality)
    console = Console(stderr=True)
    with _one_clear_error(out):
        from vtkmuscle.run.unfinished import unfinished

        left = unfinished(out)
        if left is not None:
            console.print(f"{_one_line(left)}; it is replaced", markup=False, style="yellow", soft_wrap=True)
    with _one_clear_error(out), _progress_bars(list(scene.muscles), console, quiet=options.quiet) as progress:
        result = scene.run(
            out,
            frames=options.frames,
            figures=options.figures,
            progress=progress,
            workers=options.workers,
            series=options.series,
            observe=_table(list(scene.muscles), console) if options.verbose else None,
            overwrite=options.overwrite,
        )
    for name, muscle in result.report["muscles"].items():
        _say(options.quiet, f"{name}: {_found(muscle)}")
        for reason in reasons_of(muscle["verdict"]):
            # What failed is an error, and said with --quiet too.
            if reason.verdict == "failed":
                console.print(f"  {name}: {reason}", markup=False, style="bold red", soft_wrap=True)
            else:
                _say(options.quiet, f"  {reason}")
    _say(options.quiet, f"{result.report['seconds']['total']:.1f} s. Results are in {out}:")
    files = ", ".join(f"{name}.{options.series}" for name in ("NAME", "NAME_fibres", "bones"))
    tables = "lengths.csv, " + ("moment_arms.csv, " if (out / "moment_arms.csv").is_file() else "")
    _say(options.quiet, f"  report.json, {tables}figures/, and {files} for ParaView")
    if "failed" in result.verdicts.values():
        raise typer.Exit(FAILED)


def _found(muscle: Mapping[str, Any]) -> str:
    """Return in a line what a run found of a muscle."""
    frames = muscle["frames"]
    words = [f"{len(frames)} frames"]
    volumes = [row["volume_ratio"] for row in frames if row.get("volume_ratio") is not None]
    if volumes:
        words.append(f"volume within {max(abs(volume - 1.0) for volume in volumes):.2%}")
    depths = [
        row["penetration_new_max_mm"] for row in frames if row.get("penetration_new_max_mm") is not None
    ]
    if depths:
        rest = muscle["rest"]["penetration_max_mm"]
        at_rest = f", where it is {rest:.2f} mm" if rest else ""
        words.append(f"at most {max(depths):.2f} mm deeper in a bone than at rest{at_rest}")
    return f"{', '.join(words)}: {muscle['verdict']['verdict']}"


def _table(muscles: list[str], console: Console) -> Callable[[str, Mapping[str, Any]], None]:
    """Return what prints a row of figures of each frame, above the progress bars."""
    from vtkmuscle.filters.deformer.convergence_table import ConvergenceTable

    width = max(map(len, muscles))
    table = ConvergenceTable(console, label_width=width + 8)
    return lambda muscle, row: table.add(f"{muscle:<{width}} {row['time']:g}", row)


@contextmanager
def _progress_bars(
    muscles: list[str], console: Console, *, quiet: bool
) -> Iterator[Callable[[str, str, float], None] | None]:
    if quiet:
        yield None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[stage]}", markup=False),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=console) as bars:
        tasks = {name: bars.add_task(name, total=1.0, stage="waiting", start=False) for name in muscles}

        def show(muscle: str, stage: str, fraction: float) -> None:
            # The clock starts with the first frame: the stages before it say nothing of the rest.
            if fraction > 0 or stage == "deforming":
                bars.start_task(tasks[muscle])
            bars.update(tasks[muscle], completed=fraction, stage=stage)

        yield show


@contextmanager
def _one_clear_error(out: Path | None) -> Iterator[None]:
    """Turn bad input and Ctrl-C into one message and an exit status; show warnings in one line."""
    console = Console(stderr=True, soft_wrap=True, highlight=False)

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        console.print(f"warning: {_one_line(str(message))}", markup=False, style="yellow")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = show
            yield
    except (ValueError, OSError) as error:
        # ValueErrors of the package say what was wrong with the input; a fault in it has a traceback.
        console.print(f"error: {_words(error)}", markup=False, style="bold red")
        raise typer.Exit(BAD_INPUT) from error
    except MemoryError as error:
        console.print("error: there is not enough memory for this", markup=False, style="bold red")
        raise typer.Exit(BAD_INPUT) from error
    except KeyboardInterrupt as stop:
        console.print(f"stopped. {_what_is_finished(out)}", markup=False, style="yellow")
        status = 128 + stop.number if isinstance(stop, TerminatedError) else INTERRUPTED
        raise typer.Exit(status) from None


def _words(error: Exception) -> str:
    words = str(error)
    if isinstance(error, OSError) and error.strerror:
        words = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return _one_line(words)


def _one_line(words: str) -> str:
    """Return a text without what a terminal would take for more than text."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)


def _what_is_finished(out: Path | None) -> str:
    from vtkmuscle.run.claim import read_report
    from vtkmuscle.run.unfinished import frames_there

    report = None if out is None else read_report(out)
    if out is None or report is None or report["complete"]:
        return "Nothing was written."
    counts = frames_there(out)
    if not any(counts.values()):
        return f"No frame was finished; {out} holds a report.json that says so."
    listed = ", ".join(f"{name} {count}" for name, count in counts.items())
    return f"Finished frames can be read in {out}: {listed} (lengths.csv and report.json hold these)"


def _facts_of_run(folder: Path) -> dict[str, str]:
    """Return what is in the folder of a run, also of one that was killed."""
    from vtkmuscle.run.claim import read_report
    from vtkmuscle.run.unfinished import frames_there

    report = read_report(folder)
    if report is None:
        raise ValueError(f"{folder}: this is a folder without the report.json of a run")
    ended = "yes" if report["complete"] else f"no: {report.get('stopped_by') or 'it was killed'}"
    frames = {name: f"{count} frames" for name, count in frames_there(folder).items()}
    return {"scene": str(report.get("scene")), "complete": ended, **frames}


def _facts(file: Path) -> dict[str, str]:
    if file.is_dir():
        return _facts_of_run(file)
    import numpy as np

    from vtkmuscle.core.mesh.surface import survey
    from vtkmuscle.data.arrays import points_of, triangles_of
    from vtkmuscle.io import read_polydata

    data = read_polydata(file)
    points = points_of(data)
    if not np.isfinite(points).all():
        bad = int((~np.isfinite(points).all(axis=1)).sum())
        return {"points": str(len(points)), "not finite": f"{bad} points; correct them"}
    lowest, highest = points.min(axis=0), points.max(axis=0)
    longest = float((highest - lowest).max())
    bounds = "  ".join(f"{a:.6g} .. {b:.6g}" for a, b in zip(lowest, highest, strict=True))
    size = {"bounds": bounds, "unit": f"{_unit_guess(longest)} (the longest side is {longest:.4g})"}
    if data.GetNumberOfPolys() == 0:
        return {"points": str(len(points)), "polylines": str(data.GetNumberOfLines()), **size}
    try:
        report = survey(points, triangles_of(data, str(file)))
    except ValueError as error:
        return {
            "points": str(len(points)),
            "polygons": str(data.GetNumberOfPolys()),
            "faces": str(error),
            **size,
        }
    side = "outward" if report.volume > 0 else "inward: the surface is inside out"
    return {
        "triangles": str(report.n_triangles),
        "points": f"{report.n_points}" + _but(report.n_unused_points, "belong to no triangle"),
        "closed": _yes(report.closed, f"{report.n_boundary_edges} edges have one triangle"),
        "manifold": _yes(report.manifold, f"{report.n_nonmanifold_edges} edges have more than two triangles"),
        "oriented": _yes(report.oriented, f"{report.n_misoriented_edges} edges disagree")
        + (f", {side}" if report.closed and report.oriented else ""),
        "pieces": str(report.n_components),
        "degenerate": f"{report.n_degenerate_triangles} triangles without area",
        "area": f"{report.area:.6g}",
        "volume": f"{report.volume:.6g}" if report.closed else "none, it is open",
        **size,
    }


def _unit_guess(longest: float) -> str:
    if longest >= _SHORTEST_IN_MILLIMETRES:
        return "probably mm"
    return "probably m" if longest <= _LONGEST_IN_METRES else "perhaps cm"


def _yes(good: bool, otherwise: str) -> str:
    return "yes" if good else f"no, {otherwise}"


def _but(count: int, what: str) -> str:
    return f", {count} of them {what}" if count else ""


def _say(quiet: bool, text: str) -> None:
    if not quiet:
        typer.echo(text)

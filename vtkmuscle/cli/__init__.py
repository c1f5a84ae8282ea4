"""The command line: ``vtkmuscle run``, ``demo``, ``cohort``, ``info``, ``export`` and more.

Commands import heavy modules on use, so that ``vtkmuscle --help`` is fast.
"""

import gc
import os
import signal
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

import vtkmuscle
from vtkmuscle import io
from vtkmuscle.cli import options as shared
from vtkmuscle.cli.options import Status
from vtkmuscle.cli.results import check, compare, export, figures, from_labels, init, report
from vtkmuscle.cli.running import cohort, run_and_report, tradeoff
from vtkmuscle.core.errors import InputError
from vtkmuscle.io.children import start_early

#: Flexion in the frames of the demo [degrees]: the range of the phantom, in fewer steps.
DEMO_ANGLES = tuple(range(0, 91, 5))

__all__ = ["Status", "app", "main"]

_AIM = "Deform muscles with moving bones, fill them with fibres, and measure them."
app = typer.Typer(name="vtkmuscle", help=_AIM, no_args_is_help=True, add_completion=False)
app.pretty_exceptions_enable = False
command = partial(app.command, cls=shared.Command)


def main() -> None:
    """Run the command line; the console entry point."""
    for name in ("SIGTERM", "SIGHUP"):  # the latter is not known to Windows
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _terminate)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, shared.interrupt)
    try:
        app()
    except OSError as error:  # commands print their own errors: this one is of the printing
        with suppress(OSError):
            sys.stderr.write(f"error: standard output cannot be written: {error.strerror}\n")
        sys.exit(Status.BAD_INPUT)
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except OSError:  # has been told: what is left in the buffer would fail again at the end
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        gc.freeze()  # no search for cycles: the end of the process frees all memory


def _terminate(number: int, _frame: object) -> None:
    """Stop as on Ctrl-C: finished frames are measured and listed."""
    raise shared.TerminatedError(number)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"vtkmuscle {vtkmuscle.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@command()
@shared.with_options
def run(
    scene: Annotated[Path, Argument(help="A scene.toml.")],
    out: shared.OutOption = None,
    *,
    options: shared.RunArguments,
) -> None:
    """Run a scene: deform muscles, move their fibres, measure and write results.

    Without --out results go to NAME_out in the working folder; with --muscle to NAME_MUSCLE_out.
    """
    start_early(options.workers)
    loaded = vtkmuscle.Scene.load(scene)
    # A run of some muscles would remove the others' results from the folder of all.
    run_and_report(loaded, out or Path("_".join([loaded.name, *(options.muscle or ()), "out"])), options)


@command()
@shared.with_options
def demo(out: shared.OutOption = None, *, options: shared.RunArguments) -> None:
    """Run a phantom hip, and write its scene as a template. Without --out results go to vtkmuscle_demo."""
    folder = out or Path("vtkmuscle_demo")
    start_early(options.workers)
    from vtkmuscle.scene.writing import save_unless_there

    scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.hip(angles=DEMO_ANGLES))
    scene.chosen(**options.choice)  # an unknown muscle is an error before a file is written
    path = save_unless_there(scene, folder / "scene", overwrite=options.overwrite)
    shared.say_run(options.quiet, f"The scene is {path}: edit it, or use your own surfaces, and run", path)
    run_and_report(vtkmuscle.Scene.load(path), folder, options)


@command()
def selftest() -> None:
    """Test the installation with known answers, and print what a report of a problem needs."""
    from vtkmuscle import installation

    for word, fact in installation.installation().items():
        typer.echo(f"{word:<12}{fact}")
    table = installation.selftest()
    for quantity, measured, expected, within, passed in zip(*table.values(), strict=True):
        verdict = "passed" if passed else "FAILED"
        typer.echo(f"{verdict}  {quantity}: {measured:.6g}, known {expected:.6g}, within {within:g}")
    if not table["passed"].all():
        raise typer.Exit(Status.FAILED)


@command()
def info(
    files: Annotated[list[Path], Argument(help="Meshes, landmarks, scenes, OpenSim files, or results.")],
    draw: Annotated[Path | None, Option(metavar="PNG", help="Draw the first file, of landmarks.")] = None,
    overwrite: shared.OverwriteOption = False,
) -> None:
    """Describe meshes: size, topology, pieces, volume, likely unit.

    Landmarks: number, ring, frame. OpenSim models: bodies, joints, coordinates, muscles. Motions: columns.
    Folders of results: frames.
    """
    from vtkmuscle.cli.info import draw_landmarks, facts_of

    for file in files:
        typer.echo(f"{file}")
        for word, value in facts_of(file).items():
            typer.echo(f"  {word:<11} {value}")
    if draw is not None:
        with io.Outputs(draw.parent, inputs=files, overwrite=overwrite):
            draw_landmarks(files[0], draw)
        typer.echo(f"wrote {draw}")


for verb in (export, report, figures, compare, cohort, tradeoff, from_labels, init, check):
    command(verb.__name__.replace("_", "-"))(verb)


@command()
def fetch(
    name: Annotated[str | None, Argument(help="A data set. Without a name, list all of them.")] = None,
    out: shared.OutOption = None,
    accept_licence: Annotated[bool, Option("--accept-licence", help="Accept it without a question.")] = False,
    host: Annotated[str | None, Option(metavar="URL", help="A mirror of GitHub's raw files.")] = None,
    quiet: shared.QuietOption = False,
) -> None:
    """Download a public data set as a scene, under its own licence.

    The command shows the licence and asks for consent. Without --out the folder has the name of the data set.
    """
    from vtkmuscle import public_data as public

    if name is None:
        typer.echo(f"{public.NAME}: {public.TITLE}")
        return
    if name == public.NAME:
        typer.echo(public.LICENCE)
        if not (accept_licence or (sys.stdin.isatty() and typer.confirm("Do you accept the licence?"))):
            raise InputError(name, "the licence is not accepted", "add --accept-licence to accept")
    announce = partial(shared.say, quiet)
    path = public.fetch(name, out, accept_licence=True, host=host or public.HOST, announce=announce)
    shared.say_run(quiet, f"The scene is {path}. Run", path)


@command("paraview-path")
def paraview_path(
    folder: Annotated[
        Path | None, Option(metavar="PATH", parser=shared.named, help="Default: one in your cache.")
    ] = None,
) -> None:
    """Print the environment variables for the filters in ParaView.

    The command fills a folder with links to vtkmuscle and required packages, for a ParaView with the Python
    version of this environment, and prints shell commands:

      eval "$(vtkmuscle paraview-path)"; paraview
    """
    from vtkmuscle.paraview import environment

    links = (folder or environment.default_folder()).absolute()
    environment.link_packages(links)
    for line in environment.shell_commands(links):
        typer.echo(line)

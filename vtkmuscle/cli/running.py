"""Runs of scenes from the command line: progress and outcome."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer import Argument, Option

import vtkmuscle
from vtkmuscle.cli import options as shared
from vtkmuscle.core.errors import InputError


def run_and_report(scene: "vtkmuscle.Scene", out: Path, options: shared.RunArguments) -> None:
    """Run a scene, and print the outcome and the files."""
    from vtkmuscle.run.store import PAGE, ResultFolder
    from vtkmuscle.run.verdict import reasons_of

    scene, _ = scene.chosen(**options.choice)
    tell = partial(shared.say, options.quiet)
    with shared.one_clear_error(out):
        left = None if options.only is not None else ResultFolder(out).unfinished()
        if left is not None:
            then = "the run starts again" if options.fresh else "finished muscles are kept"
            shared.print_error(shared.one_line(f"{out} {left}; {then}"), style="yellow")
        result = _run(scene, out, options)
    if options.only is not None:
        tell(f"The {options.only.replace('_', ' ')} are in {out}")
        return
    if result.report["taken_over"]:
        tell(f"kept from an earlier run with equal inputs: {', '.join(result.report['taken_over'])}")
    for name, muscle in result.report["muscles"].items():
        tell(f"{name}: {_summary(muscle)}")
        for reason in reasons_of(muscle["verdict"]):
            if reason.verdict == "failed":  # with --quiet too
                shared.print_error(f"error: {name}: {reason}")
            else:
                tell(f"  {reason}")
    names = ("report.json", "lengths.csv", "fibre_lengths.csv", "moment_arms.csv", "figures/")
    tell(f"{result.report['seconds']['total']:.1f} s. Results are in {out}:")
    tell(f"  {', '.join(name for name in names if (out / name).exists())}, and .pvd files for ParaView")
    if options.report:
        tell(f"Open {out / PAGE} in a browser: scene, curves, tables, validity")
    if "failed" in result.verdicts.values():
        raise typer.Exit(shared.Status.FAILED)


def _run(scene: "vtkmuscle.Scene", out: Path, options: shared.RunArguments) -> Any:
    """Run a scene, or compute a single output, with progress bars."""
    from vtkmuscle.run import run_only

    names = ["frames", "workers", "overwrite", *["figures", "report", "fresh"] * (options.only is None)]
    settings: dict[str, Any] = {name: getattr(options, name) for name in names}
    with progress_bars(scene.muscles, quiet=options.quiet) as progress:
        if options.only is not None:
            return run_only(scene, options.only, out, progress=progress, **settings)
        return scene.run(out, progress=progress, **settings)


def _summary(muscle: Mapping[str, Any]) -> str:
    """Return a muscle's outcome in a line."""
    frames = muscle["frames"]
    words = [f"{len(frames)} frame{'s' * (len(frames) != 1)}"]
    keys = "volume_ratio", "penetration_new_max_mm"
    volumes, depths = ([row[key] for row in frames if row.get(key) is not None] for key in keys)
    if volumes:
        words.append(f"volume within {max(abs(volume - 1.0) for volume in volumes):.2%}")
    if depths:
        rest = muscle["rest"]["penetration_max_mm"]
        at_rest = f" ({rest:.2f} mm)" if rest else ""
        words.append(f"at most {max(depths):.2f} mm deeper in a bone than at rest{at_rest}")
    return f"{', '.join(words)}: {muscle['verdict']['verdict']}"


@contextmanager
def progress_bars(
    muscles: Iterable[str] = (), *, quiet: bool = False
) -> Iterator[Callable[[str, str, float], None]]:
    """Show a bar per muscle; further muscles get one with their first progress."""
    if quiet:
        yield lambda *_: shared.stop_if_interrupted()
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    name, stage = (TextColumn(f"{{task.{word}}}", markup=False) for word in ("description", "fields[stage]"))
    remaining = TimeRemainingColumn(elapsed_when_finished=True)
    columns = (name, BarColumn(), TaskProgressColumn(), stage, remaining)
    bars = Progress(*columns, console=Console(stderr=True))
    tasks = {name: bars.add_task(name, total=1.0, stage="waiting", start=False) for name in muscles}
    with ExitStack() as stack:
        if tasks:
            stack.enter_context(bars)

        def show(muscle: str, stage: str, fraction: float) -> None:
            shared.stop_if_interrupted()
            if not bars.live.is_started:
                stack.enter_context(bars)
            if muscle not in tasks:
                tasks[muscle] = bars.add_task(muscle, total=1.0, stage=stage, start=False)
            # The clock starts with the first frame: earlier stages do not predict the remaining time.
            if fraction > 0 or stage == "deforming":
                bars.start_task(tasks[muscle])
            bars.update(tasks[muscle], completed=fraction, stage=stage)

        yield show


@shared.with_options
def cohort(
    scenes: Annotated[list[Path], Argument(help="The scene.toml of each subject.")],
    out: shared.FolderOption,
    *,
    options: shared.CohortOptions,
) -> None:
    """Run the scenes of many subjects, and write a table of muscles.

    Finished subjects in OUT are not run again: the command can be stopped and restarted.
    """

    def show(rows: Sequence[Mapping[str, Any]]) -> None:
        for row in rows:
            words = [row["subject"], row["muscle"], row["verdict"], row["message"]]
            line = shared.one_line(": ".join(word for word in words if word))
            shared.print_error(line) if row["verdict"] == "failed" else shared.say(options.quiet, line)

    names = ("workers", "frames", "figures", "report", "fresh", "overwrite")
    settings = {name: getattr(options, name) for name in names} | options.choice
    table = vtkmuscle.cohort([str(scene) for scene in scenes], out, progress=show, **settings)
    shared.say(options.quiet, f"wrote {out / 'cohort.csv'}, {len(table['muscle'])} rows")
    if "failed" in table["verdict"]:
        raise typer.Exit(shared.Status.FAILED)


@dataclass(frozen=True, kw_only=True)
class TradeoffOptions:
    """The options of a comparison of settings."""

    vary: Annotated[
        list[str] | None,
        Option(
            metavar="SETTING=A,B",
            help="Values of a setting, such as n_paths=25,49,1000 or paths.resolution=24,32; repeatable, all "
            "combinations are run. "
            "Default: deformer=none,paths,pbd and quality=preview,balanced,accurate.",
        ),
    ] = None
    within: Annotated[float | None, Option(metavar="MM", help="Print the cheapest setting within.")] = None
    frames: shared.FramesOption = None
    workers: Annotated[int, Option(metavar="N", min=1, help="Processes; several disturb the times.")] = 1
    overwrite: shared.OverwriteOption = False
    quiet: shared.QuietOption = False


@shared.with_options
def tradeoff(
    scene: Annotated[Path, Argument(help="A scene.toml.")],
    out: shared.FolderOption,
    *,
    options: TradeoffOptions,
) -> None:
    """Measure speed against accuracy of a scene's settings: a table and a figure.

    The time is that of the processor a pose; errors are root mean squares to the limit of the deformer, and
    to published moment arms of the scene. Finished runs in OUT are not run again.
    """
    from rich.table import Table

    from vtkmuscle.tradeoffs import ALL, ERRORS, TRIED

    varied = shared.pairs(options.vary, "--vary")
    settings = {name: [_value(text) for text in texts.split(",")] for name, texts in varied.items()}

    def show(rows: Sequence[Mapping[str, Any]]) -> None:
        shared.stop_if_interrupted()
        words = [str(value) for name, value in rows[0].items() if name in (*settings, *TRIED, "limit")]
        shared.say(options.quiet, f"{', '.join(words)}: {rows[0]['message'] or rows[0]['verdict']}")

    kept: dict[str, Any] = {name: getattr(options, name) for name in ("frames", "workers", "overwrite")}
    for name in settings.keys() & {"scene", "out", "progress", *kept}:
        raise InputError("--vary", f"{name!r} is no setting of a scene", "vary e.g. quality, or n_paths")
    result = vtkmuscle.tradeoff(vtkmuscle.Scene.load(scene), out, progress=show, **kept | settings)
    whole, shown = result.table.where(muscle=ALL), (*result.settings, "verdict", "ms", *ERRORS)
    headings = (name.removesuffix("_rms_mm").replace("_", " ") for name in shown)
    table = Table(*headings, box=None, caption="ms a pose; errors: RMS in mm, of the worst muscle")
    for row in zip(*(whole[name] for name in shown), strict=True):
        table.add_row(*(f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row))
    if not options.quiet:
        Console().print(table)
    if options.within is not None:
        best = result.cheapest(options.within)
        typer.echo(", ".join(f"{name} = {best[name]}" for name in result.settings), nl=False)
        typer.echo(f": {best['ms']:.3g} ms a pose, error {best['error_mm']:.2g} mm, {best['verdict']}")
    shared.say(options.quiet, f"wrote {out / 'tradeoff.csv'}, {out / 'tradeoff.png'}")


def _value(text: str) -> int | float | str:
    """Return a number where the text is one."""
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text

"""Run a scene or a study from the command line: progress, and what was found."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from vtkmuscle.cli.messages import FAILED, one_clear_error, one_line, print_error, say
from vtkmuscle.cli.options import FolderOption, FreshOption, QuietOption, RunOptions, with_options

if TYPE_CHECKING:
    from vtkmuscle.run import Result
    from vtkmuscle.scenes import Scene
    from vtkmuscle.studies.study import Progress


def run_and_report(scene: Scene, out: Path, options: RunOptions) -> None:
    """Run a scene, and print what was found and where it is."""
    from vtkmuscle.run.store import PAGE, ResultFolder
    from vtkmuscle.run.verdict import reasons_of

    if options.muscle:
        scene = scene.with_muscles(*options.muscle)
    chosen = {"deformer": options.deformer, "quality": options.quality}
    chosen = {name: value for name, value in chosen.items() if value is not None}
    if chosen:
        scene = replace(scene, **chosen)
    tell = partial(say, options.quiet)
    with one_clear_error(out):
        left = ResultFolder(out).unfinished()
        if left is not None:
            then = "it is replaced" if options.fresh else "what it has finished is taken over"
            print_error(one_line(f"{out} {left}; {then}"), style="yellow")
        result = _run(scene, out, options)
    if result.report["taken_over"]:
        words = ", ".join(result.report["taken_over"])
        tell(f"taken over from an earlier run, for nothing they depend on has changed: {words}")
    for name, muscle in result.report["muscles"].items():
        tell(f"{name}: {_summary(muscle)}")
        for reason in reasons_of(muscle["verdict"]):
            if reason.verdict == "failed":  # with --quiet too
                print_error(f"error: {name}: {reason}")
            else:
                tell(f"  {reason}")
    written = ["report.json", "lengths.csv", "fibre_lengths.csv"]
    written += [name for name in ("moment_arms.csv", "figures/") if (out / name).exists()]
    tell(f"{result.report['seconds']['total']:.1f} s. Results are in {out}:")
    tell(f"  {', '.join(written)}, and NAME.pvd, NAME_fibres.pvd, bones.pvd for ParaView")
    if options.report:
        tell(f"Look at {out / PAGE} in a browser: the scene, curves, tables and what to make of them")
    if "failed" in result.verdicts.values():
        raise typer.Exit(FAILED)


def _run(scene: Scene, out: Path, options: RunOptions) -> Result:
    """Run a scene, with further solves for its errors where they are asked for."""
    console, muscles = Console(stderr=True), list(scene.muscles)
    given: dict[str, Any] = {
        name: getattr(options, name)
        for name in ("frames", "figures", "report", "workers", "overwrite", "fresh")
    }
    if options.verbose:
        given["observe"] = _table(muscles, console)
    with _progress_bars(muscles, console, quiet=options.quiet) as progress:
        if options.errors is None:
            return scene.run(out, progress=progress, **given)
        from vtkmuscle.studies.errors import run_with_errors

        return run_with_errors(
            scene,
            out,
            errors=options.errors == "all" or [one for one in options.errors.split(",") if one],
            landmark_error=options.landmark_error,
            landmark_samples=options.landmark_samples,
            progress=progress,
            **given,
        )


def _summary(muscle: Mapping[str, Any]) -> str:
    """Return in a line what a run found of a muscle."""
    frames = muscle["frames"]
    words = [f"{len(frames)} frames"]
    volumes, depths = (
        [row[key] for row in frames if row.get(key) is not None]
        for key in ("volume_ratio", "penetration_new_max_mm")
    )
    if volumes:
        words.append(f"volume within {max(abs(volume - 1.0) for volume in volumes):.2%}")
    if depths:
        rest = muscle["rest"]["penetration_max_mm"]
        at_rest = f", where it is {rest:.2f} mm" if rest else ""
        words.append(f"at most {max(depths):.2f} mm deeper in a bone than at rest{at_rest}")
    return f"{', '.join(words)}: {muscle['verdict']['verdict']}"


def _table(muscles: list[str], console: Console) -> Callable[[str, Mapping[str, Any]], None]:
    """Return a function that prints a row of figures of each frame, above the progress bars."""
    from vtkmuscle.filters.deformer.shape_report import FrameTable

    width = max(map(len, muscles))
    table = FrameTable(console, label_width=width + 8)
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


@dataclass(frozen=True, kw_only=True)
class CohortOptions:
    """The options of a cohort, named as those of ``run_study``."""

    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="Of a Dask cluster that is there already.")
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Processes on this machine. Default: one per processor."),
    ] = None
    memory: Annotated[
        str | None, typer.Option(metavar="4GB", help="What each of them may take. Default: its share.")
    ] = None
    retries: Annotated[
        int, typer.Option(metavar="N", min=0, help="How often a muscle may lose its worker.")
    ] = 2
    fresh: FreshOption = False
    quiet: QuietOption = False


@with_options
def cohort(
    study: Annotated[Path, typer.Argument(help="A STUDY.toml.")], out: FolderOption, *, options: CohortOptions
) -> None:
    """Run a study: every muscle of many subjects, by Dask, into one table and a page.

    What is finished is kept in OUT and not run again; stop and start it as you like.
    """
    from vtkmuscle.studies.cohort import Study, run_study

    loaded, given = Study.load(study), asdict(options)
    tell = partial(say, given.pop("quiet"))
    _silence_dask()
    with _study_bars(quiet=options.quiet) as progress:
        report = run_study(loaded, out, progress=progress, announce=tell, **given)
    tasks = report["tasks"]
    counts = ", ".join(f"{count} {state}" for state, count in tasks.items())
    tell(f"{sum(tasks.values())} muscles of {report['subjects']} subjects: {counts}. Results are in {out}:")
    tell("  cohort.html, cohort.csv")
    if tasks.get("failed"):
        raise typer.Exit(FAILED)


def _silence_dask() -> None:
    """Turn off Dask's own messages: the study says what has happened to a cluster."""
    if find_spec("distributed") is None:
        return  # the study says so
    import distributed  # noqa: F401 -- it sets up its loggers

    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


@contextmanager
def _study_bars(*, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Give a function that prints failures and, unless quiet, the progress in a bar, or lines in a file."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    columns = TextColumn("muscles"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[left]}")
    seen = console.is_terminal
    with Bars(*columns, console=console, disable=quiet or not seen) as bars:
        bar = bars.add_task("muscles", total=None, left="")

        def show(ended: Progress) -> None:
            left = "" if ended.seconds_left is None else f"{_duration(ended.seconds_left)} left"
            bars.update(bar, total=ended.total, completed=ended.done, left=left)
            who = ", ".join(part for part in (*ended.case.labels.values(), ended.case.muscle) if part)
            if ended.state == "failed":
                print_error(f"{who}: {one_line(ended.words)}", console=console)
            elif not quiet and not seen:
                words = f"{ended.done} of {ended.total}: {who}: {ended.words}{', ' + left if left else ''}"
                print_error(words, style="", console=console)

        yield show


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    if minutes >= 120:
        return f"{minutes / 60.0:.1f} h"
    return f"{minutes} min" if minutes >= 2 else f"{seconds:.0f} s"

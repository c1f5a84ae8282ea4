"""Run a scene or a study from the command line: progress, and what was found."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from vtkmuscle.cli.messages import FAILED, INTERRUPTED, TerminatedError, one_clear_error, one_line, say
from vtkmuscle.cli.options import FolderOption, FreshOption, QuietOption, RunOptions, with_options

if TYPE_CHECKING:
    from vtkmuscle.run import Result
    from vtkmuscle.scenes import Scene
    from vtkmuscle.studies.study import Progress


def run_and_report(scene: Scene, out: Path, options: RunOptions) -> None:
    """Run a scene, and print what was found and where it is."""
    from vtkmuscle.run.store import PAGE, ResultFolder
    from vtkmuscle.run.verdict import reasons_of

    with one_clear_error(None):
        if options.muscle:
            scene = scene.with_muscles(*options.muscle)
        if options.quality is not None:
            scene = scene.with_quality(options.quality)
    console = Console(stderr=True)
    with one_clear_error(out):
        left = ResultFolder(out).unfinished()
        if left is not None:
            then = "it is replaced" if options.fresh else "what it has finished is taken over"
            words = one_line(f"{out} {left}; {then}")
            console.print(words, markup=False, style="yellow", soft_wrap=True)
    with one_clear_error(out), _progress_bars(list(scene.muscles), console, quiet=options.quiet) as progress:
        result = _run(
            scene,
            out,
            options,
            frames=options.frames,
            figures=options.figures,
            report=options.report,
            progress=progress,
            workers=options.workers,
            observe=_table(list(scene.muscles), console) if options.verbose else None,
            overwrite=options.overwrite,
            fresh=options.fresh,
        )
    if result.report["taken_over"]:
        words = ", ".join(result.report["taken_over"])
        say(options.quiet, f"taken over from an earlier run, for nothing they depend on has changed: {words}")
    for name, muscle in result.report["muscles"].items():
        say(options.quiet, f"{name}: {_summary(muscle)}")
        for reason in reasons_of(muscle["verdict"]):
            # What failed is an error, and said with --quiet too.
            if reason.verdict == "failed":
                console.print(f"error: {name}: {reason}", markup=False, style="bold red", soft_wrap=True)
            else:
                say(options.quiet, f"  {reason}")
    say(options.quiet, f"{result.report['seconds']['total']:.1f} s. Results are in {out}:")
    tables = "lengths.csv, fibre_lengths.csv, "
    tables += "moment_arms.csv, " if (out / "moment_arms.csv").is_file() else ""
    tables += "figures/, " if (out / "figures").is_dir() else ""
    say(options.quiet, f"  report.json, {tables}and NAME.pvd, NAME_fibres.pvd, bones.pvd for ParaView")
    if options.report:
        say(
            options.quiet,
            f"Look at {out / PAGE} in a browser: the scene, curves, tables and what to make of them",
        )
    if "failed" in result.verdicts.values():
        raise typer.Exit(FAILED)


def _run(scene: Scene, out: Path, options: RunOptions, **given: Any) -> Result:
    """Run a scene, with further solves for its errors where they are asked for."""
    if options.errors is None:
        return scene.run(out, **given)
    from vtkmuscle.studies.errors import run_with_errors

    return run_with_errors(
        scene,
        out,
        errors=options.errors == "all" or [one for one in options.errors.split(",") if one],
        landmark_error=options.landmark_error,
        landmark_samples=options.landmark_samples,
        **given,
    )


def _summary(muscle: Mapping[str, Any]) -> str:
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
    """The options of a cohort."""

    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="tcp://HOST:PORT", help="Of a Dask cluster that is there already."
        ),
    ] = None
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", metavar="N", min=1, help="Processes on this machine. Default: one per processor."
        ),
    ] = None
    memory: Annotated[
        str | None,
        typer.Option("--memory", metavar="4GB", help="What each of them may take. Default: its share."),
    ] = None
    retries: Annotated[
        int, typer.Option("--retries", metavar="N", min=0, help="How often a muscle may lose its worker.")
    ] = 2
    fresh: FreshOption = False
    quiet: QuietOption = False


@with_options
def cohort(
    study: Annotated[Path, typer.Argument(help="A STUDY.toml.")],
    out: FolderOption,
    *,
    options: CohortOptions,
) -> None:
    """Run a study: every muscle of many subjects, by Dask, into one table and a page.

    What is finished is kept in OUT and not run again; stop and start it as you like.
    """
    with one_clear_error(None):
        from vtkmuscle.studies.cohort import Study, run_study

        loaded = Study.load(study)
        _silence_dask()
        try:
            with _study_bars(quiet=options.quiet) as progress:
                report = run_study(
                    loaded,
                    out,
                    scheduler=options.scheduler,
                    workers=options.workers,
                    memory=options.memory,
                    retries=options.retries,
                    fresh=options.fresh,
                    progress=progress,
                    announce=lambda words: say(options.quiet, words),
                )
        except KeyboardInterrupt as stop:
            console = Console(stderr=True, soft_wrap=True, highlight=False)
            words = f"stopped. What is finished is kept in {out}: the same command goes on from there"
            console.print(words, markup=False, style="yellow")
            status = 128 + stop.number if isinstance(stop, TerminatedError) else INTERRUPTED
            raise typer.Exit(status) from None
    tasks = report["tasks"]
    counts = ", ".join(f"{count} {state}" for state, count in tasks.items())
    say(
        options.quiet,
        f"{sum(tasks.values())} muscles of {report['subjects']} subjects: {counts}. Results are in {out}:",
    )
    say(options.quiet, "  cohort.html, cohort.csv")
    if tasks.get("failed"):
        raise typer.Exit(FAILED)


def _silence_dask() -> None:
    """Leave it to this program to say what has happened to a cluster."""
    from importlib.util import find_spec

    if find_spec("distributed") is None:
        return  # the study says so
    import distributed  # noqa: F401 -- it sets up its loggers

    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


@contextmanager
def _study_bars(*, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Give what prints failures, and, unless it is to be quiet, subjects that are done and the time left."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True, highlight=False)
    columns = TextColumn("muscles"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[left]}")
    seen = console.is_terminal
    with Bars(*columns, console=console, disable=quiet or not seen) as bars:
        bar = bars.add_task("muscles", total=None, left="")

        def show(ended: Progress) -> None:
            left = "" if ended.seconds_left is None else f"{_in_words(ended.seconds_left)} left"
            bars.update(bar, total=ended.total, completed=ended.done, left=left)
            who = ", ".join(part for part in (*ended.case.labels.values(), ended.case.muscle) if part)
            if ended.state == "failed":
                words = f"{who}: {one_line(ended.words)}"
                console.print(words, markup=False, style="bold red", soft_wrap=True)
            elif not quiet and not seen:  # a file has no bar
                words = f"{ended.done} of {ended.total}: {who}: {ended.words}{', ' + left if left else ''}"
                console.print(words, markup=False, soft_wrap=True)

        yield show


def _in_words(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    if minutes >= 120:
        return f"{minutes / 60.0:.1f} h"
    return f"{minutes} min" if minutes >= 2 else f"{seconds:.0f} s"

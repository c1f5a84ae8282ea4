"""Run a study from the command line: progress per subject, the time that is left, and what came out."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from vtkmuscle.cli.messages import FAILED, INTERRUPTED, TerminatedError, one_clear_error, one_line, say
from vtkmuscle.cli.options import FolderOption, FreshOption, QuietOption, with_options

if TYPE_CHECKING:
    from vtkmuscle.studies.study import Progress


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
            with _progress_bars(quiet=options.quiet) as progress:
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
def _progress_bars(*, quiet: bool) -> Iterator[Callable[[Progress], None]]:
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

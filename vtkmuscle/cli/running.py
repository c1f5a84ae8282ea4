"""Run a scene from the command line: progress, figures of frames, and what was found of each muscle."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console

from vtkmuscle.cli.messages import FAILED, one_clear_error, one_line, say
from vtkmuscle.cli.options import RunOptions

if TYPE_CHECKING:
    from vtkmuscle.run import Result
    from vtkmuscle.scenes import Scene


def run_and_tell(scene: Scene, out: Path, options: RunOptions) -> None:
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
            series=options.series,
            observe=_table(list(scene.muscles), console) if options.verbose else None,
            overwrite=options.overwrite,
            fresh=options.fresh,
        )
    if result.report["taken_over"]:
        words = ", ".join(result.report["taken_over"])
        say(options.quiet, f"taken over from an earlier run, for nothing they depend on has changed: {words}")
    for name, muscle in result.report["muscles"].items():
        say(options.quiet, f"{name}: {_found(muscle)}")
        for reason in reasons_of(muscle["verdict"]):
            # What failed is an error, and said with --quiet too.
            if reason.verdict == "failed":
                console.print(f"error: {name}: {reason}", markup=False, style="bold red", soft_wrap=True)
            else:
                say(options.quiet, f"  {reason}")
    say(options.quiet, f"{result.report['seconds']['total']:.1f} s. Results are in {out}:")
    files = ", ".join(f"{name}.{options.series}" for name in ("NAME", "NAME_fibres", "bones"))
    tables = "lengths.csv, fibre_lengths.csv, "
    tables += "moment_arms.csv, " if (out / "moment_arms.csv").is_file() else ""
    tables += "figures/, " if (out / "figures").is_dir() else ""
    say(options.quiet, f"  report.json, {tables}and {files} for ParaView")
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

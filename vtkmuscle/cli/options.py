"""Options shared by commands."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer


def named(text: str) -> Path:
    """Return a path; empty texts are refused."""
    if not text:
        raise typer.BadParameter("it is empty; give the name of a folder")
    return Path(text)


def out_option(metavar: str, help: str) -> Any:  # noqa: A002 -- typer's word
    """Return the option of the output path."""
    return typer.Option("--out", "-o", metavar=metavar, parser=named, help=help)


OutOption = Annotated[Path | None, out_option("PATH", "Folder to write to.")]
FolderOption = Annotated[Path, out_option("PATH", "Folder to write to.")]
FramesOption = Annotated[
    str | None,
    typer.Option(metavar="A:B", help="Frames to write, counted from 0; B is not included. Default: all."),
]
FreshOption = Annotated[
    bool, typer.Option("--fresh", help="Compute again what is finished in the folder of results.")
]
LiteratureOption = Annotated[
    Path | None,
    typer.Option(
        "--literature", metavar="CSV", help="Published moment arms to draw beside those of the run."
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors and warnings only.")]


@dataclass(frozen=True, kw_only=True)
class RunArguments:
    """The options of commands that run a scene."""

    frames: FramesOption = None
    quiet: QuietOption = False
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True
    report: Annotated[
        bool, typer.Option("--report/--no-report", help="Write report.html, the page with all results.")
    ] = True
    workers: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Number of processes that deform muscles at the same time; it does not change the results. "
            "Default: one per processor.",
        ),
    ] = None
    overwrite: Annotated[
        bool,
        typer.Option(
            "--overwrite",
            help="Replace results of another scene, and files that no run has written; never the inputs.",
        ),
    ] = False
    fresh: FreshOption = False
    only: Annotated[
        str | None,
        typer.Option(
            metavar="lengths|moment_arms|surfaces",
            help="Compute and write this alone: lengths.csv, moment_arms.csv, or the deformed muscles.",
        ),
    ] = None
    muscle: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Run this muscle of the scene alone; may be repeated."),
    ] = None
    deformer: Annotated[
        str | None,
        typer.Option(
            metavar="paths|pbd|none",
            help="How muscles are deformed, in place of the scene's: carried by taut paths, by position "
            "based dynamics, or not at all (paths alone).",
        ),
    ] = None
    quality: Annotated[
        str | None,
        typer.Option(
            metavar="preview|balanced|accurate|published",
            help="Preset of numbers, in place of the scene's; settings in the scene's tables stay. published "
            "is the 2021 paper's, for the deformer pbd.",
        ),
    ] = None


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Expose the fields of a command's parameter ``options`` to typer."""
    signature = inspect.signature(command, eval_str=True)
    *before, last = signature.parameters.values()
    kind = last.annotation
    hints = get_type_hints(kind, include_extras=True)
    single = [
        inspect.Parameter(
            one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name]
        )
        for one in fields(kind)
    ]

    @wraps(command)
    def with_single(*arguments: Any, **keywords: Any) -> None:
        options = kind(**{one.name: keywords.pop(one.name) for one in single})
        command(*arguments, **keywords, options=options)

    with_single.__signature__ = signature.replace(parameters=[*before, *single])  # type: ignore[attr-defined]
    with_single.__annotations__ = {one.name: one.annotation for one in (*before, *single)}
    return with_single

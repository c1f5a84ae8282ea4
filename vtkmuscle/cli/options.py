"""The options that commands share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer


def named(text: str) -> Path:
    """Return a path; an empty text, as of a shell variable that is not set, is not the working folder."""
    if not text:
        raise typer.BadParameter("it is empty; give the name of a folder")
    return Path(text)


OutOption = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="PATH", parser=named, help="Folder to write to."),
]
FolderOption = Annotated[
    Path, typer.Option("--out", "-o", metavar="PATH", parser=named, help="Folder to write to.")
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
class RunOptions:
    """The options of commands that run a scene."""

    frames: Annotated[
        str | None,
        typer.Option(
            metavar="A:B",
            help="Frames to write, counted from 0; B is not included. Default: all.",
        ),
    ] = None
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
            help="Number of muscles to deform at the same time; it does not change the results. "
            "Default: one per processor.",
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
    fresh: FreshOption = False
    muscle: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Run this muscle of the scene alone; may be repeated."),
    ] = None
    quality: Annotated[
        str | None,
        typer.Option(
            metavar="preview|balanced|accurate",
            help="Preset of the solver, in place of the scene's; what the scene's solver table sets stays.",
        ),
    ] = None
    errors: Annotated[
        str | None,
        typer.Option(
            metavar="all|KIND,...",
            help="Further solves beside the run's own, for the errors of its numbers: model, mesh, slices, "
            "landmarks; all is all but the last.",
        ),
    ] = None
    landmark_error: Annotated[
        float,
        typer.Option(metavar="MM", help="How far --errors landmarks moves the areas of attachment."),
    ] = 5.0
    landmark_samples: Annotated[int, typer.Option(metavar="N", help="How often --errors landmarks does.")] = 8


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Spell out a command's last parameter, ``options``, for typer, which reads the signature."""
    own = inspect.signature(command, eval_str=True)
    *before, last = own.parameters.values()
    kind = last.annotation
    hints = get_type_hints(kind, include_extras=True)
    spelt = [
        inspect.Parameter(
            option.name, inspect.Parameter.KEYWORD_ONLY, default=option.default, annotation=hints[option.name]
        )
        for option in fields(kind)
    ]

    def spelt_out(*arguments: Any, **keywords: Any) -> None:
        options = kind(**{option.name: keywords.pop(option.name) for option in fields(kind)})
        command(*arguments, **keywords, options=options)

    spelt_out.__name__, spelt_out.__doc__ = command.__name__, command.__doc__
    spelt_out.__signature__ = own.replace(parameters=[*before, *spelt])  # type: ignore[attr-defined]
    spelt_out.__annotations__ = {one.name: one.annotation for one in (*before, *spelt)}
    return spelt_out

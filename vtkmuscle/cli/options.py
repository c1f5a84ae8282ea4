"""What commands share: options, messages, interruptions, exit statuses."""

import inspect
import os
import re
import shlex
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from functools import wraps
from pathlib import Path
from signal import SIGINT
from subprocess import list2cmdline
from tempfile import mkdtemp
from traceback import format_exception
from typing import Annotated, Any

import typer
from rich.console import Console
from typer import Option
from typer.core import TyperCommand

from vtkmuscle.core.errors import InputError, check_name, in_words


def named(text: str) -> Path:
    """Return a path; empty texts are refused."""
    if not text:
        raise typer.BadParameter("it is empty; give the name of a folder")
    return Path(text)


def out_option(metavar: str, help: str) -> Any:  # noqa: A002 -- typer's word
    """Return the option of the output path."""
    return Option("--out", "-o", metavar=metavar, parser=named, help=help)


OutOption = Annotated[Path | None, out_option("PATH", "Folder to write to.")]
FolderOption = Annotated[Path, out_option("PATH", "Folder to write to.")]
FramesOption = Annotated[str | None, Option(metavar="A:B", help="Frames, from 0, without B. Default: all.")]
LiteratureOption = Annotated[Path | None, Option(metavar="CSV", help="Published moment arms.")]
OverwriteOption = Annotated[bool, Option("--overwrite", help="Replace files of other origin; never inputs.")]
FiguresOption = Annotated[bool, Option("--figures/--no-figures", help="Draw figures.")]
ReportOption = Annotated[bool, Option("--report/--no-report", help="Write report.html.")]
QuietOption = Annotated[bool, Option("--quiet", "-q", help="Print errors and warnings only.")]


@dataclass(frozen=True, kw_only=True)
class CohortOptions:
    """The options of commands that run scenes."""

    frames: FramesOption = None
    workers: Annotated[int | None, Option(metavar="N", min=1, help="Processes; default: all cores.")] = None
    figures: FiguresOption = False
    report: ReportOption = False
    fresh: Annotated[bool, Option("--fresh", help="Compute finished muscles again.")] = False
    overwrite: OverwriteOption = False
    quiet: QuietOption = False
    muscle: Annotated[list[str] | None, Option(metavar="NAME", help="A muscle to run; repeatable.")] = None
    deformer: Annotated[str | None, Option(metavar="paths|pbd|none", help="In place of the scene's.")] = None
    quality: Annotated[
        str | None,
        Option(
            metavar="preview|balanced|accurate|published",
            help="Preset, in place of the scene's. preview takes 0.5, accurate 1.7 times balanced's time; "
            "mean moment arms of preview are within 1 mm of accurate, of balanced within 0.4 mm. "
            "published is the 2021 paper's, for pbd.",
        ),
    ] = None

    @property
    def choice(self) -> dict[str, Any]:
        """The given muscles and settings of scenes, as of ``Scene.run``."""
        values = {"muscles": self.muscle, "deformer": self.deformer, "quality": self.quality}
        return {name: value for name, value in values.items() if value}


@dataclass(frozen=True, kw_only=True)
class RunArguments(CohortOptions):
    """The options of commands that run a single scene."""

    figures: FiguresOption = True
    report: ReportOption = True
    only: Annotated[str | None, Option(metavar="lengths|moment_arms|surfaces", help="This alone.")] = None


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """Expose the fields of a command's parameter ``options`` to typer."""
    signature = inspect.signature(command, eval_str=True)
    *before, last = signature.parameters.values()
    kind = last.annotation
    single = inspect.signature(kind, eval_str=True).parameters.values()

    @wraps(command)
    def with_single(*arguments: Any, **keywords: Any) -> None:
        options = kind(**{option.name: keywords.pop(option.name) for option in single})
        command(*arguments, **keywords, options=options)

    with_single.__signature__ = signature.replace(parameters=[*before, *single])  # type: ignore[attr-defined]
    with_single.__annotations__ = {option.name: option.annotation for option in (*before, *single)}
    return with_single


def pairs(texts: Sequence[str] | None, option: str = "--replace") -> dict[str, str]:
    """Return the pairs OURS=THEIRS of an option."""
    names = {}
    for text in texts or ():
        ours, _, theirs = text.partition("=")
        if not ours or not theirs:
            raise InputError(option, f"{text!r} is no pair", "write both sides of the =")
        if ours in names:
            raise InputError(option, f"{ours!r} is given twice", "give each name once, with all its values")
        names[ours] = theirs
    return names


class Status(IntEnum):
    """Exit statuses of the command line."""

    FAILED = 1  # a muscle failed, and all else was written
    BAD_INPUT = 2
    FAULT = 3  # of the package
    NO_READER = 141  # of the output: 128 + SIGPIPE


#: Set by Ctrl-C: a callback of a library may swallow the KeyboardInterrupt.
_pressed = threading.Event()


class TerminatedError(KeyboardInterrupt):
    """A signal, the argument, asked the process to end: batch system, container, closed terminal."""


class Command(TyperCommand):
    """A command that prints each error as one clear message."""

    def __init__(self, *arguments: Any, help: str | None = None, **options: Any) -> None:  # noqa: A002
        joined = re.sub(r"(?<=\S)\n(?=\S)", " ", help or "")  # lines of a docstring are wider than terminals
        super().__init__(*arguments, help=joined, **options)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        with one_clear_error(ctx.params.get("out")):
            return super().invoke(ctx)


@contextmanager
def one_clear_error(out: Path | None) -> Iterator[None]:
    """Turn errors and Ctrl-C into a message and an exit status."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        print_error(f"warning: {one_line(str(message))}", style="yellow")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = show
            if out is not None:
                check_name(out)
            yield
    except (ValueError, OSError, MemoryError) as error:
        if isinstance(error, BrokenPipeError):  # as by "| head"; a child process that dies has its own error
            raise typer.Exit(Status.NO_READER) from error
        for fault in getattr(error, "faults", (error,)):
            print_error(f"error: {_words(fault)}")
        raise typer.Exit(Status.BAD_INPUT) from error
    except (KeyboardInterrupt, Exception) as stop:
        if type(stop).__module__.startswith(("typer", "click")):
            raise
        # A Ctrl-C while modules are loaded becomes an error of the module.
        if not isinstance(stop, KeyboardInterrupt) and not _pressed.is_set():
            print_error(f"error: a fault of vtkmuscle: {_traceback_of(stop)}")
            raise typer.Exit(Status.FAULT) from stop
        print_error(f"stopped. {_what_is_finished(out)}", style="yellow")
        number = stop.args[0] if isinstance(stop, TerminatedError) else SIGINT
        raise typer.Exit(128 + number) from None  # as in shells


def _traceback_of(error: BaseException) -> str:
    """Write an unexpected error's traceback to a temporary file; return the error and the file in words."""
    from vtkmuscle.io.writing import write_text

    file = Path(mkdtemp(prefix="vtkmuscle_")) / "traceback.txt"
    write_text(file, "".join(format_exception(error)))
    words = one_line(f"{type(error).__name__}: {error}")
    return f"{words[:500]}; the traceback is in {file}, please report it"


def interrupt(*_: Any) -> None:
    """Note a Ctrl-C, and stop."""
    _pressed.set()
    raise KeyboardInterrupt


def stop_if_interrupted() -> None:
    """Raise the KeyboardInterrupt of an earlier Ctrl-C, which a callback may have swallowed."""
    if _pressed.is_set():
        raise KeyboardInterrupt


def _words(error: Exception) -> str:
    words = "out of memory" if isinstance(error, MemoryError) else str(error)
    if isinstance(error, InputError):
        words = in_words(error.where, error.problem, error.remedy)
    elif isinstance(error, OSError) and error.strerror:
        words = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return one_line(words)


def _what_is_finished(out: Path | None) -> str:
    if out is not None and any(out.glob("*/report.json")):  # of many runs
        return f"Finished muscles and runs in {out} are kept: run the command again to continue"
    store = sys.modules.get("vtkmuscle.run.store")  # a run that has not loaded it has written nothing
    left = None if out is None or store is None else store.ResultFolder(out).unfinished()
    return "Nothing was written." if left is None else f"{out} {left}"


def one_line(words: str) -> str:
    """Return a text with escaped control characters."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)


def say(quiet: bool, text: str) -> None:
    """Print a text unless quiet."""
    if not quiet:
        typer.echo(text)


def say_run(quiet: bool, text: str, scene: Path) -> None:
    """Print a text, and the command to run a scene."""
    quote = shlex.quote if os.name == "posix" else (lambda name: list2cmdline([name]))
    say(quiet, f"{text}\n  vtkmuscle run {quote(str(scene))}")


def print_error(text: str, *, style: str = "bold red") -> None:
    """Print a text to standard error, above progress bars."""
    Console(stderr=True, emoji=False).print(text, markup=False, highlight=False, style=style, soft_wrap=True)

"""What the command line prints of errors, warnings and interruptions, and the statuses it ends with."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.console import Console

from vtkmuscle.core.errors import InputError, check_name, in_words

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


@contextmanager
def one_clear_error(out: Path | None) -> Iterator[None]:
    """Turn bad input and Ctrl-C into one message and an exit status; show warnings in one line."""
    console = Console(stderr=True, soft_wrap=True, highlight=False)

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        console.print(f"warning: {one_line(str(message))}", markup=False, style="yellow")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = show
            if out is not None:
                check_name(out)
            yield
    except (ValueError, OSError) as error:
        # ValueErrors of the package say what was wrong with the input; a fault in it has a traceback.
        for fault in getattr(error, "faults", (error,)):
            console.print(f"error: {_words(fault)}", markup=False, style="bold red")
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
    if isinstance(error, InputError):
        words = in_words(error.where, error.problem, error.remedy)
    elif isinstance(error, OSError) and error.strerror:
        words = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return one_line(words)


def one_line(words: str) -> str:
    """Return a text without what a terminal would take for more than text."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)


def _what_is_finished(out: Path | None) -> str:
    from vtkmuscle.run.store import ResultFolder

    left = None if out is None else ResultFolder(out).unfinished()
    return "Nothing was written." if left is None else f"{out} {left}"


def say(quiet: bool, text: str) -> None:
    """Print a text, unless the user wants errors and warnings only."""
    if not quiet:
        typer.echo(text)

"""Errors of scenes and of their files: all faults together, each with key, problem and remedy."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of, in_words


class SceneError(InputError):
    """A scene that cannot be run, with location, problem and remedy of each fault.

    Attributes
    ----------
    problem, remedy, where : str
        Fault, correction, and file and key, of the first fault.
    key : str
        The dotted key, e.g. ``muscles.iliacus.attachments[1].bone``.
    file : Path or None
        The file at fault.
    faults : tuple of SceneError
        All faults, starting with the error itself. The message has a line for each.

    Examples
    --------
    >>> from vtkmuscle import SceneError
    >>> print(SceneError("there is no unit 'inch'", "units", "allowed: mm, cm, m"))
    scene: units: there is no unit 'inch'; allowed: mm, cm, m
    """

    def __init__(
        self,
        problem: str,
        key: str = "",
        remedy: str = "",
        file: Path | None = None,
        more: Iterable[SceneError] = (),
    ) -> None:
        where = ": ".join(part for part in (str(file) if file else "scene", key) if part)
        super().__init__(where, problem, remedy)
        self.key, self.file, self.faults = key, file, (self, *more)
        self.args = (problem, key, remedy, file, self.faults[1:])

    def __str__(self) -> str:
        return "\n".join(in_words(fault.where, fault.problem, fault.remedy) for fault in self.faults)


class Finding(NamedTuple):
    """An implausible part of a scene; ``certain`` stops runs."""

    key: str
    problem: str
    remedy: str
    certain: bool = False


@contextmanager
def errors_at(key: str, file: Path | None, remedy: str = "") -> Iterator[None]:
    """Raise a ValueError or OSError as a SceneError with key and file."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, OSError) as error:
        problem, own = fault_of(error)
        raise SceneError(problem, key, own or remedy, file) from error


class Faults:
    """Collector of faults from several checks, for a common report."""

    def __init__(self, errors: Iterable[SceneError] = ()) -> None:
        self.errors = list(errors)

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Collect the faults of a SceneError raised within, and continue."""
        try:
            yield
        except SceneError as error:
            self.errors += error.faults

    def raise_any(self) -> None:
        """Raise one SceneError for all faults, if any."""
        if self.errors:
            first, *more = self.errors
            raise SceneError(first.problem, first.key, first.remedy, first.file, more)


T = TypeVar("T")


def parsed(path: Path) -> dict[str, Any]:
    """Return the content of a scene.toml; SceneError if unreadable."""
    if path.is_dir():
        inside = [path / "scene.toml", *sorted(path.glob("*.toml")), path.absolute().parent / "scene.toml"]
        remedy = f"give a scene file, e.g. {next(filter(Path.is_file, inside), 'scene.toml')}"
        raise SceneError("this is a folder, not a scene file", "", remedy, path)
    try:
        check_is_file(path, most=MOST_TEXT)
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SceneError("is not text in UTF-8", "", "save it as UTF-8", path) from error
    except tomllib.TOMLDecodeError as error:
        remedy = "correct that line; put texts in double quotes, and write / for \\ in paths"
        raise SceneError(f"is not valid TOML: {error}", "", remedy, path) from error
    except (OSError, ValueError, RecursionError) as error:  # also an endless number, or too many brackets
        raise SceneError(fault_of(error)[0], "", "check the path and the content", path) from error


class SceneFiles:
    """Paths of a scene's files by dotted key.

    Texts in the scene are paths relative to the folder of the scene file.
    """

    def __init__(self, path: Path) -> None:
        self.paths = {"": path}

    def read(self, key: str, text: str, reader: Callable[[Path], T]) -> T:
        """Read the file of a key by a reader; SceneError if unreadable."""
        path = self.paths[""].parent / text
        self.paths[key] = path
        with errors_at(key, path, f"check {key.rpartition('.')[2]} = {text!r} and the file it names"):
            return reader(path)

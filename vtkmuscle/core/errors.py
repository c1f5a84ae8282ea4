"""Errors of input, with fields, and checks of files."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Most bytes of a mesh, a series or a table: 86 million triangles of a binary STL.
MOST_BYTES = 4 * 1024**3
#: Most bytes of a scene, a template or a list of landmarks: a million landmarks of 64 letters.
MOST_TEXT = 64 * 1024**2


class _FieldsError(Exception):
    """Error with fields: where, problem, and remedy."""

    def __init__(self, where: str | Path, problem: str, remedy: str = "") -> None:
        # Without the initialisation of the second base: an OSError takes its arguments for an error number.
        self.args = (str(where), problem, remedy)
        self.where, self.problem, self.remedy = self.args

    def __str__(self) -> str:
        return in_words(self.where, self.problem, self.remedy)


class InputError(_FieldsError, ValueError):
    """Unusable input: place, problem and remedy.

    Parameters
    ----------
    where : str or Path
        File, port or argument at fault; "" if the caller adds it.
    problem : str
        The fault.
    remedy : str, optional
        Proposed action.

    Attributes
    ----------
    where, problem, remedy : str
        The parameters.

    Examples
    --------
    >>> from vtkmuscle.core.errors import InputError
    >>> print(InputError("bone.stl", "the file holds no points", "export it again"))
    bone.stl: the file holds no points; export it again
    """


class MissingFileError(_FieldsError, FileNotFoundError):
    """Missing or unreadable file. With the fields of :class:`InputError`."""


def in_words(where: str, problem: str, remedy: str) -> str:
    """Return ``where: problem; remedy``, without empty parts."""
    fault = ": ".join(part for part in (where, problem) if part)
    return "; ".join(part for part in (fault, remedy) if part)


@contextmanager
def errors_at(where: str) -> Iterator[None]:
    """Turn a ValueError within into an InputError. The InputError names a port or argument."""
    try:
        yield
    except ValueError as error:
        raise InputError(where, *fault_of(error, placed=True)) from error


def fault_of(error: Exception, *, placed: bool = False) -> tuple[str, str]:
    """Return the problem and remedy of an error.

    Each text is a single line. The remedy may be "". With ``placed`` the problem begins with ``where``.
    """
    problem, remedy = str(error), ""
    if isinstance(error, _FieldsError):
        problem = in_words(error.where, error.problem, "") if placed else error.problem
        remedy = error.remedy
    elif isinstance(error, OSError) and error.strerror:
        problem = error.strerror
    return " ".join(problem.split()), " ".join(remedy.split())


def check_name(path: Path) -> None:
    """Raise an InputError for a non-UTF-8 path. No report or table could name the path."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError:
        where = ascii(str(path))[1:-1]
        raise InputError(where, "the path is not UTF-8 text", "rename the file or folder") from None


def check_is_file(path: Path, *, most: int = MOST_BYTES) -> None:
    """Raise an error for an unreadable file.

    A FileNotFoundError for a missing file, an InputError for too large a file.

    Reading a named pipe would wait, and reading a device would never end.
    """
    check_name(path)
    if path.is_dir():
        raise MissingFileError(path, "this is a folder, not a file")
    if not path.exists():
        folder = path.parent
        also = sorted(p.name for p in folder.iterdir() if p.suffix == path.suffix) if folder.is_dir() else []
        hint = f"files there: {', '.join(also[:5])}" if also else ""
        lost = path.is_symlink()
        what = f"the link leads to {path.readlink()}, which is missing" if lost else "there is no such file"
        raise MissingFileError(path, what, "" if lost else hint)
    if not path.is_file():
        raise MissingFileError(path, "this is a pipe or a device, not a file", "copy the content to a file")
    size = path.stat().st_size
    if size > most:
        problem = f"the file takes {size / 1024**2:.0f} MB, but at most {most // 1024**2} MB are read"
        raise InputError(path, problem, "check the file's content")

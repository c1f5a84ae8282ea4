"""Input that cannot be used: an error with fields, to be passed on or shown."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class _FieldsError(Exception):
    """An error with fields: where the fault is, what it is, and how to remedy it."""

    def __init__(self, where: str | Path, problem: str, remedy: str = "") -> None:
        # Not the other base's own initialisation: an OSError takes its arguments for an error number.
        self.args = (str(where), problem, remedy)
        self.where, self.problem, self.remedy = self.args

    def __str__(self) -> str:
        return in_words(self.where, self.problem, self.remedy)


class InputError(_FieldsError, ValueError):
    """Input that cannot be used: where the fault is, what it is, and how to remedy it.

    Parameters
    ----------
    where : str or Path
        The file, the port or the argument at fault; "" where the caller knows it and says it.
    problem : str
        What is wrong.
    remedy : str, optional
        What to do about it.

    Attributes
    ----------
    where, problem, remedy : str
        As given.

    Examples
    --------
    >>> from vtkmuscle.core.errors import InputError
    >>> print(InputError("bone.stl", "the file holds no points", "export it again"))
    bone.stl: the file holds no points; export it again
    """


class MissingFileError(_FieldsError, FileNotFoundError):
    """A file that is to be read and is none; parameters and attributes are those of :class:`InputError`."""


def in_words(where: str, problem: str, remedy: str) -> str:
    """Return an error's message, ``where: problem; remedy``, of those that are not empty."""
    return "; ".join(part for part in (": ".join(part for part in (where, problem) if part), remedy) if part)


@contextmanager
def errors_at(where: str) -> Iterator[None]:
    """Raise a ValueError from within as an InputError that names a place.

    Parameters
    ----------
    where : str
        The port or the argument at fault, which what is called within does not know.

    Raises
    ------
    InputError
        With the problem and the remedy of the error within.

    Examples
    --------
    >>> from vtkmuscle.core.errors import InputError, errors_at
    >>> with errors_at("PBDDeformer: muscle"):
    ...     raise InputError("", "the surface is open", "close it")
    Traceback (most recent call last):
        ...
    vtkmuscle.core.errors.InputError: PBDDeformer: muscle: the surface is open; close it
    """
    try:
        yield
    except ValueError as error:
        raise InputError(where, *fault_of(error, placed=True)) from error


def fault_of(error: Exception, *, placed: bool = False) -> tuple[str, str]:
    """Return the problem and the remedy that an error names, each in one line.

    Parameters
    ----------
    error : Exception
        Of one without these fields the problem is the message, and the remedy "".
    placed : bool, optional
        Whether the place stands before the problem.

    Examples
    --------
    >>> from vtkmuscle.core.errors import InputError, fault_of
    >>> fault_of(InputError("bone.stl", "the file holds no points", "export it again"))
    ('the file holds no points', 'export it again')
    >>> fault_of(OSError(28, "No space left on device", "bone.stl"))
    ('No space left on device', '')
    """
    if isinstance(error, _FieldsError):
        problem = in_words(error.where, error.problem, "") if placed else error.problem
        remedy = error.remedy
    elif isinstance(error, OSError) and error.strerror:
        problem, remedy = error.strerror, ""
    else:
        problem, remedy = str(error), ""
    return " ".join(problem.split()), " ".join(remedy.split())

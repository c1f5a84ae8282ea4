"""Errors of scenes: all faults together, each with key, problem and remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from vtkmuscle.core.errors import InputError, fault_of, in_words


class SceneError(InputError):
    """A scene that cannot be run, with location, problem and remedy.

    A single error covers all faults of a check; the fields belong to the first fault.

    Attributes
    ----------
    problem, remedy : str
        Fault, and correction.
    key : str
        The dotted key, e.g. ``muscles.iliacus.attachments[1].bone``.
    file : Path or None
        The file at fault.
    where : str
        The file and the key.
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


@contextmanager
def errors_at(key: str, file: Path | None, remedy: str = "") -> Iterator[None]:
    """Raise a ValueError or OSError as a SceneError with key and file.

    ``remedy`` applies to errors without a remedy.
    """
    try:
        yield
    except SceneError:
        raise
    except (ValueError, OSError) as error:
        problem, own = fault_of(error)
        raise SceneError(problem, key, own or remedy, file) from error


class Faults:
    """Collector of faults from several checks, for a common report.

    Examples
    --------
    >>> from vtkmuscle.scene.faults import Faults, SceneError
    >>> faults = Faults()
    >>> for key in ("a", "b"):
    ...     with faults.gathered():
    ...         raise SceneError("this is wrong", key)
    >>> faults.raise_any()
    Traceback (most recent call last):
        ...
    vtkmuscle.scene.faults.SceneError: scene: a: this is wrong
    scene: b: this is wrong
    """

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

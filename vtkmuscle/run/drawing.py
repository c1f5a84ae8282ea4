"""The figures of a run, drawn while muscles are still being solved."""

from __future__ import annotations

import shutil
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtkmuscle.io.writing import beside
from vtkmuscle.run.result import Result

if TYPE_CHECKING:
    from vtkmuscle.plotting import Studio


class Drawing:
    """The ``figures/`` of a run: pictures of each muscle as soon as it is done, and the others at the end.

    All are drawn by the thread that calls, for rendering is not for several, into a folder beside.

    Parameters
    ----------
    results : Path
        The run's folder.

    Attributes
    ----------
    seconds : float
        Time that they have taken [s].
    """

    def __init__(self, results: Path) -> None:
        self._folder = results / "figures"
        self._beside = beside(self._folder)
        self._drawn: list[Path] = []
        self.seconds = 0.0

    def muscle(self, result: Result, name: str) -> None:
        """Draw the pictures of a muscle that is done, of a result of it alone.

        What cannot be drawn stops no muscle: it is tried again, and fails, at the end.
        """
        if self._reason is None:
            from vtkmuscle.run.figures import write_pictures  # noqa: PLC0415

            with suppress(Exception), self._ready():
                self._drawn += write_pictures(self._beside, result.plain(), name, self._studio)

    def finish(self, result: Result) -> dict[str, Any]:
        """Draw what is left, move all to ``figures/``, and return what the report says of it.

        Raises
        ------
        OSError
            If a file cannot be written.

        Warns
        -----
        UserWarning
            If no picture can be rendered here.
        """
        if self._reason is not None:
            words = f"no figures were drawn, all else was written: {self._reason}"
            warnings.warn(words, stacklevel=5)
            return {"written": [], "reason": self._reason}
        from vtkmuscle.run.figures import write_figures  # noqa: PLC0415

        with self._ready():
            drawn = sorted(
                write_figures(self._beside, result.plain(), drawn=self._drawn, studio=self._studio)
            )
            self._folder.mkdir(exist_ok=True)
            for figure in drawn:
                figure.replace(self._folder / figure.name)
        return {"written": [figure.name for figure in drawn]}

    def discard(self) -> None:
        """Remove what is drawn and not yet in its place, and what it was drawn with."""
        shutil.rmtree(self._beside, ignore_errors=True)
        if "_studio" in self.__dict__:
            self._studio.close()
            del self._studio

    @cached_property
    def _studio(self) -> Studio:
        from vtkmuscle.plotting import Studio  # noqa: PLC0415 -- only figures need it

        return Studio()

    @cached_property
    def _reason(self) -> str | None:
        """Why no picture can be rendered here, if so."""
        from vtkmuscle.plotting import can_render  # noqa: PLC0415 -- only figures need PyVista

        return can_render()

    @contextmanager
    def _ready(self) -> Iterator[None]:
        import matplotlib as mpl  # noqa: PLC0415 -- only figures need it, and PyVista

        before = time.perf_counter()
        try:
            with mpl.rc_context():
                mpl.rcdefaults()  # a matplotlibrc in the working folder may be from elsewhere
                yield
        except OSError as error:
            if error.errno is None or not str(error.filename or self._beside).startswith(str(self._beside)):
                raise
            raise OSError(error.errno, error.strerror, str(self._folder)) from error
        finally:
            self.seconds += time.perf_counter() - before

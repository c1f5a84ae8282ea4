"""The figures of a run, drawn while muscles are still being solved."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Self

from vtkmuscle.data.drawn_bones import DrawnBone
from vtkmuscle.io.writing import beside
from vtkmuscle.plotting.in_child import DrawingEndedError, DrawingProcess
from vtkmuscle.plotting.order import FigureOrder
from vtkmuscle.run.figures import figures_of, figures_of_muscle, rest_pose
from vtkmuscle.run.result import Result
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.scene.data import SceneData


class Drawing:
    """The ``figures/`` of a run: pictures of each muscle as soon as it is done, and the others at the end.

    A process of its own draws them, into a folder beside, which begins at once; use it as a context, which
    ends that process, and leaves no figure that is not in its place.

    Parameters
    ----------
    results : Path
        The run's folder.
    scene : SceneData
        What is run.

    Attributes
    ----------
    seconds : float
        Time that the figures have taken [s].
    """

    def __init__(self, results: Path, scene: SceneData) -> None:
        self._folder = results / "figures"
        self._beside = beside(self._folder)
        self._scene = scene
        self._process = DrawingProcess(scene.bones_data())
        self._figures: dict[str, Future[tuple[Path, float]]] = {}
        self.seconds = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.close()
        shutil.rmtree(self._beside, ignore_errors=True)

    def rest(self, tracks: Mapping[str, MuscleTrack]) -> None:
        """Draw the muscles at rest, once: as soon as it is known where all of them are fixed."""
        muscles = {name: track.rest for name, track in tracks.items() if track.rest is not None}
        if "rest_pose" not in self._figures and len(muscles) == len(tracks):
            self._draw(rest_pose(self._scene.name, self._scene.units, muscles))

    def muscle(self, result: Result, name: str) -> None:
        """Draw the pictures of a muscle that is done, of a result of it alone.

        What cannot be drawn stops no muscle: :meth:`finish` says so.
        """
        for figure in figures_of_muscle(result.plain(), name):
            self._draw(figure)

    def others(self, result: Result) -> None:
        """Draw what is not drawn yet, of the result of all muscles."""
        for figure in figures_of(result.plain()):
            if figure.name not in self._figures:
                self._draw(figure)

    def bones(self) -> Mapping[str, DrawnBone] | None:
        """Return the bones as they are drawn, None where no picture can be rendered."""
        try:
            return self._process.bones()
        except DrawingEndedError:
            return None

    def finish(self) -> dict[str, Any]:
        """Wait until all is drawn, move it to ``figures/``, and return what the report says of it.

        Raises
        ------
        OSError
            If a file cannot be written.

        Warns
        -----
        UserWarning
            If no picture can be rendered here, or the process that draws has ended before its time.
        """
        drawn: list[Path] = []
        reason = None
        try:
            self._process.bones()
            for figure in self._figures.values():
                path, seconds = figure.result()
                drawn.append(path)
                self.seconds += seconds
        except DrawingEndedError as error:
            reason = str(error)
            what = "no figures were drawn" if not drawn else "not all figures were drawn"
            warnings.warn(f"{what}, all else was written: {reason}", stacklevel=5)
        except OSError as error:
            if error.errno is None or not str(error.filename or self._beside).startswith(str(self._beside)):
                raise
            raise OSError(error.errno, error.strerror, str(self._folder)) from error
        if drawn:
            self._folder.mkdir(exist_ok=True)
        for path in drawn:
            path.replace(self._folder / path.name)
        found: dict[str, Any] = {"written": sorted(path.name for path in drawn)}
        return found if reason is None else found | {"reason": reason}

    def _draw(self, figure: FigureOrder) -> None:
        self._figures[figure.name] = self._process.draw(figure, self._beside)

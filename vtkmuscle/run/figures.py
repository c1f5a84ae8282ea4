"""The figures of a run, each a file: drawn while muscles are still being solved, or afterwards."""

from __future__ import annotations

import math
import shutil
import warnings
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.drawn_bones import DrawnBone
from vtkmuscle.io.writing import beside
from vtkmuscle.plotting.drawing import DrawingEndedError, DrawingProcess, FigureOrder, MuscleFrame, can_render
from vtkmuscle.plotting.views import fibre_surface
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.scene.data import SceneData

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result


#: Formats of figures.
FORMS = ("png", "pdf", "svg")


class Drawing:
    """The ``figures/`` of a run: pictures of each muscle as soon as it is done, and the others at the end.

    A process of its own draws them into a folder beside ``results``. Use it as a context, which ends that
    process and removes that folder. ``seconds`` is the time that the figures have taken.
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
        """Draw the pictures of a muscle that is done, of a result of it alone."""
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
        """Wait until all is drawn, move it to ``figures/``, and return the entry of the report.

        An OSError is raised if a file cannot be written. A UserWarning says why figures are missing: no
        picture can be rendered here, or the process that draws has ended before its time.
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


def write_figures(folder: str | Path, result: Result, *, form: str = "png", dpi: float = 150.0) -> list[Path]:
    """Write all figures of a run; see :meth:`vtkmuscle.Result.write_figures`."""
    if form not in FORMS:
        raise InputError(form, "a figure is one of png, pdf and svg", "choose one of these")
    if not 20.0 <= dpi <= 2400.0:
        raise InputError("", f"dpi is {dpi:g}, but a figure has 20 to 2400 pixels to an inch", "e.g. 300")
    reason = can_render()
    if reason is not None:
        raise RuntimeError(f"no figures can be made: {reason}")
    from vtkmuscle.plotting.sheets import DOTS_PER_INCH  # noqa: PLC0415 -- only figures need it
    from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

    with Studio(dpi / DOTS_PER_INCH) as studio:
        figures = figures_of(result)
        return [one.write(Path(folder), result.drawn_bones, studio, form, dpi) for one in figures]


def figures_of(result: Result) -> list[FigureOrder]:
    """Return all figures of a run."""
    at_rest = {name: result.rest_muscle(name) for name in result.muscle_names}
    figures = [rest_pose(result.name, result.units, at_rest)]
    for name in result.muscle_names:
        figures += figures_of_muscle(result, name)
    return figures + _moment_arms(result)


def rest_pose(scene: str, units: str, muscles: Mapping[str, vtkPolyData]) -> FigureOrder:
    """Return the figure of the muscles of a scene at rest, with their fixed points."""
    given = {"muscles": dict(muscles), "title": f"{scene}: fixed points at rest", "units": units}
    return FigureOrder("rest_pose", "plot_rest_pose", given, rendered=True)


def figures_of_muscle(result: Result, name: str) -> list[FigureOrder]:
    """Return the figures of one muscle, its frames and lengths; none where it has no frame."""
    if not result.finished(name):
        return []
    figures = [FigureOrder(f"{name}_frames", "plot_muscle", _frames(result, name), rendered=True)]
    for of, suffix, known in (
        ("path", "lengths", result.lengths),
        ("fibre", "fibre_lengths", result.fibre_lengths),
    ):
        if name in known:
            times = result.times[: len(known[name])]
            words = {"of": of, "title": _title(name), "time_label": result.time_label}
            given = {"times": times, "lengths": known[name], **words}
            figures.append(FigureOrder(f"{name}_{suffix}", "plot_lengths", given))
    return figures


def _moment_arms(result: Result) -> list[FigureOrder]:
    """Return the figures of the moment arms of each muscle, which need all muscles."""
    figures = []
    for name, arms in (result.moment_arms() if result.has_moment_arms else {}).items():
        if result.finished(name):
            given = {
                "arms": dict(arms),
                "rest": MuscleFrame(result.rest_muscle(name), {}, result.rest_fibres(name), _title(name)),
                "literature": tuple(result.literature.get(name, ())),
                "units": result.units,
            }
            figures.append(FigureOrder(f"{name}_moment_arms", "plot_moment_arms", given, rendered=True))
    return figures


def _frames(result: Result, name: str) -> dict[str, object]:
    volumes = result.report["deformer"] != "none"
    frames = []
    for number in _chosen_frames(result, name):
        fibres = result.fibres(name, frame=number)
        muscle = result.muscle(name, frame=number) if volumes else fibre_surface(fibres)
        moved = result.motion.at(float(result.motion.times[number]))
        frames.append(MuscleFrame(muscle, moved, fibres, _at(result, number)))
    rest = result.rest_fibres(name)
    return {"frames": frames, "rest_fibres": rest, "title": _title(name), "units": result.units}


def _title(name: str) -> str:
    return name.replace("_", " ")


def _chosen_frames(result: Result, name: str) -> list[int]:
    """Return the first, the worst (or else the middle) and the last finished frame of a muscle."""
    frames = result.frames[: result.finished(name)]
    reasons = result.report["muscles"][name].get("verdict", {}).get("reasons", ())
    worst = [reason["frame"] for reason in reasons[:1] if reason["frame"] in frames]
    return sorted({frames[0], *(worst or [frames[(len(frames) - 1) // 2]]), frames[-1]}) if frames else []


def _at(result: Result, frame: int) -> str:
    """Return the time of a frame to a hundredth of them all: ``time 3``, or ``hip flexion 30 deg``."""
    times = result.motion.times
    span = float(np.ptp(times)) or 1.0
    name, _, unit = result.time_label.partition(" [")
    rounded = round(float(times[frame]), max(0, 2 - math.ceil(math.log10(span)))) + 0.0
    return f"{name} {rounded:g} {unit.removesuffix(']')}".strip()

"""The figures of a run, each a file."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters.fibre_tubes import FibreTubes
from vtkmuscle.plotting import (
    Studio,
    can_render,
    plot_lengths,
    plot_moment_arms,
    plot_muscle,
    plot_rest_pose,
    plot_volume,
)
from vtkmuscle.plotting.sheets import save_png

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result

#: What draws each figure, by the name of its file.
Figures = dict[str, Callable[[Studio], Figure]]


def write_figures(
    folder: str | Path, result: Result, *, drawn: Sequence[Path] = (), studio: Studio | None = None
) -> list[Path]:
    """Write all figures of a run: the rest pose, each muscle in three frames, its fibres, the volumes.

    Parameters
    ----------
    folder : path-like
        Made where it does not exist.
    result : Result
        What :meth:`vtkmuscle.Scene.run` returns.
    drawn : sequence of Path, optional
        Those that :func:`write_pictures` has written there already.
    studio : Studio, optional
        Where pictures are taken; one for these figures alone where it is not given.

    Returns
    -------
    list of Path
        ``rest_pose.png``, per muscle ``NAME_frames.png`` and (where it has fibres) ``NAME_lengths.png``,
        ``NAME_moment_arms.png`` where the report has some, and ``volume.png``.

    Raises
    ------
    RuntimeError
        If no picture can be rendered here; nothing is written then. :func:`can_render` asks beforehand.
    """
    reason = can_render()
    if reason is not None:
        raise RuntimeError(f"no figures can be made: {reason}")
    if studio is None:
        with Studio() as own:
            return write_figures(folder, result, drawn=drawn, studio=own)
    figures: Figures = {"rest_pose": partial(_rest_pose, result)}
    muscles = result.report["muscles"]
    arms = result.moment_arms() if any(one.get("moment_arms") for one in muscles.values()) else {}
    for name in result.muscle_names:
        figures |= _of_muscle(result, name)
        if name in arms and result.finished(name):
            figures[f"{name}_moment_arms"] = partial(_moment_arms, result, name, arms[name])
    if result.report["model"] != "paths":
        figures["volume"] = partial(_volumes, result)
    return [*drawn, *_write(folder, figures, studio, {path.stem for path in drawn})]


def write_pictures(folder: str | Path, result: Result, name: str, studio: Studio) -> list[Path]:
    """Write those figures of a run that show one muscle, and need no other: its frames and its lengths.

    Parameters
    ----------
    folder, result, studio
        As of :func:`write_figures`; a result of this muscle alone will do.
    name : str
        Of the muscle.
    """
    return _write(folder, _of_muscle(result, name), studio, ())


def _write(folder: str | Path, figures: Figures, studio: Studio, drawn: Collection[str]) -> list[Path]:
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    written: list[Path] = []
    for name, draw in figures.items():
        if name not in drawn:
            save_png(draw(studio), out / f"{name}.png")
            written.append(out / f"{name}.png")
    return written


def _rest_pose(result: Result, studio: Studio) -> Figure:
    return plot_rest_pose(
        {name: result.rest_muscle(name) for name in result.muscle_names},
        result.drawn_bones,
        studio,
        title=f"{result.name}: fixed points at rest",
        units=result.units,
    )


def _volumes(result: Result, _: Studio) -> Figure:
    rows = {name: result.report["muscles"][name]["frames"] for name in result.muscle_names}
    return plot_volume(
        {name: [row["time"] for row in table] for name, table in rows.items()},
        {name: [row["volume_ratio"] for row in table] for name, table in rows.items()},
        title=result.name,
        time_label=result.time_label,
    )


def _of_muscle(result: Result, name: str) -> Figures:
    """Return the figures that show a muscle; none of one that failed in the first frame that is kept."""
    if not result.finished(name):
        return {}
    figures: Figures = {f"{name}_frames": partial(_frames, result, name)}
    if name in result.lengths:
        figures[f"{name}_lengths"] = partial(_lengths, result, name)
    return figures


def _frames(result: Result, name: str, studio: Studio) -> Figure:
    frames = _telling_frames(result, name)
    fibres = [lines for number in frames if (lines := result.fibres(name, frame=number)) is not None]
    if result.report["model"] == "paths":
        muscles = [_tubes(lines) for lines in fibres]
    else:
        muscles = [result.muscle(name, frame=number) for number in frames]
    return plot_muscle(
        muscles,
        result.drawn_bones,
        [result.motion.at(float(result.motion.times[number])) for number in frames],
        studio,
        fibres=fibres or None,
        rest_fibres=result.rest_fibres(name),
        labels=[_at(result.time_label, float(result.motion.times[number])) for number in frames],
        title=_title(result, name),
        units=result.units,
    )


def _lengths(result: Result, name: str, _: Studio) -> Figure:
    lengths = result.lengths[name]
    times = result.times[: len(lengths)]
    return plot_lengths(times, lengths, title=_title(result, name), time_label=result.time_label)


def _moment_arms(result: Result, name: str, arms: Mapping[str, JointArms], _: Studio) -> Figure:
    return plot_moment_arms(arms, literature=result.literature.get(name, ()), title=_title(result, name))


def _title(result: Result, name: str) -> str:
    verdict = result.verdicts.get(name)
    return name.replace("_", " ") + (f": {verdict}" if verdict else "")


def _tubes(fibres: vtkPolyData) -> vtkPolyData:
    """Return fibres as a surface, which stands for a muscle where none was deformed."""
    size = float(np.linalg.norm(np.ptp(points_of(fibres), axis=0)))
    tubes = FibreTubes(radius=0.004 * size, sides=6).apply(fibres)
    surface: vtkPolyData = tubes.triangulate()
    return surface


def _telling_frames(result: Result, name: str) -> list[int]:
    """Return the first frame of a muscle, its worst one or else the middle, and the last; [] without any."""
    frames = result.frames[: result.finished(name)]
    reasons = result.report["muscles"][name].get("verdict", {}).get("reasons", ())
    worst = [reason["frame"] for reason in reasons[:1] if reason["frame"] in frames]
    return sorted({frames[0], *(worst or [frames[(len(frames) - 1) // 2]]), frames[-1]}) if frames else []


def _at(label: str, time: float) -> str:
    """Return a time in words: ``time 3``, or ``hip flexion 30 deg``."""
    name, _, unit = label.partition(" [")
    return f"{name} {time:.4g} {unit.removesuffix(']')}".strip()

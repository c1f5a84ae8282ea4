"""The figures of a run, each a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters.fibre_tubes import FibreTubes
from vtkmuscle.plotting import (
    can_render,
    plot_lengths,
    plot_moment_arms,
    plot_muscle,
    plot_rest_pose,
    plot_volume,
)

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result


def write_figures(folder: str | Path, result: Result) -> list[Path]:
    """Write all figures of a run: the rest pose, each muscle in three frames, its fibres, the volumes.

    Parameters
    ----------
    folder : path-like
        Made where it does not exist.
    result : Result
        What :meth:`vtkmuscle.Scene.run` returns.

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
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    names = list(result.muscle_names)
    written: list[Path] = []

    def keep(name: str, figure: Figure) -> None:
        figure.savefig(out / name)
        written.append(out / name)

    rest = plot_rest_pose(
        {name: result.rest_muscle(name) for name in names},
        result.rest_bones(),
        title=f"{result.name}: fixed points at rest",
        units=result.units,
    )
    keep("rest_pose.png", rest)
    muscles = result.report["muscles"]
    arms = result.moment_arms() if any(one.get("moment_arms") for one in muscles.values()) else {}
    for name in names:
        for ending, figure in _figures_of_muscle(result, name, arms.get(name)):
            keep(f"{name}_{ending}.png", figure)
    if result.report["model"] != "paths":
        rows = {name: muscles[name]["frames"] for name in names}
        volumes = plot_volume(
            {name: [row["time"] for row in table] for name, table in rows.items()},
            {name: [row["volume_ratio"] for row in table] for name, table in rows.items()},
            title=result.name,
            time_label=result.time_label,
        )
        keep("volume.png", volumes)
    return written


def _figures_of_muscle(
    result: Result, name: str, arms: Mapping[str, JointArms] | None
) -> Iterator[tuple[str, Figure]]:
    """Give the figures of a muscle; none of one that failed in the first frame that is kept."""
    frames = _telling_frames(result, name)
    if not frames:
        return
    verdict = result.verdicts.get(name)
    title = name.replace("_", " ") + (f": {verdict}" if verdict else "")
    fibres = [lines for number in frames if (lines := result.fibres(name, frame=number)) is not None]
    if result.report["model"] == "paths":
        muscles = [_tubes(lines) for lines in fibres]
    else:
        muscles = [result.muscle(name, frame=number) for number in frames]
    yield (
        "frames",
        plot_muscle(
            muscles,
            [result.bones(frame=number) for number in frames],
            fibres=fibres or None,
            rest_fibres=result.rest_fibres(name),
            labels=[_at(result.time_label, float(result.motion.times[number])) for number in frames],
            title=title,
            units=result.units,
        ),
    )
    if name in result.lengths:
        lengths = result.lengths[name]
        times = result.times[: len(lengths)]
        yield "lengths", plot_lengths(times, lengths, title=title, time_label=result.time_label)
    if arms:
        published = result.literature.get(name, ())
        yield "moment_arms", plot_moment_arms(arms, literature=published, title=title)


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

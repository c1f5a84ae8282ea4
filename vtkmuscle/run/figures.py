"""The figures of a run, each a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
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
    names, times = list(result.muscle_names), list(result.times)
    written = [
        plot_rest_pose(
            out / "rest_pose.png",
            {name: result.rest_muscle(name) for name in names},
            result.rest_bones(),
            title=f"{result.name}: fixed points at rest",
            units=result.units,
        )
    ]
    arms: Mapping[str, Mapping[str, JointArms]] = {}
    paths = result.report["model"] == "paths"
    for name in names:
        frames = _telling_frames(result, name)
        if not frames:
            continue  # it failed in the first one that is kept
        verdict = result.verdicts.get(name)
        title = name.replace("_", " ") + (f": {verdict}" if verdict else "")
        fibres = [result.fibres(name, frame=number) for number in frames]
        muscles = [] if paths else [result.muscle(name, frame=number) for number in frames]
        present = [lines for lines in fibres if lines is not None]
        written.append(
            plot_muscle(
                out / f"{name}_frames.png",
                muscles or [_tubes(lines) for lines in present],
                [result.bones(frame=number) for number in frames],
                fibres=present if len(present) == len(frames) else None,
                rest_fibres=result.rest_fibres(name),
                labels=[_at(result.time_label, float(result.motion.times[number])) for number in frames],
                title=title,
                units=result.units,
            )
        )
        if name in result.lengths:
            path, lengths = out / f"{name}_lengths.png", result.lengths[name]
            at = times[: len(lengths)]
            written.append(plot_lengths(path, at, lengths, title=title, time_label=result.time_label))
        if result.report["muscles"][name].get("moment_arms"):
            arms = arms or result.moment_arms()
            path, published = out / f"{name}_moment_arms.png", result.literature.get(name, ())
            written.append(plot_moment_arms(path, arms[name], literature=published, title=title))
    if paths:
        return written
    rows = {name: result.report["muscles"][name]["frames"] for name in names}
    written.append(
        plot_volume(
            out / "volume.png",
            {name: [row["time"] for row in table] for name, table in rows.items()},
            {name: [row["volume_ratio"] for row in table] for name, table in rows.items()},
            title=result.name,
            time_label=result.time_label,
        )
    )
    return written


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

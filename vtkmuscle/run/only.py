"""A single output of a scene, by the shortest filter chain."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.shared import keep_shared
from vtkmuscle.core.moment_arms.of_joints import JointArms, joint_arms
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import shallow_copy
from vtkmuscle.data.attachments import VIA
from vtkmuscle.data.paths import path_lines_of
from vtkmuscle.io.temporal import Series
from vtkmuscle.io.writing import Outputs
from vtkmuscle.run.frames import FrameChoice, MuscleTrack, frame_numbers
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.run.table import MomentArmTable, Table, length_table
from vtkmuscle.scene.data import SceneData

#: The outputs that can be asked for alone.
ONLY = ("lengths", "moment_arms", "surfaces")


def run_only(
    scene: SceneData,
    what: str,
    out: str | PathLike[str] | None = None,
    *,
    frames: FrameChoice = None,
    overwrite: bool = False,
    progress: Callable[[str, str, float], None] | None = None,
) -> Table | dict[str, list[vtkPolyData]]:
    """Compute the lengths, the moment arms or the surfaces of a scene alone.

    Lengths and moment arms take the paths alone: no muscle is deformed, no fibre is moved and no frame is
    measured. Moment arms need levers, lengths do not. Surfaces take the deformer without fibres.

    Parameters
    ----------
    scene : Scene
        The scene; lengths and moment arms need fibres, surfaces a deformer.
    what : str
        ``"lengths"``, ``"moment_arms"`` or ``"surfaces"``.
    out : path, optional
        Folder for ``lengths.csv``, ``moment_arms.csv`` or a ``NAME.pvd`` per muscle.
    frames : str, slice, range, int or None, optional
        Frames to compute, as of :class:`~vtkmuscle.run.RunOptions`; default all.
    overwrite : bool, optional
        Whether existing files may be replaced.
    progress : callable, optional
        Called with the muscle's name, the stage, and the finished part, 0 to 1.

    Returns
    -------
    Table
        A row per muscle, path and frame; lengths and moment arms in mm.
    dict of str to list of vtkPolyData
        For surfaces: the muscles in the frames.

    Raises
    ------
    ValueError
        If the output is unknown, a file would be replaced, or a stage cannot run.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.run import run_only
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    >>> len(run_only(scene, "lengths", frames="0:2")["length_mm"])
    16
    """
    if what not in ONLY:
        raise InputError("", f"only is {what!r}, but must be one of {', '.join(map(repr, ONLY))}")
    if what == "surfaces" and scene.deformer == "none":
        raise InputError("deformer", "it is 'none', so there are no surfaces", "use 'paths' or 'pbd'")
    folder = None if out is None else Path(out)
    names = [f"{name}.pvd" for name in scene.muscles] if what == "surfaces" else [f"{what}.csv"]
    outputs = None if folder is None else Outputs(folder, inputs=scene.files, overwrite=overwrite)
    if outputs is not None:
        for name in names:
            outputs.check(outputs.folder / name)
    numbers = frame_numbers(frames, len(scene.motion.times))
    tell = progress or (lambda _muscle, _stage, _part: None)
    with keep_shared(), outputs or nullcontext():
        if what == "surfaces":
            return {name: _surfaces(scene, name, numbers, folder, tell) for name in scene.muscles}
        table = _tables(scene, what, numbers, tell)
        if folder is not None:
            table.to_csv(folder / f"{what}.csv", digits=None if what == "lengths" else 10)
    return table


def _surfaces(
    scene: SceneData, name: str, numbers: range, folder: Path | None, tell: Callable[[str, str, float], None]
) -> list[vtkPolyData]:
    """Return the surfaces of a muscle, each also written."""
    deformer = muscle_pipeline(scene, name).deformer
    assert deformer is not None  # the scene has one
    series = None if folder is None else Series(folder, name)
    surfaces = []
    for done, number in enumerate(numbers):
        tell(name, "deforming", done / len(numbers))
        time = float(scene.motion.times[number])
        surfaces.append(shallow_copy(deformer.update(time=time).output))
        if series is not None:
            series.add(number, time, surfaces[-1])
    tell(name, "done", 1.0)
    return surfaces


def _tables(scene: SceneData, what: str, numbers: range, tell: Callable[[str, str, float], None]) -> Table:
    """Return the table of lengths or of moment arms."""
    paths_alone = SceneData(**{field.name: getattr(scene, field.name) for field in fields(SceneData)})
    paths_alone = replace(
        paths_alone,
        deformer="none",
        quality=None if scene.quality == "published" else scene.quality,
        muscles={name: replace(muscle, aponeuroses=()) for name, muscle in scene.muscles.items()},
    )
    motion, times = scene.motion.part(numbers), [float(scene.motion.times[number]) for number in numbers]
    lengths: dict[str, Floats] = {}
    errors: dict[str, Mapping[str, Floats]] = {}
    arms: dict[str, dict[str, JointArms]] = {}
    refused: dict[str, str] = {}
    for name, muscle in scene.muscles.items():
        taut = muscle_pipeline(paths_alone, name).taut_paths
        assert taut is not None
        taut.levers = what == "moment_arms"
        track = MuscleTrack(report={"via_rings": sum(area.role == VIA for area in muscle.attachments)})
        for done, time in enumerate(times):
            tell(name, "pulling paths", done / len(times))
            lines = path_lines_of(taut.update(time=time).output, name)
            if lines is None:
                raise InputError(f"muscles.{name}", "the muscle has no paths", "add fibres")
            track.add_lengths(lines.data, scene.millimetres)
        lengths[name], errors[name] = np.array(track.lengths), track.errors()
        if what == "moment_arms":
            arms[name], without = joint_arms(
                lengths[name], track.levers(), motion, crossed=muscle.crosses, millimetres=scene.millimetres
            )
            refused |= without
        tell(name, "done", 1.0)
    if what == "moment_arms":
        return MomentArmTable(arms, refused).table()
    return length_table(lengths, numbers, times, errors)

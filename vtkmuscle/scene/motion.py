"""The motion of a scene, from its table and the files that it names."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io import motion_columns, read_motion_table
from vtkmuscle.scene.faults import Faults, SceneError
from vtkmuscle.scene.files import SceneFiles
from vtkmuscle.scene.schema import ALONE, SceneTable

if TYPE_CHECKING:
    from vtkmuscle.opensim.scene_joints import SceneJoints


def joints_of(scene: SceneTable, files: SceneFiles) -> SceneJoints | None:
    """Return the joints of a scene, None where it has none.

    Raises
    ------
    SceneError
        If a file cannot be read, or the joints are no tree.
    """
    if scene.opensim is None and not scene.joints:
        return None
    from vtkmuscle.opensim.scene_joints import joints_in  # noqa: PLC0415 -- scenes with joints alone need it

    return joints_in(scene, files)


def motion_from(scene: SceneTable, files: SceneFiles) -> RigidMotion:
    """Return the motion of a scene.

    Raises
    ------
    SceneError
        If a file cannot be read, or tables do not agree.
    """
    table = scene.motion
    joints = joints_of(scene, files)
    if joints is not None:
        return joints.motion(scene, files)
    if (turn := table.hinge) is not None:
        return hinge(turn.bone, turn.centre, turn.axis, steps_of(*turn.angles), coordinate=turn.coordinate)
    coordinates = table.coordinates
    options: dict[str, Any] = {
        "time": table.time,
        "centre": _centre(table.centre, table.bone),
        "coordinates": None
        if coordinates is None
        else {name: one.model_dump(exclude_unset=True) for name, one in coordinates.items()},
    }
    transforms = table.transforms or {}
    if ALONE not in transforms:
        return _of_several(transforms, files, options, table.centre)
    read = partial(read_motion_table, bone=str(table.bone), **options)
    return files.read("motion.transforms", transforms[ALONE], read)


def _centre(centres: dict[str, list[float]] | None, bone: str | None) -> list[float] | None:
    """Return the centre of a bone's motion."""
    if centres is None:
        return None
    return centres.get(ALONE, centres.get(str(bone)))


def _of_several(
    tables: dict[str, str],
    files: SceneFiles,
    options: dict[str, Any],
    centres: dict[str, list[float]] | None,
) -> RigidMotion:
    """Return the motion of several bones, each with a table, which takes those coordinates that it has."""
    motions: list[RigidMotion] = []
    seen: set[str] = set()
    wanted, scene = options["coordinates"], files.paths[""]

    def read(path: Path, bone: str) -> RigidMotion:
        columns = motion_columns(path)
        seen.update(columns)
        own = wanted and {name: kind for name, kind in wanted.items() if name in columns}
        centre = _centre(centres, bone)
        return read_motion_table(path, bone, **{**options, "coordinates": own, "centre": centre})

    faults = Faults()
    for bone, text in tables.items():
        with faults.gathered():
            key = f"motion.transforms.{bone}"
            motion = files.read(key, text, partial(read, bone=bone))
            if motions and not np.array_equal(motion.times, motions[0].times):
                problem = "its times differ from those of the first table"
                raise SceneError(problem, key, "give all tables the same times", scene)
            motions.append(motion)
    faults.raise_any()
    transforms = {bone: table for motion in motions for bone, table in motion.transforms.items()}
    coordinates: dict[str, Coordinate] = {}
    for motion in motions:
        for name, coordinate in motion.coordinates.items():
            known = coordinates.setdefault(name, coordinate)
            if not np.array_equal(known.values, coordinate.values):
                remedy = "give it the same values in all tables, or another name in one"
                raise SceneError(f"{name!r} differs from table to table", "motion.coordinates", remedy, scene)
    missing = sorted(set(wanted or ()) - seen)
    if missing:
        problem = f"no table has the column {missing[0]!r}"
        raise SceneError(problem, "motion.coordinates", suggestion(missing[0], sorted(seen)), scene)
    found = {bone: one.centre_of(bone) for bone, one in zip(tables, motions, strict=True)}
    return RigidMotion(motions[0].times, transforms, found if centres else None, coordinates)


def steps_of(start: float, stop: float, step: float) -> Floats:
    """Return values from start to stop, which is the last one also where it is no whole number of steps away.

    Examples
    --------
    >>> from vtkmuscle.scene.motion import steps_of
    >>> steps_of(0.0, 5.0, 2.0).tolist()
    [0.0, 2.0, 4.0, 5.0]
    """
    # A stop that is a whole number of steps away, up to rounding, is reached by the last step.
    count = (stop - start) / step
    whole = int(np.floor(count + 1e-9))
    values = start + step * np.arange(whole + 1)
    if count - whole > 1e-9:
        return np.append(values, stop)
    values[-1] = stop
    return np.asarray(values, dtype=np.float64)

"""A scene's motion, from its table and files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge
from vtkmuscle.core.words import suggestion
from vtkmuscle.io import motion_columns, read_motion_table
from vtkmuscle.joints import steps_of
from vtkmuscle.scene.faults import Faults, SceneError
from vtkmuscle.scene.files import SceneFiles
from vtkmuscle.scene.schema import ALONE, Motion, SceneTable

if TYPE_CHECKING:
    from vtkmuscle.scene.joints import SceneJoints


def joints_of(scene: SceneTable, files: SceneFiles) -> SceneJoints | None:
    """Return a scene's joints, None without joints; SceneError for faults."""
    if scene.opensim is None and not scene.joints:
        return None
    from vtkmuscle.scene.joints import joints_in  # noqa: PLC0415 -- only scenes with joints need it

    return joints_in(scene, files)


def motion_from(scene: SceneTable, files: SceneFiles, joints: SceneJoints | None) -> RigidMotion:
    """Return a scene's motion; SceneError for unreadable or inconsistent tables."""
    table = scene.motion
    if joints is not None:
        return joints.motion(scene, files)
    if (turn := table.hinge) is not None:
        return hinge(turn.bone, turn.centre, turn.axis, steps_of(*turn.angles), coordinate=turn.coordinate)
    columns = None
    if table.coordinates is not None:
        columns = {name: kind.model_dump(exclude_unset=True) for name, kind in table.coordinates.items()}
    centres, transforms = table.centre or {}, table.transforms or {}
    if ALONE in transforms:
        bone = str(table.bone)
        centre = centres.get(ALONE, centres.get(bone))
        read = partial(read_motion_table, bone=bone, time=table.time, centre=centre, coordinates=columns)
        return files.read("motion.transforms", transforms[ALONE], read)
    return _of_several(table, columns, files)


def _of_several(
    table: Motion, columns: Mapping[str, Mapping[str, str]] | None, files: SceneFiles
) -> RigidMotion:
    """Return the motion of bones with a table each."""
    motions: list[RigidMotion] = []
    seen: set[str] = set()
    centres, scene, faults = table.centre or {}, files.paths[""], Faults()

    def read(path: Path, bone: str) -> RigidMotion:
        present = motion_columns(path)
        seen.update(present)
        own = columns and {name: kind for name, kind in columns.items() if name in present}
        centre = centres.get(ALONE, centres.get(bone))
        return read_motion_table(path, bone, time=table.time, centre=centre, coordinates=own)

    for bone, text in (table.transforms or {}).items():
        with faults.gathered():
            key = f"motion.transforms.{bone}"
            motions.append(files.read(key, text, partial(read, bone=bone)))
            if not np.array_equal(motions[-1].times, motions[0].times):
                problem = "its times differ from those of the first table"
                raise SceneError(problem, key, "give all tables the same times", scene)
    faults.raise_any()
    coordinates: dict[str, Coordinate] = {}
    for motion in motions:
        for name, coordinate in motion.coordinates.items():
            if not np.array_equal(coordinates.setdefault(name, coordinate).values, coordinate.values):
                remedy = "give it the same values in all tables, or another name in one"
                raise SceneError(f"{name!r} differs from table to table", "motion.coordinates", remedy, scene)
    if missing := sorted(set(columns or ()) - seen):
        problem = f"no table has the column {missing[0]!r}"
        raise SceneError(problem, "motion.coordinates", suggestion(missing[0], sorted(seen)), scene)
    moving = {bone: poses for motion in motions for bone, poses in motion.transforms.items()}
    centre = {bone: motion.centre_of(bone) for motion in motions for bone in motion.transforms}
    return RigidMotion(motions[0].times, moving, centre if centres else None, coordinates)

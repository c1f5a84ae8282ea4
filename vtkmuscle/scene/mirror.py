"""Mirrored scenes, for the other side of the body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkReverseSense

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.scene.data import Muscle


def mirrored_fields(fields: dict[str, Any], axis: str) -> dict[str, Any]:
    """Return a scene's fields mirrored along ``"x"``, ``"y"`` or ``"z"``."""
    signs = np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    return fields | {
        "bones": {name: mirrored_surface(bone, signs) for name, bone in fields["bones"].items()},
        "muscles": {name: _muscle(muscle, signs) for name, muscle in fields["muscles"].items()},
        "motion": mirrored_motion(fields["motion"], signs),
    }


def turned_over(surface: vtkPolyData) -> vtkPolyData:
    """Return a surface with reversed triangles."""
    reverse = vtkReverseSense()
    reverse.SetInputData(surface)
    reverse.Update()
    result: vtkPolyData = reverse.GetOutput()
    return result


def mirrored_surface(surface: vtkPolyData, signs: Floats) -> vtkPolyData:
    """Return a surface with points times signs (3,), same outward side."""
    return turned_over(with_points(surface, points_of(surface) * signs))


def mirrored_motion(motion: RigidMotion, signs: Floats) -> RigidMotion:
    """Return the motion of mirrored bones; coordinate values stay."""
    both = np.append(signs, 1.0)
    centre = motion.centre
    if isinstance(centre, Mapping):
        centre = {bone: point * signs for bone, point in centre.items()}
    elif centre is not None:
        centre = centre * signs
    transforms = {bone: both[:, None] * table * both for bone, table in motion.transforms.items()}
    coordinates = {name: old.carried(np.diag(both)) for name, old in motion.coordinates.items()}
    return RigidMotion(motion.times, transforms, centre, coordinates)


def _muscle(muscle: Muscle, signs: Floats) -> Muscle:
    lines = muscle.superficial_fibres
    return replace(
        muscle,
        surface=mirrored_surface(muscle.surface, signs),
        attachments=tuple(
            replace(area, landmarks=np.asarray(area.landmarks) * signs) for area in muscle.attachments
        ),
        aponeuroses=tuple(
            replace(sheet, points=sheet.points * signs, triangles=sheet.triangles[:, ::-1])
            for sheet in muscle.aponeuroses
        ),
        superficial_fibres=None if lines is None else with_points(lines, points_of(lines) * signs),
    )

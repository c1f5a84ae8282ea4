"""The other side of the body: a scene mirrored along an axis."""

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
    """Return the fields of a scene, mirrored along the axis ``"x"``, ``"y"`` or ``"z"`` of its frame."""
    signs = np.where(np.array(list("xyz")) == axis, -1.0, 1.0)
    return fields | {
        "bones": {name: mirrored_surface(bone, signs) for name, bone in fields["bones"].items()},
        "muscles": {name: _muscle(muscle, signs) for name, muscle in fields["muscles"].items()},
        "motion": mirrored_motion(fields["motion"], signs),
    }


def turned_over(surface: vtkPolyData) -> vtkPolyData:
    """Return a surface whose triangles face the other side."""
    reverse = vtkReverseSense()
    reverse.SetInputData(surface)
    reverse.Update()
    result: vtkPolyData = reverse.GetOutput()
    return result


def mirrored_surface(surface: vtkPolyData, signs: Floats) -> vtkPolyData:
    """Return a surface with its points times signs (3,), and its triangles facing the same side."""
    return turned_over(with_points(surface, points_of(surface) * signs))


def mirrored_motion(motion: RigidMotion, signs: Floats) -> RigidMotion:
    """Return the motion of mirrored bones; the values of its coordinates stay."""
    both = np.append(signs, 1.0)
    centre = motion.centre
    if isinstance(centre, Mapping):
        centre = {bone: one * signs for bone, one in centre.items()}
    elif centre is not None:
        centre = centre * signs
    transforms = {bone: both[:, None] * table * both for bone, table in motion.transforms.items()}
    coordinates = {name: one.carried(np.diag(both)) for name, one in motion.coordinates.items()}
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
            replace(one, points=one.points * signs, triangles=one.triangles[:, ::-1])
            for one in muscle.aponeuroses
        ),
        superficial_fibres=None if lines is None else with_points(lines, points_of(lines) * signs),
    )

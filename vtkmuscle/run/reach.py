"""Where the muscles of a scene may meet its bones: the part of each bone whose distances are needed."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of, set_field_array
from vtkmuscle.scene.data import SceneData

#: Factor by which muscles are enlarged about their middles: one that shortens bulges, and a solve may
#: pass through shapes that are larger than the one it ends at.
BULGE = 1.1


def bones_with_reach(scene: SceneData) -> dict[str, vtkPolyData]:
    """Return the bones of a scene, each with the field array ``Reach`` for PBDDeformer.

    It has the corners of the convex hull, seen from the bone, of all muscles, somewhat enlarged, where the
    bones that they are attached to take them, at all times of the motion: not only at those that are asked
    for, and of all muscles together, so that one grid does for all of them, and in later runs.
    """
    frames = [scene.motion.at(float(time)) for time in scene.motion.times]
    muscles = [
        (
            _bulging(_corners(points_of(muscle.surface))),
            {area.bone for area in muscle.attachments} or set(scene.bones),
        )
        for muscle in scene.muscles.values()
    ]
    blocks = {}
    for name, bone in scene.bones.items():
        swept = []
        for frame in frames:
            to_bone = inverse(frame.get(name, np.eye(4)))
            for points, carriers in muscles:
                swept += [apply_transform(to_bone @ frame.get(by, np.eye(4)), points) for by in carriers]
        blocks[name] = vtkPolyData()
        blocks[name].ShallowCopy(bone)
        set_field_array(blocks[name], "Reach", _corners(np.concatenate(swept)))
    return blocks


def _bulging(corners: Floats) -> Floats:
    middle = corners.mean(axis=0)
    enlarged: Floats = middle + BULGE * (corners - middle)
    return enlarged


def _corners(points: Floats) -> Floats:
    """Return the corners of the convex hull of points (n, 3), or the points where they are in one plane."""
    try:
        corners: Floats = points[ConvexHull(points).vertices]
    except QhullError:
        return points
    return corners

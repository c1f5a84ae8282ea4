"""Shared parts of deformers: the muscle at rest and in a pose, and figures of a frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.bone import Bone, depth_in
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.pbd.solver import State
from vtkmuscle.core.skinning.carried_muscle import CarriedPose
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import add_arrays, field_array, with_points

#: Field arrays of a shape report.
SHAPE = {
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    "DihedralErrorP95": "dihedral_error_p95",
    "DegenerateEdges": "degenerate_edges",
}
#: Keys of a row of figures, by field array.
FIGURES = SHAPE | {
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}


def deformed_muscle(
    data: vtkPolyData,
    rest: FixedMuscle,
    pose: State | CarriedPose,
    shape: RestShape,
    bones: Iterable[tuple[Bone, Floats]],
    measured: tuple[bool, bool],
) -> vtkPolyData:
    """Return a muscle in a pose; if wanted, with measures of its shape and of its depth in bones."""
    result: vtkPolyData = with_points(data, pose.surface)
    add_arrays(result, points={"Displacement": pose.surface - rest.points})
    fields: dict[str, float] = {}
    if measured[0]:
        report = shape.compare(pose.surface)
        fields = {name: getattr(report, attribute) for name, attribute in SHAPE.items()}
        fields["CollidingPoints"] = pose.colliding
    if measured[1]:
        depths = depth_in(bones, pose.surface[rest.fixed_to < 0])
        fields["PenetrationMax"] = float(depths.max(initial=0.0))
        fields["PenetrationP95"] = float(np.percentile(depths, 95)) if len(depths) else 0.0
        fields["PenetratingPoints"] = int((depths > 0.0).sum())
    return add_arrays(result, fields=fields)


def read_shape(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a deformed muscle by key, lengths in millimetres."""
    row: dict[str, float] = {}
    for name, key in FIGURES.items():
        if (array := field_array(deformed, name)) is not None:
            row[key] = array[-1].item() * (millimetres if key.endswith("_mm") else 1)
    return row

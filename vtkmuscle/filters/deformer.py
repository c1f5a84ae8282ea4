"""Shared parts of deformers: parameters and presets, the muscle in a pose, and figures of a frame."""

from collections.abc import Iterable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.bone import Bone, depth_in
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.mesh.rest_shape import RestShape, ShapeReport
from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters, State
from vtkmuscle.core.pbd.voxels import DEFAULT_N_MAX, MOST_N_EQUAL
from vtkmuscle.core.skinning.carried_muscle import CarriedPose
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import add_arrays, field_array, with_points
from vtkmuscle.filters.base.docstrings import entry
from vtkmuscle.filters.base.parameters import Parameter, quality_of

_DEFAULT = Parameters()
#: Defaults of the parameters in presets.
_BALANCED: Mapping[str, Any] = {"solved_triangles": 3000, "collision": "sdf"} | {
    name: getattr(_DEFAULT, name) for name in ("iterations", *PUBLISHED)
}
#: Values of the parameters by quality.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {**_BALANCED, "solved_triangles": 1000},
        "balanced": _BALANCED,
        "accurate": {**_BALANCED, "iterations": 100},
        "published": {**PUBLISHED, "iterations": 30, "solved_triangles": 0, "collision": "voxel"},
    }
)
_WITH_VELOCITY = "prediction", "velocity"
#: Numbers of voxels, declared alike by the filters with voxels.
N_VOXELS = partial(Parameter[int], int, default=DEFAULT_N_MAX, minimum=1, maximum=MOST_N_EQUAL**3)
N_VOXELS_PER_AXIS = partial(Parameter[int | None], int, default=None, minimum=1, maximum=MOST_N_EQUAL)


def _of_solver(name: str, units: str = "", **more: Any) -> Parameter[Any]:
    """Return a parameter of the solver, with its default and description."""
    default = getattr(_DEFAULT, name)
    doc = entry(Parameters.__doc__, name).replace(f" [{units}]", "")
    return Parameter(type(default), default=default, units=units, doc=doc, **more)


class DeformerSettings:
    """The parameters of PBDDeformer.

    Parameters
    ----------
    quality
        A preset of the parameters from iterations to finish, and of collision; 'published' is Algorithm 2 as
        printed. None sets nothing.
    solved_triangles
        Number of triangles of a decimated surface, solved in place of a larger muscle; 0 solves all. Edges
        must be shorter than a bone is round: a gluteus maximus of 1000 passes through the trochanter, of 3000
        does not.
    collision
        Contact with bones: by signed distances, by voxels as published, or off.
    bone_clearance
        Distance between points and bones; points nearer at rest may come as near.
    n_voxels
        Approximate number of voxels of a bone, nearly cubes.
    n_voxels_per_axis
        Number of voxels along each axis of a bone's box, instead of n_voxels.
    measure_shape
        Report the shape's deviations from rest.
    measure_penetration
        Measure depths of points in bones, against their triangles, in each frame.
    checkpoint_memory
        Memory for stored frames; the last two are kept even with 0.
    """

    quality = quality_of(PRESETS)
    iterations = _of_solver("iterations", minimum=1, maximum=10_000)
    solved_triangles = Parameter(int, default=3000, minimum=0, maximum=10**8)
    prediction = _of_solver("prediction", choices=("bones", "velocity"))
    signed_angles = _of_solver("signed_angles")
    order = _of_solver("order", choices=("edge", "kind"))
    anisotropy = _of_solver("anisotropy", choices=("always", "fibres", "off"))
    finish = _of_solver("finish")
    stiffness = _of_solver("stiffness", minimum=0.0, maximum=1.0)
    shape_stiffness = _of_solver("shape_stiffness", minimum=0.0, maximum=1.0)
    volume_stiffness = _of_solver("volume_stiffness", minimum=0.0, maximum=1.0)
    collision = Parameter(str, default="sdf", choices=("sdf", "voxel", "off"))
    bone_clearance = Parameter(float, default=0.0, minimum=0.0, units="mm", only_with=("collision", "sdf"))
    n_voxels = N_VOXELS(only_with=("collision", "voxel"))
    n_voxels_per_axis: Parameter[int | None] = N_VOXELS_PER_AXIS(only_with=("collision", "voxel"))
    bone_push = _of_solver("bone_push", choices=("transform", "off"), only_with=("collision", "voxel"))
    dt = _of_solver("dt", "s", above=0.0, maximum=1000.0, only_with=_WITH_VELOCITY)
    velocity_kept = _of_solver("velocity_kept", minimum=0.0, maximum=1.0, only_with=_WITH_VELOCITY)
    external_force = _of_solver("external_force", "mm/s^2", length=3, only_with=_WITH_VELOCITY)
    contact_velocity = _of_solver("contact_velocity", choices=("keep", "zero"), only_with=_WITH_VELOCITY)
    measure_shape = Parameter(bool, default=False)
    measure_penetration = Parameter(bool, default=False)
    checkpoint_memory = Parameter(float, default=256.0, minimum=0.0, units="MB")


#: Attributes of a shape report by field array: VolumeRatio for volume_ratio, and so on.
SHAPE = {"".join(map(str.capitalize, name.split("_"))): name for name in ShapeReport.__annotations__}
#: Keys of a row of figures, by field array.
FIGURES = SHAPE | {
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}


def deformed_muscle(
    data: vtkPolyData, rest: FixedMuscle, pose: State | CarriedPose, shape: RestShape,
    bones: Iterable[tuple[Bone, Floats]], measured: tuple[bool, bool],
) -> vtkPolyData:  # fmt: skip
    """Return a muscle in a pose; if wanted, with measures of its shape and of its depth in bones."""
    result = with_points(data, pose.surface)
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

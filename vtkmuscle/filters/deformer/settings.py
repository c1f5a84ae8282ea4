"""The parameters of PBDDeformer, and presets on the front of cost against smoothness."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters
from vtkmuscle.core.pbd.voxels import DEFAULT_N_MAX, MOST_N_EQUAL
from vtkmuscle.filters.base.docstrings import entry
from vtkmuscle.filters.base.parameters import Parameter

_DEFAULT = Parameters()

#: Defaults of the parameters in presets.
_BALANCED: Mapping[str, Any] = {
    "iterations": _DEFAULT.iterations,
    "solved_triangles": 3000,
    "collision": "sdf",
    **{name: getattr(_DEFAULT, name) for name in PUBLISHED},
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

    quality: Parameter[str | None] = Parameter(str, default=None, choices=tuple(PRESETS), sets=PRESETS)
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
    n_voxels = Parameter(
        int, default=DEFAULT_N_MAX, minimum=1, maximum=MOST_N_EQUAL**3, only_with=("collision", "voxel")
    )
    n_voxels_per_axis: Parameter[int | None] = Parameter(
        int, default=None, minimum=1, maximum=MOST_N_EQUAL, only_with=("collision", "voxel")
    )
    bone_push = _of_solver("bone_push", choices=("transform", "off"), only_with=("collision", "voxel"))
    dt = _of_solver("dt", "s", above=0.0, maximum=1000.0, only_with=_WITH_VELOCITY)
    velocity_kept = _of_solver("velocity_kept", minimum=0.0, maximum=1.0, only_with=_WITH_VELOCITY)
    external_force = _of_solver("external_force", "mm/s^2", length=3, only_with=_WITH_VELOCITY)
    contact_velocity = _of_solver("contact_velocity", choices=("keep", "zero"), only_with=_WITH_VELOCITY)
    measure_shape = Parameter(bool, default=False)
    measure_penetration = Parameter(bool, default=False)
    checkpoint_memory = Parameter(float, default=256.0, minimum=0.0, units="MB")


def solver_parameters(settings: Mapping[str, Any]) -> Parameters:
    """Return the solver's parameters among settings, else the defaults."""
    names = Parameters.__dataclass_fields__
    return Parameters(**{name: value for name, value in settings.items() if name in names})

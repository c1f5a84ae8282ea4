"""What can be set of PBDDeformer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX
from vtkmuscle.core.pbd.parameters import CHOICES, SolverParameters
from vtkmuscle.filters.base.parameters import Parameter

_DEFAULT = SolverParameters()

#: Parameters that say nothing unless another one has one of these values: a change of them alone changes no
#: frame.
ONLY_WITH = {
    "cell": ("collision", {"sdf"}),
    "skin": ("collision", {"sdf"}),
    "friction": ("collision", {"sdf"}),
    "n_max": ("collision", {"voxel"}),
    "n_equal": ("collision", {"voxel"}),
    "bone_push": ("collision", {"voxel"}),
    "tolerance": ("solver", {"anderson"}),
    "guidance": ("anisotropy", {"taut"}),
}


class DeformerSettings:
    """The parameters of PBDDeformer."""

    iterations = Parameter(
        int,
        default=_DEFAULT.iterations,
        minimum=1,
        maximum=1_000_000,
        doc="Projections of all constraints per step, at most.",
    )
    substeps = Parameter(
        int,
        default=_DEFAULT.substeps,
        minimum=1,
        maximum=10_000,
        doc="Parts that a step is cut into; bones move along their screws.",
    )
    dt = Parameter(float, default=_DEFAULT.dt, above=0.0, units="s", doc="Time of a step.")
    damping = Parameter(
        float,
        default=_DEFAULT.damping,
        minimum=0.0,
        maximum=1.0,
        doc="Part of the velocity that a step leaves.",
    )
    stiffness = Parameter(
        float,
        default=_DEFAULT.stiffness,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of edge lengths, per step (solver 'gauss-seidel') or per iteration ('anderson').",
    )
    shape_stiffness = Parameter(
        float,
        default=_DEFAULT.shape_stiffness,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of the angles between triangles, per step or per iteration as that of the edges.",
    )
    volume_stiffness = Parameter(
        float,
        default=_DEFAULT.volume_stiffness,
        minimum=0.0,
        maximum=1.0,
        doc="Stiffness of the muscle's volume, per step or per iteration as that of the edges.",
    )
    anisotropy = Parameter(
        str,
        default="taut",
        choices=("taut", "stiffness", "off"),
        aliases={True: "stiffness", False: "off"},
        doc="How edges give way along the fibres: they follow the fibres, pulled taut round the bones, or "
        "they are less stiff (P21; also True), or not at all (also False).",
    )
    guidance = Parameter(
        float,
        default=_DEFAULT.guidance,
        minimum=0.0,
        maximum=1.0,
        doc="Part of its way to where the taut fibres carry it that each iteration draws a point of the "
        "surface; for anisotropy 'taut' and a start other than 'inertial'.",
    )
    external_force = Parameter(
        tuple,
        default=_DEFAULT.external_force,
        length=3,
        units="mm/s^2",
        doc="Force per mass on all free points; with start 'inertial'. From the other starts the solve leads "
        "to where the constraints are met, and leaves the less of it the further it goes.",
    )
    collision = Parameter(
        str,
        default="sdf",
        choices=("sdf", "voxel", "none"),
        doc="How points are kept out of the bones: by signed distances, by voxels (P21) or not at all.",
    )
    cell: Parameter[float | None] = Parameter(
        float,
        default=None,
        above=0.0,
        units="mm",
        doc="Distance of the nodes of the signed distance grids; None is 1/600 of the diagonal of the bone's "
        "box along its principal axes.",
    )
    skin = Parameter(
        float,
        default=0.0,
        minimum=0.0,
        units="mm",
        doc="Distance that points keep from the bones; those nearer at rest may come as near; for collision "
        "'sdf'.",
    )
    friction = Parameter(
        float,
        default=0.0,
        minimum=0.0,
        doc="Coulomb's coefficient between muscle and bones: how much of the push out of a bone may be spent "
        "on holding a point where it is on the bone; for collision 'sdf'.",
    )
    n_max = Parameter(
        int,
        default=DEFAULT_N_MAX,
        minimum=1,
        doc="Number of voxels of a bone, about, shared out by the sides of its box so that they are nearly "
        "cubes; for collision 'voxel'.",
    )
    n_equal: Parameter[int | None] = Parameter(
        int,
        default=None,
        minimum=1,
        doc="Number of voxels along each axis of a bone's box, instead of n_max; for collision 'voxel'.",
    )
    bone_push = Parameter(
        str,
        default=_DEFAULT.bone_push,
        choices=CHOICES["bone_push"],
        doc="What a bone does to points that it moved over: take them with it, or nothing; for collision "
        "'voxel'.",
    )
    contact_velocity = Parameter(
        str,
        default=_DEFAULT.contact_velocity,
        choices=CHOICES["contact_velocity"],
        doc="Velocity of points that met a bone: none, as P21 proposes, or that of their displacement (P21).",
    )
    start = Parameter(
        str,
        default=_DEFAULT.start,
        choices=CHOICES["start"],
        doc="Where free points start each step: where their velocity takes them (P21), or where the bones' "
        "blended motions do.",
    )
    solver = Parameter(
        str,
        default=_DEFAULT.solver,
        choices=CHOICES["solver"],
        doc="The iteration: as it is (P21), or accelerated towards the same shape.",
    )
    tolerance = Parameter(
        float,
        default=_DEFAULT.tolerance,
        minimum=0.0,
        units="mm",
        doc="Stop where the converged shape is at most this far (root mean square): known where the taut "
        "fibres draw the points, with solver 'anderson'; all iterations are made elsewhere, and with 0.",
    )
    order = Parameter(
        str,
        default=_DEFAULT.order,
        choices=CHOICES["order"],
        doc="Order of projections: edges many at once and the volume last, or all one by one "
        "and the volume before angles and bones (P21), which keeps it less well.",
    )
    penetration = Parameter(
        bool,
        default=False,
        doc="Measure how deep points are in the bones, against their triangles, for each frame asked for.",
    )
    checkpoint_memory = Parameter(
        float,
        default=256.0,
        minimum=0.0,
        units="MB",
        doc="Memory for frames kept to go back in time; the last two are kept even with 0.",
    )


def solver_parameters(settings: Mapping[str, Any]) -> SolverParameters:
    """Return those of the parameters of PBDDeformer that are the solver's."""
    return SolverParameters(**{name: settings[name] for name in SolverParameters.__dataclass_fields__})


def settings_of_frames(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of the parameters of PBDDeformer that a frame depends on."""
    needed = dict(settings)
    del needed["checkpoint_memory"]
    if settings["collision"] != "none":  # the bones at rest are known then
        del needed["penetration"]
    for name, (other, values) in ONLY_WITH.items():
        if settings[other] not in values:
            del needed[name]
    return needed

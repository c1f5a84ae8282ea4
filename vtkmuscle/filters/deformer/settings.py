"""What can be set of PBDDeformer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX
from vtkmuscle.core.pbd.parameters import CHOICES, SolverParameters
from vtkmuscle.core.taut.paths import POINTS
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.deformer.quality import PRESETS

_DEFAULT = SolverParameters()


def _part(name: str, doc: str, **more: Any) -> Parameter[float]:
    """Return a parameter from 0 to 1, with the solver's default."""
    return Parameter(float, default=getattr(_DEFAULT, name), minimum=0.0, maximum=1.0, doc=doc, **more)


def _choice(name: str, doc: str, **more: Any) -> Parameter[str]:
    """Return a parameter with the solver's choices and default."""
    return Parameter(str, default=getattr(_DEFAULT, name), choices=CHOICES[name], doc=doc, **more)


class DeformerSettings:
    """The parameters of PBDDeformer."""

    quality: Parameter[str | None] = Parameter(
        str,
        default=None,
        choices=tuple(PRESETS),
        sets=PRESETS,
        doc="A name for a group of the parameters below, which are set with it: the settings of Kohout and "
        "Cervenka 2021 ('published'), or three on the curve of speed against accuracy; None sets nothing.",
    )
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
    velocity_kept = _part("velocity_kept", "Part of its velocity that a point keeps from step to step.")
    stiffness = _part(
        "stiffness",
        "Stiffness of edge lengths, per iteration; per step with solver 'gauss-seidel' on batched edges.",
    )
    shape_stiffness = _part(
        "shape_stiffness",
        "Stiffness of the angles between triangles, per iteration or per step as that of the edges.",
    )
    volume_stiffness = _part(
        "volume_stiffness",
        "Stiffness of the muscle's volume, per iteration or per step as that of the edges.",
    )
    anisotropy = Parameter(
        str,
        default="taut",
        choices=("taut", "stiffness", "off"),
        doc="How edges give way along the fibres: they follow the fibres, pulled taut round the bones, or "
        "they are less stiff (Kohout and Cervenka 2021), or not at all.",
    )
    guidance = _part(
        "guidance",
        "Part of its way to where the taut fibres carry it that each iteration draws a point of the "
        "surface; not with prediction 'inertial'.",
        only_with=("anisotropy", "taut"),
    )
    taut_resolution = Parameter(
        int,
        default=POINTS - 1,
        minimum=4,
        maximum=1000,
        only_with=("anisotropy", "taut"),
        doc="Segments of a taut fibre; the cells of the bones' distances that it asks are half as long. "
        "Round a cylinder those of 16 have moment arms 1 % less than those of 32 and 64, which agree.",
    )
    external_force = Parameter(
        tuple,
        default=_DEFAULT.external_force,
        length=3,
        units="mm/s^2",
        doc="Force per mass on all free points; for prediction 'inertial'. With another one the solve leads "
        "to where the constraints are met, and leaves the less of the force the further it goes.",
    )
    collision = Parameter(
        str,
        default="sdf",
        choices=("sdf", "voxel", "off"),
        doc="How points are kept out of the bones: by signed distances, by voxels (published) or not at all.",
    )
    bone_clearance = Parameter(
        float,
        default=0.0,
        minimum=0.0,
        units="mm",
        only_with=("collision", "sdf"),
        doc="Distance that points keep from the bones; those nearer at rest may come as near.",
    )
    n_voxels = Parameter(
        int,
        default=DEFAULT_N_MAX,
        minimum=1,
        only_with=("collision", "voxel"),
        doc="Number of voxels of a bone, about, shared out by the sides of its box so that they are nearly "
        "cubes.",
    )
    n_voxels_per_axis: Parameter[int | None] = Parameter(
        int,
        default=None,
        minimum=1,
        only_with=("collision", "voxel"),
        doc="Number of voxels along each axis of a bone's box, instead of n_voxels.",
    )
    bone_push = _choice(
        "bone_push",
        "What a bone does to points that it moved over: take them with it, or nothing.",
        only_with=("collision", "voxel"),
    )
    contact_velocity = _choice(
        "contact_velocity",
        "Velocity of points that met a bone: none, as Kohout and Cervenka 2021 propose, or that of "
        "their displacement, as they compute it.",
    )
    prediction = _choice(
        "prediction",
        "Where free points start each step: where their velocity takes them (published), or where the "
        "bones' blended motions do.",
    )
    solver = _choice("solver", "The iteration: as it is (published), or accelerated towards the same shape.")
    tolerance = Parameter(
        float,
        default=_DEFAULT.tolerance,
        minimum=0.0,
        units="mm",
        only_with=("solver", "anderson"),
        doc="Stop where the converged shape is at most this far (root mean square): known where the taut "
        "fibres draw the points; all iterations are made elsewhere, and with 0.",
    )
    projection_order = _choice(
        "projection_order",
        "Order of projections: edges many at once and the volume last, or one by one as printed (published): "
        "the volume before angles and bones, which keeps it less well, and angles without a sign.",
    )
    measure_penetration = Parameter(
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

"""What can be set of PBDDeformer, and its qualities: points on the front of cost against smoothness."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.algorithm_2.solver import Parameters
from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX, MOST_N_EQUAL
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.paths.sheet import POINTS
from vtkmuscle.filters.base.docstrings import entry
from vtkmuscle.filters.base.parameters import Parameter

#: Name of the quality that is Algorithm 2 of Kohout, Cervenka 2021, doi:10.1007/978-3-030-72379-8_24.
PUBLISHED = "published"

#: What each quality sets of PBDDeformer's parameters.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"collision": "sdf", "iterations": 2, "taut_resolution": 24},
        "balanced": {"collision": "sdf", "iterations": 5, "taut_resolution": POINTS - 1},
        "accurate": {"collision": "sdf", "iterations": 20, "taut_resolution": 2 * (POINTS - 1)},
        PUBLISHED: {"collision": "voxel", "iterations": 30},
    }
)


_DEFAULT = Parameters()
_ONLY_PUBLISHED: tuple[str, *tuple[str, ...]] = ("quality", PUBLISHED)


def _published(name: str, units: str = "", **more: Any) -> Parameter[Any]:
    """Return a parameter of Algorithm 2, with its default, and what is said of it there."""
    default = getattr(_DEFAULT, name)
    doc = entry(Parameters.__doc__, name).replace(f" [{units}]", "")
    return Parameter(type(default), default=default, only_with=_ONLY_PUBLISHED, units=units, doc=doc, **more)


class DeformerSettings:
    """The parameters of PBDDeformer.

    Parameters
    ----------
    quality
        A name for collision, iterations and taut_resolution, which are set with it: how finely the muscle is
        solved ('balanced' are the defaults); with 'published' by Algorithm 2 of Kohout and Cervenka 2021.
        None sets nothing.
    iterations
        Rounds in which the muscle settles, or iterations of Algorithm 2, per frame.
    taut_resolution
        Segments of a taut fibre; the cells of the bones' distances that it asks are half as long. Round a
        cylinder those of 16 have moment arms 1 % less than those of 32 and 64, which agree.
    collision
        How points are kept out of the bones: by signed distances, by voxels (with quality 'published' only)
        or not at all.
    bone_clearance
        Distance that points keep from the bones; those nearer at rest may come as near.
    n_voxels
        Number of voxels of a bone, about, shared out by the sides of its box so that they are nearly cubes.
    n_voxels_per_axis
        Number of voxels along each axis of a bone's box, instead of n_voxels.
    measure_penetration
        Measure how deep points are in the bones, against their triangles, for each frame asked for.
    checkpoint_memory
        Memory for frames kept to go back in time; the last two are kept even with 0.
    """

    quality: Parameter[str | None] = Parameter(str, default=None, choices=tuple(PRESETS), sets=PRESETS)
    iterations = Parameter(int, default=PRESETS["balanced"]["iterations"], minimum=1, maximum=10_000)
    taut_resolution = Parameter(int, default=POINTS - 1, minimum=4, maximum=1000)
    collision = Parameter(str, default="sdf", choices=("sdf", "voxel", "off"))
    bone_clearance = Parameter(float, default=0.0, minimum=0.0, units="mm", only_with=("collision", "sdf"))
    n_voxels = Parameter(
        int, default=DEFAULT_N_MAX, minimum=1, maximum=MOST_N_EQUAL**3, only_with=("collision", "voxel")
    )
    n_voxels_per_axis: Parameter[int | None] = Parameter(
        int, default=None, minimum=1, maximum=MOST_N_EQUAL, only_with=("collision", "voxel")
    )
    bone_push = _published("bone_push", choices=("transform", "off"))
    contact_velocity = _published("contact_velocity", choices=("keep", "zero"))
    anisotropy = _published("anisotropy")
    stiffness = _published("stiffness", minimum=0.0, maximum=1.0)
    shape_stiffness = _published("shape_stiffness", minimum=0.0, maximum=1.0)
    volume_stiffness = _published("volume_stiffness", minimum=0.0, maximum=1.0)
    dt = _published("dt", "s", above=0.0, maximum=1000.0)
    velocity_kept = _published("velocity_kept", minimum=0.0, maximum=1.0)
    external_force = _published("external_force", "mm/s^2", length=3)
    measure_penetration = Parameter(bool, default=False)
    checkpoint_memory = Parameter(float, default=256.0, minimum=0.0, units="MB")


def algorithm_2_parameters(settings: Mapping[str, Any]) -> Parameters:
    """Return those of the parameters of PBDDeformer that are Algorithm 2's."""
    return Parameters(**{name: settings[name] for name in Parameters.__dataclass_fields__})


def check_together(settings: Mapping[str, Any]) -> None:
    """Raise a ValueError where values of the parameters do not go together."""
    if settings["collision"] == "voxel" and settings["quality"] != PUBLISHED:
        raise InputError(
            "",
            f"collision is 'voxel', which goes with quality '{PUBLISHED}' only, but quality is "
            f"{settings['quality']!r}",
            "use collision 'sdf' or 'off'",
        )

"""A whole right leg: four bones, three joints, ten muscles, of which four cross two joints."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.coordinates import checked_poses
from vtkmuscle.phantoms.hip_bones import HEAD_RADIUS
from vtkmuscle.phantoms.hip_joint import CUT, hip_parts
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.leg_bones import ANKLE, KNEE, femur, foot, tibia
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, phantom_from

#: The joints: parent, child, a point on the axis [mm], and the axis that the coordinate turns about.
JOINTS = {
    "hip_flexion": ("pelvis", "femur", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    "knee_flexion": ("femur", "tibia", KNEE, (1.0, 0.0, 0.0)),
    "ankle_dorsiflexion": ("tibia", "foot", ANKLE, (-1.0, 0.0, 0.0)),
}
#: Least and largest angles [degrees].
LIMITS = {"hip_flexion": (-20.0, 90.0), "knee_flexion": (0.0, 90.0), "ankle_dorsiflexion": (-30.0, 20.0)}
#: Left free between a cord and the bones that it passes [mm].
GAP = 1.0

_Knots = list[tuple[float, float, float]]
#: The muscles that are cords: bones of origin and insertion, the middle line, and radii along it [mm].
CORDS: dict[str, tuple[str, str, _Knots, list[float]]] = {
    "rectus_femoris": (
        *("pelvis", "tibia"),
        [
            (-27, -44, 40),
            (-40, -52, -50),
            (-36, -46, -190),
            (-22, -42, -310),
            (-14, -36, -400),
            (-14, -37, -440),
            (-14, -29, -474),
        ],
        [6.0, 11.0, 14.0, 9.0, 5.5, 5.0, 5.0],
    ),
    "vastus": (
        *("femur", "tibia"),
        [
            (-48, -18, -120),
            (-42, -22, -230),
            (-26, -26, -330),
            (-14, -23, -400),
            (-14, -24, -440),
            (-14, -22, -462),
        ],
        [7.0, 11.0, 10.0, 5.5, 5.0, 4.5],
    ),
    "biceps_femoris": (
        *("pelvis", "tibia"),
        [
            (20, 46, -84),
            (-10, 52, -190),
            (-34, 46, -310),
            (-40, 40, -405),
            (-40, 34, -460),
            (-36, 21, -490),
        ],
        [7.0, 14.0, 12.0, 7.0, 6.0, 5.0],
    ),
    "semitendinosus": (
        *("pelvis", "tibia"),
        [
            (36, 42, -88),
            (30, 52, -190),
            (22, 48, -310),
            (12, 42, -405),
            (12, 34, -460),
            (9, 20, -490),
        ],
        [6.5, 12.0, 11.0, 6.5, 6.0, 5.0],
    ),
    "gastrocnemius": (
        *("femur", "foot"),
        [
            (-18, 31, -384),
            (-16, 50, -450),
            (-14, 54, -540),
            (-14, 46, -680),
            (-14, 52, -790),
            (-14, 66, -828),
        ],
        [6.5, 12.0, 13.0, 7.0, 5.5, 5.0],
    ),
    "soleus": (
        *("tibia", "foot"),
        [
            (-26, 26, -520),
            (-32, 32, -590),
            (-28, 34, -680),
            (-22, 40, -770),
            (-22, 60, -824),
        ],
        [7.0, 12.0, 10.0, 5.5, 4.5],
    ),
    "tibialis_anterior": (
        *("tibia", "foot"),
        [
            (-26, -16, -520),
            (-32, -18, -600),
            (-26, -16, -700),
            (-16, -14, -780),
            (-14, -24, -815),
            (-14, -44, -826),
        ],
        [6.0, 10.0, 8.5, 5.0, 4.5, 4.0],
    ),
}


def leg(*, coordinates: ArrayLike | None = None) -> Phantom:
    """Return a right leg: pelvis, femur, tibia and foot, three hinges, and ten muscles.

    The frame and the three muscles of the hip are those of :func:`~vtkmuscle.phantoms.hip`. The other muscles
    are cords: ``rectus_femoris`` and ``vastus`` over the front of the knee, ``biceps_femoris`` and
    ``semitendinosus`` behind it, ``gastrocnemius``, ``soleus`` and ``tibialis_anterior`` over the ankle. The
    knee is a roller; there is neither patella nor fibula.

    Parameters
    ----------
    coordinates : (k, 3) array_like, optional
        Flexion of the hip, -20 to 90, and of the knee, 0 to 90, and dorsiflexion of the ankle, -30 to 20, at
        each frame [degrees]. Default: all three bend evenly from 0, to 60, 90 and 15.

    Returns
    -------
    Phantom
        Its motion's times are the numbers of the frames. Known answers: ``known["coordinates"]``, by name,
        their values at each frame [degrees]; ``known["centres"]``, a point on the axis of each [mm];
        ``known["head_radius"]`` [mm].

    Raises
    ------
    ValueError
        If coordinates are no triples of numbers, or are out of range.

    Examples
    --------
    >>> from vtkmuscle.phantoms import leg
    >>> walking = leg(coordinates=[(0, 0, 0), (30, 10, 0)])
    >>> len(walking.muscles), walking.known["coordinates"]["hip_flexion"].tolist()
    (10, [0.0, 30.0])
    """
    given = np.outer(np.linspace(0.0, 1.0, 13), (60.0, 90.0, 15.0)) if coordinates is None else coordinates
    poses = checked_poses(given, LIMITS, "leg")
    bones, muscles, areas = _parts()
    transforms: dict[str, list[Floats]] = {child: [] for _, child, _, _ in JOINTS.values()}
    for pose in poses:
        now = np.eye(4)
        for (_, child, centre, axis), angle in zip(JOINTS.values(), pose, strict=True):
            now = now @ rotation_about(centre, axis, angle)
            transforms[child].append(now)
    moved = {bone: np.array(tables) for bone, tables in transforms.items()}
    return phantom_from(
        "leg",
        bones=bones,
        muscles=muscles,
        areas=areas,
        motion=RigidMotion(np.arange(float(len(poses))), moved),
        templates=dict.fromkeys(muscles, "parallel"),
        known={
            "coordinates": {name: column.copy() for name, column in zip(JOINTS, poses.T, strict=True)},
            "centres": {name: np.array(centre) for name, (_, _, centre, _) in JOINTS.items()},
            "head_radius": HEAD_RADIUS,
        },
    )


@cache
def _parts() -> tuple[dict[str, Surface], dict[str, Surface], dict[str, list[AttachmentArea]]]:
    hip_bones, muscles, areas = hip_parts()
    solids = {"femur": femur(), "tibia": tibia(), "foot": foot()}
    bones = {"pelvis": hip_bones["pelvis"]}
    for (name, solid), count in zip(solids.items(), (7000, 4000, 3000), strict=True):
        bones[name] = mesh_of(solid, 4.0, count)
    muscles, areas = dict(muscles), dict(areas)
    for name, (origin, insertion, knots, radii) in CORDS.items():
        line, thickness = np.array(knots, dtype=np.float64), np.array(radii)
        muscles[name] = mesh_of(_beside(thick_curve(line, thickness), list(solids.values())), 2.5, 2000)
        areas[name] = [
            AttachmentArea("origin", origin, _end_ring(line, thickness), closed=True),
            AttachmentArea("insertion", insertion, _end_ring(line[::-1], thickness[::-1]), closed=True),
        ]
    return bones, muscles, areas


def _beside(cord: Solid, bones: list[Solid]) -> Solid:
    for bone in bones:
        cord = cord.without(bone, CUT, gap=GAP)
    return cord


def _end_ring(line: Floats, radii: Floats) -> Floats:
    """Return landmarks (12, 3) round the start of a cord [mm]."""
    along = line[1] - line[0]
    along /= np.linalg.norm(along)
    side = np.cross(along, (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    turns = 2.0 * np.pi * np.arange(12)[:, None] / 12
    ring: Floats = line[0] + radii[0] * (np.cos(turns) * side + np.sin(turns) * np.cross(along, side))
    return ring

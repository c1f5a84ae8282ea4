"""A whole right leg: four bones, three joints, ten muscles, of which four cross two joints."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.hip_bones import ANKLE, HEAD_RADIUS, KNEE, foot, pelvis, tibia, whole_femur
from vtkmuscle.phantoms.hip_joint import CUT, HipShape, hip_parts
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, checked_poses, ends, phantom_from

#: The joints: parent, child, a point on the axis [mm], and the axis that the coordinate turns about.
JOINTS = {
    "hip_flexion": ("pelvis", "femur", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    "knee_flexion": ("femur", "tibia", KNEE, (1.0, 0.0, 0.0)),
    "ankle_dorsiflexion": ("tibia", "foot", ANKLE, (-1.0, 0.0, 0.0)),
}
#: Least and largest angles [degrees].
LIMITS = {"hip_flexion": (-20.0, 90.0), "knee_flexion": (0.0, 90.0), "ankle_dorsiflexion": (-30.0, 20.0)}
#: Left free between a cord and the bones [mm].
GAP = 0.2
#: Height of a cord's end above its bone, as a part of its radius: what is below is cut off.
SUNK = 0.2

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
            (-42, 40, -400),
            (-46, 30, -438),
            (-47, 18, -464),
        ],
        [7.0, 14.0, 12.0, 7.0, 6.0, 5.0],
    ),
    "semitendinosus": (
        *("pelvis", "tibia"),
        [
            (36, 42, -88),
            (30, 52, -190),
            (22, 48, -310),
            (14, 42, -400),
            (18, 30, -438),
            (19, 18, -464),
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
    hip_bones, muscles, areas = hip_parts(HipShape(), 1.0)
    solids = {"femur": whole_femur(), "tibia": tibia(), "foot": foot()}
    bones = {"pelvis": hip_bones["pelvis"]}
    for (name, solid), count in zip(solids.items(), (7000, 4000, 3000), strict=True):
        bones[name] = mesh_of(solid, 4.0, count)
    muscles, areas = dict(muscles), dict(areas)
    solids = {"pelvis": pelvis(), **solids}
    for name, (origin, insertion, knots, radii) in CORDS.items():
        line = np.array(knots, dtype=np.float64)
        rings = []
        for end, bone in ((0, origin), (-1, insertion)):
            line[end], ring = _on(solids[bone], line[end], radii[end])
            rings.append(ring)
        cord = _beside(thick_curve(line, radii), list(solids.values()))
        muscles[name] = mesh_of(cord, 3.4, 2400)
        areas[name] = ends(origin, rings[0], insertion, rings[1])
    return bones, muscles, areas


def _beside(cord: Solid, bones: list[Solid]) -> Solid:
    for bone in bones:
        cord = cord.without(bone, CUT, gap=GAP)
    return cord


def _on(bone: Solid, knot: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return where a cord ends on a bone near a knot (3,), and landmarks (12, 3) about it there [mm]."""
    ground = bone.projected(knot[None], steps=6)
    normal = bone.field(ground)[1][0]
    normal /= np.linalg.norm(normal)
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    side /= np.linalg.norm(side)
    turns = 2.0 * np.pi * np.arange(12)[:, None] / 12
    ring = ground + 0.8 * radius * (np.cos(turns) * side + np.sin(turns) * np.cross(normal, side))
    return ground[0] + SUNK * radius * normal, bone.projected(ring, steps=6)

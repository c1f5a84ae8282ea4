"""A right leg: four bones, three joints, ten muscles, four of them over two joints."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import RigidMotion, frame_at, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.joints.functions import IDENTITY
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.phantoms.hip_joint import HEAD_RADIUS, beside_bones, hip_parts, pelvis, upper_femur
from vtkmuscle.phantoms.implicit import Solid, ball, rod, thick_curve, union
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, circle, ends, phantom_from

#: A point on the axis of each joint; all axes run across the leg.
KNEE, ANKLE = (-14.0, 8.0, -412.0), (-14.0, 12.0, -806.0)
#: Radii of the rollers in place of condyles and talus.
CONDYLE, TALUS = 21.0, 12.0
#: The joints: parent, child, a point on the axis [mm], and the axis.
JOINTS = {
    "hip_flexion": ("pelvis", "femur", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    "knee_flexion": ("femur", "tibia", KNEE, (1.0, 0.0, 0.0)),
    "ankle_dorsiflexion": ("tibia", "foot", ANKLE, (-1.0, 0.0, 0.0)),
}
#: Least and largest angles [degrees].
LIMITS = {"hip_flexion": (-20.0, 90.0), "knee_flexion": (0.0, 90.0), "ankle_dorsiflexion": (-30.0, 20.0)}
#: Height of a cord's end above the bone, as a part of the radius; the part below is cut off.
SUNK = 0.2

_Row = list[float]
#: Cord-shaped muscles: bones of origin and insertion; x, y, z and radius along the middle line [mm].
CORDS: dict[str, tuple[str, str, _Row, _Row, _Row, _Row]] = {
    "rectus_femoris": (
        *("pelvis", "tibia"),
        [-27, -40, -36, -22, -14, -14, -14],
        [-44, -52, -46, -42, -36, -37, -29],
        [40, -50, -190, -310, -400, -440, -474],
        [6.0, 11.0, 14.0, 9.0, 5.5, 5.0, 5.0],
    ),
    "vastus": (
        *("femur", "tibia"),
        [-48, -42, -26, -14, -14, -14],
        [-18, -22, -26, -23, -24, -22],
        [-120, -230, -330, -400, -440, -462],
        [7.0, 11.0, 10.0, 5.5, 5.0, 4.5],
    ),
    "biceps_femoris": (
        *("pelvis", "tibia"),
        [20, -10, -34, -42, -46, -47],
        [46, 52, 46, 40, 30, 18],
        [-84, -190, -310, -400, -438, -464],
        [7.0, 14.0, 12.0, 7.0, 6.0, 5.0],
    ),
    "semitendinosus": (
        *("pelvis", "tibia"),
        [36, 30, 22, 14, 18, 19],
        [42, 52, 48, 42, 30, 18],
        [-88, -190, -310, -400, -438, -464],
        [6.5, 12.0, 11.0, 6.5, 6.0, 5.0],
    ),
    "gastrocnemius": (
        *("femur", "foot"),
        [-18, -16, -14, -14, -14, -14],
        [31, 50, 54, 46, 52, 66],
        [-384, -450, -540, -680, -790, -828],
        [6.5, 12.0, 13.0, 7.0, 5.5, 5.0],
    ),
    "soleus": (
        *("tibia", "foot"),
        [-26, -32, -28, -22, -22],
        [26, 32, 34, 40, 60],
        [-520, -590, -680, -770, -824],
        [7.0, 12.0, 10.0, 5.5, 4.5],
    ),
    "tibialis_anterior": (
        *("tibia", "foot"),
        [-26, -32, -26, -16, -14, -14],
        [-16, -18, -16, -14, -24, -44],
        [-520, -600, -700, -780, -815, -826],
        [6.0, 10.0, 8.5, 5.0, 4.5, 4.0],
    ),
}


def leg(*, coordinates: ArrayLike | None = None) -> Phantom:
    """Return a right leg: pelvis, femur, tibia and foot, three hinges, and ten muscles.

    The frame and the three muscles of the hip are those of :func:`~vtkmuscle.phantoms.hip`. The other muscles
    are cords: ``rectus_femoris`` and ``vastus`` over the front of the knee, ``biceps_femoris`` and
    ``semitendinosus`` behind it, ``gastrocnemius``, ``soleus`` and ``tibialis_anterior`` over the ankle. The
    knee is a roller, without patella and fibula.

    Parameters
    ----------
    coordinates : (k, 3) array_like, optional
        Flexion of the hip, -20 to 90, and of the knee, 0 to 90, and dorsiflexion of the ankle, -30 to 20, at
        each frame [degrees]. Default: all three bend evenly from 0, to 60, 90 and 15.

    Returns
    -------
    Phantom
        The motion's times are frame numbers. Known answers: ``known["coordinates"]``, by name,
        their values at each frame [degrees]; ``known["centres"]``, a point on the axis of each [mm];
        ``known["head_radius"]`` [mm].

    Examples
    --------
    >>> from leg import leg
    >>> walking = leg(coordinates=[(0, 0, 0), (30, 10, 0)])
    >>> len(walking.muscles), walking.known["coordinates"]["hip_flexion"].tolist()
    (10, [0.0, 30.0])
    """
    if coordinates is None:
        coordinates = np.outer(np.linspace(0.0, 1.0, 13), (60.0, 90.0, 15.0))
    poses = np.array(coordinates, dtype=np.float64)
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
        known={
            "coordinates": {name: column.copy() for name, column in zip(JOINTS, poses.T, strict=True)},
            "centres": {name: np.array(centre) for name, (_, _, centre, _) in JOINTS.items()},
            "head_radius": HEAD_RADIUS,
        },
    )


@cache
def _parts() -> tuple[dict[str, Surface], dict[str, Surface], dict[str, list[AttachmentArea]]]:
    hip_bones, muscles, areas = hip_parts(HEAD_RADIUS, 1.0)
    solids = {"pelvis": pelvis(), "femur": whole_femur(), "tibia": tibia(), "foot": foot()}
    counts = {"femur": 7000, "tibia": 4000, "foot": 3000}
    bones = {"pelvis": hip_bones["pelvis"]}
    bones |= {name: mesh_of(solids[name], 4.0, count) for name, count in counts.items()}
    muscles, areas = dict(muscles), dict(areas)
    for name, (origin, insertion, *line, radii) in CORDS.items():
        knots = np.column_stack(line).astype(np.float64)
        knots[0], first = _end_on(solids[origin], knots[0], radii[0])
        knots[-1], last = _end_on(solids[insertion], knots[-1], radii[-1])
        cord = beside_bones(thick_curve(knots, radii), *solids.values())
        muscles[name] = mesh_of(cord, 3.4, 2400)
        areas[name] = ends(origin, first, insertion, last)
    return bones, muscles, areas


def _end_on(bone: Solid, knot: Floats, radius: float) -> tuple[Floats, Floats]:
    """Return the end (3,) of a cord on a bone near a knot, and landmarks (12, 3) about it there [mm]."""
    ground = bone.projected(knot[None], steps=6)
    normal = bone.field(ground)[1][0]
    normal /= np.linalg.norm(normal)
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    side /= np.linalg.norm(side)
    ring = ground + circle(0.8 * radius) @ np.array([side, np.cross(normal, side), normal])
    return ground[0] + SUNK * radius * normal, bone.projected(ring, steps=6)


def whole_femur() -> Solid:
    """Return a femur that ends in a roller about the axis of the knee."""
    shaft = thick_curve([(-32, 5, -235), (-24, 2, -300), (-16, 4, -370), (-14, 8, -398)], [14.5, 14, 17, 19])
    x, y, z = KNEE
    condyles = rod((x - 27, y, z), (x + 27, y, z), CONDYLE, rim=4.0)
    return union([upper_femur(), shaft, condyles], 10.0)


def tibia() -> Solid:
    """Return a tibia, flat above and below, with the tuberosity in front."""
    x, _, top = KNEE
    shaft = thick_curve([(x, 10, -452), (x, 6, -500), (x, 4, -600), (x, 10, -785)], [28, 19, 14, 15])
    whole = union([shaft, ball((x, -14, -476), 9.0)], 8.0)
    plateau = whole.cut_by((0, 0, top - CONDYLE - 2.0), (0, 0, 1), 3.0)
    return plateau.cut_by((0, 0, ANKLE[2] + TALUS + 2.0), (0, 0, -1), 2.0)


def foot() -> Solid:
    """Return a foot: the talus, a roller about the axis of the ankle; the heel; and the forefoot."""
    x, y, z = ANKLE
    talus = rod((x - 18, y, z), (x + 18, y, z), TALUS, rim=3.0)
    heel = thick_curve([(x, 14, -822), (x, 48, -836)], [13, 12])
    front = thick_curve([(x, 8, -826), (x, -50, -842), (x, -110, -852)], [13, 11, 8])
    return union([talus, heel, front], 8.0)


def leg_tree() -> KinematicTree:
    """Return the joints of :func:`leg` in metres.

    Examples
    --------
    >>> from leg import leg_tree
    >>> leg_tree().bodies
    ('pelvis', 'femur', 'tibia', 'foot')
    """
    joints = []
    for name, (parent, child, centre, axis) in JOINTS.items():
        place = frame_at(np.array(centre) / 1000.0)
        turn = JointAxis(np.array(axis), IDENTITY, name)
        joints.append(Joint(f"{child}_joint", parent, child, [turn], (), place, place))
    limits = {name: (float(np.radians(low)), float(np.radians(high))) for name, (low, high) in LIMITS.items()}
    coordinates = [JointCoordinate(name, range=limits[name]) for name in JOINTS]
    return KinematicTree("pelvis", joints, coordinates)

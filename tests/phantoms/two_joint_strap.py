"""A strap over two joints, with a known moment arm about each."""

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from phantoms.planar import flexed
from phantoms.straps import block, end_ring, strap
from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import rod, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Radii of the rollers about the upper and the lower joint, thickness and width of the strap [mm].
RADII, THICKNESS, WIDTH = (22.0, 14.0), 8.0, 26.0
#: Radii that the middle of the strap runs round at [mm]: the moment arms.
ARMS = tuple(radius + THICKNESS / 2.0 for radius in RADII)
#: Lengths of the strap's straight parts: above, between and below the joints [mm].
PARTS = (70.0, 100.0, 60.0)
#: How far round each roller the strap lies at rest [degrees].
WRAPS = (60.0, 20.0)
AXIS = (-1.0, 0.0, 0.0)
#: The lower joint where the strap is straight (y, z); the upper one is at the origin [mm].
LOWER = np.array([ARMS[1] - ARMS[0], -PARTS[1]])
#: The loop of the default motion: (upper, lower) at its corners, and its steps [degrees].
CORNERS = ((0.0, 0.0), (50.0, 0.0), (50.0, 60.0), (0.0, 60.0), (0.0, 0.0))
STEP = 5.0


def strap_over_two_joints(*, coordinates: ArrayLike | None = None) -> Phantom:
    """Return a strap in front of two hinges, which flexes the upper and extends the lower one.

    Like the rectus femoris: from ``proximal`` over a roller about the upper joint, down in front of
    ``middle``, over a roller about the lower joint, to ``distal``. It lies on both rollers at every pose. The
    coordinate ``upper`` is flexion of ``middle`` to the front, which unwinds the strap from the upper
    roller; ``lower`` is flexion of ``distal`` against ``middle`` to the back, which winds it up on the lower
    one.

    Times are frame numbers. Known: ``coordinates`` by name at each frame [degrees]; ``length(upper, lower)``
    of the strap's middle line [mm]; ``moment_arm_upper``, 26 mm, and ``moment_arm_lower``, -18 mm, at every
    pose; ``centres``, points on both axes at rest [mm].
    """
    poses = np.array(_loop() if coordinates is None else coordinates, dtype=np.float64)
    bones, muscle = _surfaces()
    line = _middle_line()
    transforms = [_transforms(*pose) for pose in poses]
    upper = end_ring(line[0], (0, -1), WIDTH, THICKNESS)
    lower = end_ring(line[-1], line[-1] - line[-2], WIDTH, THICKNESS)
    return phantom_from(
        "strap_over_two_joints",
        bones=bones,
        muscles={"strap": muscle},
        areas={"strap": ends("proximal", upper, "distal", lower)},
        motion=RigidMotion(
            np.arange(float(len(poses))),
            {bone: np.array([table[bone] for table in transforms]) for bone in ("middle", "distal")},
        ),
        known={
            "coordinates": {"upper": poses[:, 0].copy(), "lower": poses[:, 1].copy()},
            "length": strap_length,
            "moment_arm_upper": ARMS[0],
            "moment_arm_lower": -ARMS[1],
            "centres": {"upper": np.zeros(3), "lower": np.array([0.0, *flexed(LOWER, -WRAPS[0])])},
        },
    )


def strap_length(upper: float, lower: float) -> float:
    """Return the length of the strap's middle line [mm] at angles [degrees] that it wraps both rollers at."""
    return sum(PARTS) + float(np.array(ARMS) @ np.radians([WRAPS[0] - upper, WRAPS[1] + lower]))


def _loop() -> Floats:
    """Return angles (k, 2) round the corners of the default motion."""
    corners = np.array(CORNERS)
    sides = []
    for start, end in pairwise(corners):
        count = round(float(np.abs(end - start).max()) / STEP)
        sides.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.vstack([*sides, corners[-1:]])


def _transforms(upper: float, lower: float) -> dict[str, Floats]:
    """Return the transforms of both bones that move, rest to pose."""
    middle = rotation_about((0, 0, 0), AXIS, upper)
    hinge = flexed(LOWER, -WRAPS[0])
    return {"middle": middle, "distal": middle @ rotation_about((0.0, *hinge), AXIS, -lower)}


def _middle_line() -> Floats:
    """Return the middle line at rest (k, 2): three straight parts and two arcs."""
    first = [flexed((-ARMS[0], 0), -turn) for turn in np.linspace(0.0, WRAPS[0], 121)]
    second = [LOWER + flexed((-ARMS[1], 0), -turn) for turn in np.linspace(0.0, WRAPS[1], 41)]
    second.append(LOWER + flexed((-ARMS[1], -PARTS[2]), -WRAPS[1]))
    return np.array([(-ARMS[0], PARTS[0]), *first, *(flexed(point, -WRAPS[0]) for point in second)])


@cache
def _surfaces() -> tuple[dict[str, Surface], Surface]:
    """Return bones and strap at rest: made where the strap is straight, and turned about the joints."""
    half = WIDTH / 2.0 + 6.0
    front = -(ARMS[0] + THICKNESS / 2.0 + 6.0)
    y, z = LOWER
    rollers = [
        rod((-half, *centre), (half, *centre), radius)
        for centre, radius in zip(np.array([(0.0, 0.0), LOWER]), RADII, strict=True)
    ]
    top = block((-half, front, PARTS[0]), (half, 10, PARTS[0] + 20))
    proximal = rollers[0].joined(thick_curve([(0, 4, 0), (0, 4, PARTS[0] + 6)], [9.0, 9.0]), 3.0)
    middle = rollers[1].joined(thick_curve([(0, y + 2, z), (0, 2, -36)], [7.0, 8.0]), 3.0)
    foot = z - PARTS[2]
    bottom = block((-half, front, foot - 20), (half, y + 10, foot))
    distal = bottom.joined(thick_curve([(0, y, z - 27), (0, y, foot - 8)], [8.0, 8.0]), 3.0)
    turn = rotation_about((0, 0, 0), AXIS, -WRAPS[0])
    turns = {
        "proximal": np.eye(4),
        "middle": turn,
        "distal": turn @ rotation_about((0.0, y, z), AXIS, -WRAPS[1]),
    }
    solids = {"proximal": proximal.joined(top, 3.0), "middle": middle, "distal": distal}
    bones = {}
    for name, solid in solids.items():
        points, triangles = mesh_of(solid, 2.2, 4500)
        bones[name] = (apply_transform(turns[name], points), triangles)
    return bones, mesh_of(strap(_middle_line(), WIDTH, THICKNESS), 2.0, 3600)

"""A spindle over a ball joint, in two coordinates."""

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.one_hinge import spindle
from vtkmuscle.phantoms.phantom import Phantom, phantom_from

#: Centres of the muscle's flat ends [mm]: in front of the joint, which is at the origin, and to its left.
ORIGIN = np.array([12.0, -32.0, 80.0])
INSERTION = np.array([12.0, -32.0, -60.0])
#: Axis of flexion, which stays, and that of abduction, which flexion carries along.
FLEXION, ABDUCTION = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
#: Angles of the default motion's net [degrees].
FLEXIONS, ABDUCTIONS = np.arange(0.0, 41.0, 10.0), np.arange(-20.0, 21.0, 10.0)


def spindle_over_ball(*, coordinates: ArrayLike | None = None) -> Phantom:
    """Return two bones joined at a ball joint, and a spindle from one to the other, beside both axes.

    The bones are those of :func:`spindle_over_hinge`, and so is the muscle, but that it lies 12 mm to the
    left as well. ``distal`` turns by flexion about -x, to the front, after abduction about y, to the right,
    away from the muscle: R = R(-x, flexion) R(y, abduction). No bone is in the way of the straight line.

    Times are frame numbers. Known: ``coordinates`` by name at each frame [degrees]; of the straight line
    between the centres of the attachments ``length(flexion, abduction)``, and ``moment_arm_flexion`` and
    ``moment_arm_abduction`` of both angles, -dl/dq by each [mm].
    """
    poses = np.array(_net() if coordinates is None else coordinates, dtype=np.float64)
    bones, muscle, areas = spindle((float(ORIGIN[0]), float(ORIGIN[1])))
    return phantom_from(
        "spindle_over_ball",
        bones=bones,
        muscles={"spindle": muscle},
        areas={"spindle": areas},
        motion=RigidMotion(
            np.arange(float(len(poses))), {"distal": np.array([turned(*pose) for pose in poses])}, np.zeros(3)
        ),
        known={
            "coordinates": {"flexion": poses[:, 0].copy(), "abduction": poses[:, 1].copy()},
            "length": line_length,
            "moment_arm_flexion": flexion_moment_arm,
            "moment_arm_abduction": abduction_moment_arm,
        },
    )


def turned(flexion: float, abduction: float) -> Floats:
    """Return the transform of the distal bone (4, 4) at angles [degrees]."""
    return rotation_about((0, 0, 0), FLEXION, flexion) @ rotation_about((0, 0, 0), ABDUCTION, abduction)


def line_length(flexion: float, abduction: float) -> float:
    """Return the distance of the attachments' centres [mm] at angles [degrees]."""
    return float(np.linalg.norm(_insertion(flexion, abduction) - ORIGIN))


def flexion_moment_arm(flexion: float, abduction: float) -> float:
    """Return -dl/dq of the straight line by flexion [mm]: the lever of its pull about the axis."""
    return _lever(FLEXION, _insertion(flexion, abduction))


def abduction_moment_arm(flexion: float, abduction: float) -> float:
    """Return -dl/dq of the straight line by abduction [mm], about the axis that flexion carries along."""
    axis = apply_transform(rotation_about((0, 0, 0), FLEXION, flexion), ABDUCTION[None])[0]
    return _lever(axis, _insertion(flexion, abduction))


def _lever(axis: Floats, insertion: Floats) -> float:
    pull = (ORIGIN - insertion) / np.linalg.norm(ORIGIN - insertion)
    return float(np.cross(axis, insertion) @ pull)


def _insertion(flexion: float, abduction: float) -> Floats:
    moved: Floats = apply_transform(turned(flexion, abduction), INSERTION[None])[0]
    return moved


def _net() -> Floats:
    """Return angles (k, 2): rest, abduction to its least, and from there row by row and back."""
    rows = [[(f, a) for a in ABDUCTIONS[:: 1 if i % 2 == 0 else -1]] for i, f in enumerate(FLEXIONS)]
    start = [(0.0, a) for a in ABDUCTIONS[ABDUCTIONS <= 0.0][:0:-1]]
    return np.array([*start, *(pose for row in rows for pose in row)])

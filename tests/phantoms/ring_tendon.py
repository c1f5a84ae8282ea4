"""A muscle whose tendon is held by a ring, in front of a joint that bends away from it."""

from functools import cache

import numpy as np

from phantoms.cords import cord
from phantoms.planar import flexed, in_space
from phantoms.straps import round_ring
from phantoms.taut_string import lever
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import VIA, AttachmentArea
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.one_hinge import bone_with_arm
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Centres of the muscle's flat ends (y, z) [mm]; the hinge is at the origin, its axis -x.
ORIGIN, INSERTION = np.array([-32.0, 80.0]), np.array([-32.0, -60.0])
#: Centre of the ring (y, z), and how far its sides are from it [mm].
RING, HALF = np.array([-32.0, 8.0]), 6.0
#: Radii of the muscle, evenly from its origin to its insertion [mm]; the last ones are the tendon's.
RADII = (6.0, 10.0, 11.0, 7.0, 3.5, 3.5, 3.5, 3.5, 3.5)
TENDON = RADII[-1]


def tendon_through_ring() -> Phantom:
    """Return a muscle in front of a hinge, whose tendon passes through a ring just above the joint.

    Like a tendon under a retinaculum: without the ring it bowstrings across the joint, which flexes from 0 to
    60 degrees, to the front. The ring is a regular octagon across z, of six mm from its centre to each side,
    and moves with the bone of the origin, ``proximal``. At rest the muscle is straight, and its middle line
    passes through the ring's centre.

    Known of the middle line of a tendon that stays ``clearance`` away from the ring's sides, 0 to 6 mm:
    ``length(angle, clearance)`` of its taut path, straight while within the ring, else bent at the middle of
    the front side, and ``moment_arm(angle, clearance)``; ``tendon_radius`` is the clearance of the tendon's
    middle as a solid, ``straight_moment_arm(angle)`` is that without the ring [mm].
    """
    bones, muscle = _surfaces()
    turns = 2.0 * np.pi * (np.arange(8) + 0.5) / 8
    octagon = HALF / np.cos(np.pi / 8) * np.column_stack([np.cos(turns), np.sin(turns), np.zeros(8)])
    rings = round_ring(ORIGIN, (0, -1), 0.8 * RADII[0]), round_ring(INSERTION, (0, -1), 0.8 * TENDON)
    via = AttachmentArea(VIA, "proximal", in_space(RING[None]) + octagon, closed=True)
    return phantom_from(
        "tendon_through_ring",
        bones=bones,
        muscles={"muscle": muscle},
        areas={"muscle": [*ends("proximal", rings[0], "distal", rings[1]), via]},
        motion=hinge("distal", centre=(0, 0, 0), axis=(-1, 0, 0), angles=np.arange(0.0, 61.0, 2.0)),
        known={
            "length": held_length,
            "moment_arm": held_moment_arm,
            "straight_moment_arm": straight_moment_arm,
            "tendon_radius": TENDON,
        },
    )


def held_length(angle: float, clearance: float = 0.0) -> float:
    """Return the length of the middle line [mm], held by the ring where the straight way leaves it."""
    return float(np.linalg.norm(np.diff(_way(angle, clearance), axis=0), axis=1).sum())


def held_moment_arm(angle: float, clearance: float = 0.0) -> float:
    """Return -dl/dq [mm]: the lever of the pull from the insertion to the last point that stays."""
    return _lever(_way(angle, clearance))


def straight_moment_arm(angle: float) -> float:
    """Return -dl/dq of the straight line from end to end [mm]."""
    return _lever(np.array([ORIGIN, flexed(INSERTION, angle)]))


def _way(angle: float, clearance: float) -> Floats:
    """Return the corners (2 or 3, 2) of the taut way: its shortest length is convex in where it crosses."""
    end = flexed(INSERTION, angle)
    crossing = ORIGIN + ((ORIGIN[1] - RING[1]) / (ORIGIN[1] - end[1])) * (end - ORIGIN)
    allowed = HALF - clearance
    if abs(crossing[0] - RING[0]) <= allowed:
        return np.array([ORIGIN, end])
    return np.array([ORIGIN, (RING + np.array([np.sign(crossing[0] - RING[0]) * allowed, 0.0])), end])


def _lever(corners: Floats) -> float:
    pull = corners[-2] - corners[-1]
    return lever(corners[-1], pull / np.linalg.norm(pull))


@cache
def _surfaces() -> tuple[dict[str, Surface], Surface]:
    upper, lower = in_space([ORIGIN, INSERTION])
    bones = {
        "proximal": mesh_of(bone_with_arm(upper, 1.0), 3.0, 3000),
        "distal": mesh_of(bone_with_arm(lower, -1.0), 3.0, 3000),
    }
    return bones, mesh_of(cord(np.array([ORIGIN, INSERTION]), RADII), 1.6, 3000)

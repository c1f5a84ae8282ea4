"""A spindle muscle over a hinge: the simplest scene."""

from __future__ import annotations

from functools import cache

import numpy as np

from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of, solid_of_revolution, volume_of_revolution
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, one_muscle, round_ring

#: Centres of the muscle's flat ends [mm]; the hinge is at the origin, its axis -x.
ORIGIN = np.array([0.0, -32.0, 80.0])
INSERTION = np.array([0.0, -32.0, -60.0])
AXIS = np.array([-1.0, 0.0, 0.0])
#: Radii of the muscle at its ends and in its middle [mm].
END_RADIUS = 7.0
BELLY_RADIUS = 16.0
#: The muscle is a stack of slices, regular polygons: how many, and of how many sides.
SLICES = 42
SIDES = 24


def spindle_over_hinge() -> Phantom:
    """Return two bones joined at a hinge, and a spindle from one to the other.

    The bones stand one above the other along z; ``distal`` turns about an axis through the origin, towards
    the muscle, which lies 32 mm in front of the hinge. The muscle's flat ends lie on flat faces of both.

    Returns
    -------
    Phantom
        Known answers: ``known["volume"]`` [mm^3] of the muscle's mesh, which is that of the stack of
        polygons to rounding; ``known["length"](angle)`` [mm], the straight line between the centres of the
        attachments at a hinge angle [degrees], 140 mm at 0; ``known["moment_arm"](angle)`` [mm], its
        derivative -dl/dq by the angle in radians, 32 mm at 0.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> float(round(phantom.known["length"](0.0), 6)), float(round(phantom.known["moment_arm"](0.0), 6))
    (140.0, 32.0)
    """
    bones, muscle, areas = spindle((float(ORIGIN[0]), float(ORIGIN[1])))
    return one_muscle(
        "spindle_over_hinge",
        "spindle",
        muscle,
        areas,
        bones=bones,
        motion=hinge("distal", centre=(0, 0, 0), axis=AXIS, angles=np.arange(0.0, 41.0, 2.0)),
        known={
            "volume": volume_of_revolution(*spindle_profile(), SIDES),
            "length": line_length,
            "moment_arm": line_moment_arm,
        },
    )


def line_length(angle: float) -> float:
    """Return the distance of the attachments' centres [mm] at a hinge angle [degrees]."""
    return float(np.linalg.norm(_insertion(angle) - ORIGIN))


def line_moment_arm(angle: float) -> float:
    """Return -dl/dq of the straight line [mm] at a hinge angle [degrees]."""
    insertion = _insertion(angle)
    velocity = np.cross(AXIS, insertion)
    return float(-velocity @ (insertion - ORIGIN) / np.linalg.norm(insertion - ORIGIN))


def _insertion(angle: float) -> Floats:
    moved: Floats = apply_transform(rotation_about((0, 0, 0), AXIS, angle), INSERTION[None])[0]
    return moved


def spindle_profile() -> tuple[Floats, Floats]:
    """Return heights and radii, r = r_end + (r_belly - r_end) sin^2(pi s) for s in 0 ... 1 [mm]."""
    s = np.linspace(0.0, 1.0, SLICES + 1)
    radii = END_RADIUS + (BELLY_RADIUS - END_RADIUS) * np.sin(np.pi * s) ** 2
    return INSERTION[2] + s * (ORIGIN[2] - INSERTION[2]), radii


@cache
def spindle(middle: tuple[float, float]) -> tuple[dict[str, Surface], Surface, list[AttachmentArea]]:
    """Return bones, muscle and areas, the muscle about the vertical line through (x, y) [mm]."""
    origin, insertion = (np.array([*middle, end[2]]) for end in (ORIGIN, INSERTION))
    circle = round_ring(0.8 * END_RADIUS)
    bones = {
        "proximal": mesh_of(bone_with_arm(origin, 1.0), 3.0, 3000),
        "distal": mesh_of(bone_with_arm(insertion, -1.0), 3.0, 3000),
    }
    points, triangles = solid_of_revolution(*spindle_profile(), SIDES)
    areas = ends("proximal", origin + circle, "distal", insertion + circle)
    return bones, (points + np.array([*middle, 0.0]), triangles), areas


def bone_with_arm(attachment: Floats, up: float) -> Solid:
    """Return a shaft along z and an arm whose flat face carries the attachment."""
    arm_centre = attachment + np.array([0.0, 0.0, 7.0 * up])
    arm = thick_curve([arm_centre * [0, 0, 1], arm_centre], [13.0, 13.0])
    arm = arm.beside(attachment, (0, 0, -up), 1.0)
    shaft = thick_curve([(0, 0, 14 * up), (0, 0, attachment[2] + 50 * up)], [10.0, 11.0])
    return shaft.joined(arm, 4.0)

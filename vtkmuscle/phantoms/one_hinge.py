"""Muscles over a hinge: a spindle, the simplest scene, and a strap that a cylinder winds up."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.implicit import Solid, thick_curve, thick_sheet
from vtkmuscle.phantoms.meshing import box, mesh_of, solid_of_revolution, volume_of_revolution
from vtkmuscle.phantoms.phantom import Answer, Phantom, Surface, circle, ends, phantom_from

#: Centres of the spindle's flat ends [mm]; the hinge is at the origin, its axis -x.
ORIGIN = np.array([0.0, -32.0, 80.0])
INSERTION = np.array([0.0, -32.0, -60.0])
AXIS = np.array([-1.0, 0.0, 0.0])
#: Radii of the spindle at its ends and in its middle [mm].
END_RADIUS, BELLY_RADIUS = 7.0, 16.0
#: The spindle is a stack of slices, regular polygons: how many, and of how many sides.
SLICES, SIDES = 42, 24


def spindle_over_hinge() -> Phantom:
    """Return a spindle over two hinged bones.

    The bones stand one above the other along z; ``distal`` turns about an axis through the origin, towards
    the muscle. The muscle lies 32 mm in front of the hinge, from bone to bone, with flat ends on flat faces
    of both bones.

    Known answers: ``known["volume"]`` [mm^3] of the muscle's mesh, equal to the volume of the stack of
    polygons to rounding; ``known["length"](angle)`` [mm], the straight line between the centres of the
    attachments at a hinge angle [degrees], 140 mm at 0; ``known["moment_arm"](angle)`` [mm], the length's
    derivative -dl/dq by the angle in radians, 32 mm at 0.

    Examples
    --------
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> float(round(phantom.known["length"](0.0), 6)), float(round(phantom.known["moment_arm"](0.0), 6))
    (140.0, 32.0)
    """
    name, (bones, muscle, rings) = "spindle_over_hinge", spindle((float(ORIGIN[0]), float(ORIGIN[1])))
    motion = hinge("distal", centre=(0, 0, 0), axis=AXIS, angles=np.arange(0.0, 41.0, 2.0))
    answers: dict[str, Answer] = {"length": line_length, "moment_arm": line_moment_arm}
    answers["volume"] = volume_of_revolution(*spindle_profile(), SIDES)
    muscles, areas = {"spindle": muscle}, {"spindle": rings}
    return phantom_from(name, bones=bones, muscles=muscles, areas=areas, motion=motion, known=answers)


def line_length(angle: float) -> float:
    """Return the distance of the spindle's ends [mm] at an angle [degrees]."""
    return float(np.linalg.norm(_insertion(angle) - ORIGIN))


def line_moment_arm(angle: float) -> float:
    """Return -dl/dq of the straight line [mm] at an angle [degrees]."""
    insertion = _insertion(angle)
    return float(-np.cross(AXIS, insertion) @ (insertion - ORIGIN) / np.linalg.norm(insertion - ORIGIN))


def _insertion(angle: float) -> Floats:
    return np.asarray(apply_transform(rotation_about((0, 0, 0), AXIS, angle), INSERTION[None])[0])


def spindle_profile() -> tuple[Floats, Floats]:
    """Return heights and radii of the spindle. r_end + (r_belly - r_end) sin^2(pi s), s 0 to 1 [mm]."""
    s = np.linspace(0.0, 1.0, SLICES + 1)
    radii = END_RADIUS + (BELLY_RADIUS - END_RADIUS) * np.sin(np.pi * s) ** 2
    return INSERTION[2] + s * (ORIGIN[2] - INSERTION[2]), radii


@cache
def spindle(middle: tuple[float, float]) -> tuple[dict[str, Surface], Surface, list[AttachmentArea]]:
    """Return bones, muscle and areas about the vertical line through (x, y) [mm]."""
    origin, insertion = (np.array([*middle, end[2]]) for end in (ORIGIN, INSERTION))
    ring = circle(0.8 * END_RADIUS)
    arms = ("proximal", origin, 1.0), ("distal", insertion, -1.0)
    bones = {name: mesh_of(bone_with_arm(end, up), 3.0, 3000) for name, end, up in arms}
    points, triangles = solid_of_revolution(*spindle_profile(), SIDES)
    areas = ends("proximal", origin + ring, "distal", insertion + ring)
    return bones, (points + np.array([*middle, 0.0]), triangles), areas


def bone_with_arm(attachment: Floats, up: float) -> Solid:
    """Return a shaft along z with an arm, flat at the attachment."""
    arm_centre = attachment + np.array([0.0, 0.0, 7.0 * up])
    arm = thick_curve([arm_centre * [0, 0, 1], arm_centre], [13.0, 13.0])
    arm = arm.cut_by(attachment, (0, 0, -up), 1.0)
    return thick_curve([(0, 0, 14 * up), (0, 0, attachment[2] + 50 * up)], [10.0, 11.0]).joined(arm, 4.0)


#: Radius of the cylinder, thickness and width of the strap, length of its straight part [mm].
RADIUS, THICKNESS, WIDTH, STRAIGHT = 25.0, 10.0, 30.0, 80.0
#: How far round the cylinder the strap reaches at rest, and the part of that which is attached [degrees].
WRAPPED, ATTACHED = 110.0, 30.0
#: Least and largest angle of the cylinder [degrees]: below, the strap's free part touches the cylinder no
#: more; above, the strap's end comes near the strap's straight part.
UNWOUND, WOUND = ATTACHED - WRAPPED, 180.0


def wrapping_cylinder(*, angles: ArrayLike | None = None) -> Phantom:
    """Return a strap muscle over a turning cylinder.

    The cylinder winds up the strap from a fixed block. The cylinder ``pulley`` lies along the x axis and
    turns about the axis. The strap leaves the block ``base`` at y = -80 mm, runs straight to the top of the
    cylinder, lies on the cylinder over 110 degrees, and is attached over the last 30.

    Known answers: ``known["moment_arm"]`` [mm], 30 in size, at every allowed angle, is the radius of the
    cylinder and half the thickness of the strap, negative as the strap lengthens with the angle;
    ``known["length"](angle)`` [mm], the middle line from the block to the start of the attachment at an angle
    [degrees].

    Parameters
    ----------
    angles : (k,) array_like, optional
        Of the motion, ascending, from rest [degrees]: above 0 the strap is wound up, below 0 unwound.
        Default 0 to 40 by 2. Within -80 to 180: at -80 the free part of the strap leaves the cylinder.

    Raises
    ------
    ValueError
        If an angle is below -80 or above 180 degrees, or if angles do not ascend.

    Examples
    --------
    >>> from vtkmuscle.phantoms import wrapping_cylinder
    >>> wrapping_cylinder().known["moment_arm"]
    -30.0
    >>> wrapping_cylinder(angles=range(-60, 81, 2)).motion.times[[0, -1]].tolist()
    [-60.0, 80.0]
    """
    times = np.arange(0.0, 41.0, 2.0) if angles is None else np.asarray(angles, dtype=np.float64)
    outside = times[~((times >= UNWOUND) & (times <= WOUND))]
    if len(outside):
        problem = f"an angle is {outside[0]:g} degrees, but the strap lies on the cylinder"
        remedy = f"choose angles from {UNWOUND:g} to {WOUND:g}"
        raise InputError("wrapping_cylinder", f"{problem} from {UNWOUND:g} to {WOUND:g} only", remedy)
    bones, muscle = _cylinder_surfaces()
    # The strap's edges are round: landmarks lie on the flat part of its faces.
    half = (WIDTH - THICKNESS) / 2.0
    arc = _round_the_cylinder(np.linspace(WRAPPED - ATTACHED, WRAPPED, 7), RADIUS)
    side = np.array([half, 0.0, 0.0])
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    heights = RADIUS + THICKNESS / 2.0 * (1.0 + 0.7 * corners[:, 1])
    face = np.column_stack([half * corners[:, 0], np.full(len(corners), -STRAIGHT), heights])
    name, rings = "wrapping_cylinder", ends("base", face, "pulley", np.vstack([arc + side, arc[::-1] - side]))
    motion = hinge("pulley", centre=(0, 0, 0), axis=(-1, 0, 0), angles=times)
    answers: dict[str, Answer] = {"moment_arm": -(RADIUS + THICKNESS / 2.0), "length": strap_length}
    muscles, areas = {"strap": muscle}, {"strap": rings}
    return phantom_from(name, bones=bones, muscles=muscles, areas=areas, motion=motion, known=answers)


def strap_length(angle: float) -> float:
    """Return the strap's length to its attachment [mm] at an angle >= -80 degrees."""
    return STRAIGHT + (RADIUS + THICKNESS / 2.0) * float(np.radians(WRAPPED - ATTACHED + angle))


def _round_the_cylinder(angles: Floats, radius: float) -> Floats:
    turn = np.radians(angles)
    return radius * np.column_stack([np.zeros(len(turn)), np.sin(turn), np.cos(turn)])


@cache
def _cylinder_surfaces() -> tuple[dict[str, Surface], Surface]:
    middle = RADIUS + THICKNESS / 2.0
    straight = np.linspace(-STRAIGHT - THICKNESS, 0.0, 30, endpoint=False)
    flat = np.column_stack([np.zeros(30), straight, np.full(30, middle)])
    line = np.vstack([flat, _round_the_cylinder(np.linspace(0.0, WRAPPED, 25), middle)])
    knots = line[:, None, :] + (np.linspace(-1.0, 1.0, 3)[:, None] * [(WIDTH - THICKNESS) / 2.0, 0.0, 0.0])
    strap = thick_sheet(knots, np.full(knots.shape[:2], THICKNESS / 2.0), spacing=1.5)
    strap = strap.cut_by((0, -STRAIGHT, 0), (0, -1, 0), 1.0)
    length = WIDTH + 20.0
    heights = np.linspace(-length / 2.0, length / 2.0, 17)
    points, triangles = solid_of_revolution(heights, np.full(17, RADIUS), 48)
    bones = {"base": box((-25, -STRAIGHT - 20, 10), (25, -STRAIGHT, 50), 5.0)}
    bones["pulley"] = points[:, [2, 0, 1]], triangles  # from the z axis to the x axis
    return bones, mesh_of(strap, 2.5, 3000)

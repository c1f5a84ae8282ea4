"""A strap that wraps a cylindrical bone: the moment arm is known."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import thick_sheet
from vtkmuscle.phantoms.meshing import box, mesh_of, solid_of_revolution
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, one_muscle

#: Radius of the cylinder, thickness and width of the strap, length of its straight part [mm].
RADIUS = 25.0
THICKNESS = 10.0
WIDTH = 30.0
STRAIGHT = 80.0
#: How far round the cylinder the strap reaches at rest, and the part of that which is attached [degrees].
WRAPPED = 110.0
ATTACHED = 30.0
#: Least and largest angle of the cylinder [degrees]: below, the strap's free part touches the cylinder no
#: more; above, the strap's end comes near the strap's straight part.
UNWOUND, WOUND = ATTACHED - WRAPPED, 180.0


def wrapping_cylinder(*, angles: ArrayLike | None = None) -> Phantom:
    """Return a strap muscle from a fixed block over a cylinder that turns and winds it up.

    The cylinder ``pulley`` lies along the x axis and turns about it. The strap leaves the block ``base`` at
    y = -80 mm, runs straight to the top of the cylinder, lies on it over 110 degrees, and is attached over
    the last 30.

    Parameters
    ----------
    angles : (k,) array_like, optional
        Of the motion, ascending, from rest [degrees]: above 0 the strap is wound up, below it is unwound.
        Default 0 to 40 by 2. Within -80 to 180: at -80 the free part of the strap leaves the cylinder.

    Returns
    -------
    Phantom
        Known answers: ``known["moment_arm"]`` [mm], 30 in size, at every angle that is allowed, is the
        radius of the cylinder and half the thickness of the strap, negative as the strap lengthens with the
        angle; ``known["length"](angle)`` [mm], the middle line from the block to the start of the
        attachment at an angle [degrees].

    Raises
    ------
    ValueError
        If an angle is below -80 or above 180 degrees, or if they do not ascend.

    Examples
    --------
    Wound up as it comes, and unwound and wound over 140 degrees:

    >>> from vtkmuscle.phantoms import wrapping_cylinder
    >>> wrapping_cylinder().known["moment_arm"]
    -30.0
    >>> wrapping_cylinder(angles=range(-60, 81, 2)).motion.times[[0, -1]].tolist()
    [-60.0, 80.0]
    """
    times = np.arange(0.0, 41.0, 2.0) if angles is None else np.asarray(angles, dtype=np.float64)
    outside = times[~((times >= UNWOUND) & (times <= WOUND))]
    if len(outside):
        raise InputError(
            "wrapping_cylinder",
            f"an angle is {outside[0]:g} degrees, but the strap lies on the cylinder, and its moment arm is "
            f"known, from {UNWOUND:g} to {WOUND:g} only",
            "choose angles within",
        )
    bones, muscle = _surfaces()
    # The strap's edges are round: landmarks lie on the flat part of its faces.
    half = (WIDTH - THICKNESS) / 2.0
    angles = np.linspace(WRAPPED - ATTACHED, WRAPPED, 7)
    arc = _round_the_cylinder(angles, RADIUS)
    side = np.array([half, 0.0, 0.0])
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    heights = RADIUS + THICKNESS / 2.0 * (1.0 + 0.7 * corners[:, 1])
    face = np.column_stack([half * corners[:, 0], np.full(len(corners), -STRAIGHT), heights])
    return one_muscle(
        "wrapping_cylinder",
        "strap",
        muscle,
        ends("base", face, "pulley", np.vstack([arc + side, arc[::-1] - side])),
        bones=bones,
        motion=hinge("pulley", centre=(0, 0, 0), axis=(-1, 0, 0), angles=times),
        known={"moment_arm": -(RADIUS + THICKNESS / 2.0), "length": strap_length},
    )


def strap_length(angle: float) -> float:
    """Return the length of the middle line [mm], from the block to where the attachment starts.

    At angles from -80 degrees on; below, the strap does not touch the cylinder.
    """
    return STRAIGHT + (RADIUS + THICKNESS / 2.0) * float(np.radians(WRAPPED - ATTACHED + angle))


def _round_the_cylinder(angles: Floats, radius: float) -> Floats:
    turn = np.radians(angles)
    return radius * np.column_stack([np.zeros(len(turn)), np.sin(turn), np.cos(turn)])


@cache
def _surfaces() -> tuple[dict[str, Surface], Surface]:
    middle = RADIUS + THICKNESS / 2.0
    straight = np.linspace(-STRAIGHT - THICKNESS, 0.0, 30, endpoint=False)
    line = np.vstack(
        [
            np.column_stack([np.zeros(30), straight, np.full(30, middle)]),
            _round_the_cylinder(np.linspace(0.0, WRAPPED, 25), middle),
        ]
    )
    across = np.linspace(-1.0, 1.0, 3)[:, None] * [(WIDTH - THICKNESS) / 2.0, 0.0, 0.0]
    knots = line[:, None, :] + across
    strap = thick_sheet(knots, np.full(knots.shape[:2], THICKNESS / 2.0), spacing=1.5)
    strap = strap.beside((0, -STRAIGHT, 0), (0, -1, 0), 1.0)
    length = WIDTH + 20.0
    sides = 48
    points, triangles = solid_of_revolution(
        np.linspace(-length / 2.0, length / 2.0, 17), np.full(17, RADIUS), sides
    )
    bones = {
        "base": box((-25, -STRAIGHT - 20, 10), (25, -STRAIGHT, 50), 5.0),
        # From the z axis to the x axis.
        "pulley": (points[:, [2, 0, 1]], triangles),
    }
    return bones, mesh_of(strap, 2.5, 3000)

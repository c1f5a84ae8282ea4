"""A strap that lies on a bone at rest and leaves it at a known angle."""

from functools import cache

import numpy as np

from phantoms.planar import flexed
from phantoms.straps import block, end_ring, strap
from phantoms.taut_string import String, lever
from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.phantoms.implicit import rod, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Radius of the bone's roller about the hinge, thickness and width of the strap [mm].
RADIUS, THICKNESS, WIDTH = 20.0, 10.0, 30.0
#: Lengths of the strap's straight parts above and below the roller [mm].
ABOVE, BELOW = 80.0, 70.0
#: How far round the roller the strap lies at rest [degrees]: as much flexion takes it off.
LIFT_OFF = 30.0
AXIS = (-1.0, 0.0, 0.0)


def lifting_strap() -> Phantom:
    """Return a strap in front of a hinge, which wraps a roller at rest and lifts off it in flexion.

    The hinge is at the origin, its axis -x. The bone ``proximal`` ends in a roller of radius 20 mm about the
    axis. The strap runs down in front of it, over 30 degrees of the roller, and on to ``distal``, which
    flexes from 0 to 70 degrees, to the front. After 30 degrees the straight way from end to end is free, and
    a strap under tension takes it.

    Known of a fibre ``depth`` outward of the strap's middle, -5 to 5 mm, default 0: ``length(angle, depth)``
    of its taut path; ``moment_arm(angle, depth)``, 25 mm and the depth up to the lift-off, the lever of the
    straight line from there on; ``lift_off``, 30 degrees at every depth.
    """
    bones, muscle = _surfaces()
    at_rest = fibre(0.0)
    upper = end_ring(at_rest.start, (0, -1), WIDTH, THICKNESS)
    lower = end_ring(at_rest.end, -at_rest.pull, WIDTH, THICKNESS)
    return phantom_from(
        "lifting_strap",
        bones=bones,
        muscles={"strap": muscle},
        areas={"strap": ends("proximal", upper, "distal", lower)},
        motion=hinge("distal", centre=(0, 0, 0), axis=AXIS, angles=np.arange(0.0, 71.0, 2.0)),
        known={
            "length": lambda angle, depth=0.0: fibre(angle, depth).length,
            "moment_arm": fibre_moment_arm,
            "lift_off": LIFT_OFF,
        },
    )


def fibre(angle: float, depth: float = 0.0) -> String:
    """Return the taut path of a fibre at a depth outward of the middle [mm], at an angle [degrees]."""
    radius = RADIUS + THICKNESS / 2.0 + depth
    end = flexed((-radius, -BELOW), angle - LIFT_OFF)
    return String(np.array([-radius, ABOVE]), end, np.zeros(2), radius, 1)


def fibre_moment_arm(angle: float, depth: float = 0.0) -> float:
    """Return -dl/dq of a fibre [mm]: the lever of its pull on the bone that moves."""
    string = fibre(angle, depth)
    return lever(string.end, string.pull)


@cache
def _surfaces() -> tuple[dict[str, Surface], Surface]:
    half = WIDTH / 2.0 + 6.0
    front = -(RADIUS + THICKNESS + 6.0)
    roller = rod((-half, 0, 0), (half, 0, 0), RADIUS)
    upper = block((-half, front, ABOVE), (half, 10, ABOVE + 22))
    proximal = roller.joined(thick_curve([(0, 2, 0), (0, 2, ABOVE + 5)], [9.0, 9.0]), 3.0).joined(upper, 3.0)
    lower = block((-half, front, -BELOW - 22), (half, 10, -BELOW))
    distal = lower.joined(thick_curve([(0, 0, -34), (0, 0, -BELOW - 5)], [9.0, 9.0]), 3.0)
    points, triangles = mesh_of(distal, 2.5, 3000)
    bones = {
        "proximal": mesh_of(proximal, 2.5, 5000),
        "distal": (apply_transform(rotation_about((0, 0, 0), AXIS, -LIFT_OFF), points), triangles),
    }
    return bones, mesh_of(strap(fibre(0.0).points(0.5), WIDTH, THICKNESS), 2.5, 3000)

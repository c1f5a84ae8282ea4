"""A slender muscle over a bony brim, in a groove of it, where the straight way has the wrong sign."""

from functools import cache

import numpy as np

from phantoms.cords import cord
from phantoms.planar import flexed, in_space
from phantoms.straps import round_ring
from phantoms.taut_string import String, lever
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import Solid, ball, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Centres of the muscle's ends (y, z) [mm]; the hinge is at the origin, its axis -x.
ORIGIN = np.array([45.0, 100.0])
INSERTION = np.array([20.0, -50.0])
#: The brim, round about a line along x: where that is (y, z), and its radius on the groove's ground [mm].
BRIM = np.array([-16.0, 14.0])
BRIM_RADIUS = 9.0
#: Half the width of the groove from wall to wall, and of the brim [mm].
HALF_GROOVE, HALF_BRIM = 16.0, 19.0
#: Radius of the muscle, and of the rings of landmarks on its ends [mm].
RADIUS, RING = 6.0, 4.5


def flexor_over_brim(*, groove: float = 8.0) -> Phantom:
    """Return a hip flexor like the psoas: from far behind over the pelvic brim to behind the hinge.

    ``proximal`` has the origin, above and behind the hinge, and the brim, in front of it; ``distal`` has the
    insertion, below and behind the hinge, and flexes from 0 to 80 degrees, to the front. The straight way
    from end to end passes behind the hinge: it is that of an extensor. The muscle flexes, for the brim holds
    it in front. It lies in a groove of the brim.

    Known of the muscle's middle line at an angle: ``length(angle)`` of its taut path over the brim,
    ``moment_arm(angle)``, 18 mm at 0 and 35 at 80; ``straight_moment_arm(angle)`` of the straight way, -28 mm
    at 0.
    """
    bones, muscle = _surfaces(float(groove))
    at_rest = taut(0.0)
    start = _direction_at_start()
    rings = round_ring(ORIGIN, start, 0.75 * RADIUS), round_ring(INSERTION, at_rest.pull, 0.75 * RADIUS)
    return phantom_from(
        "flexor_over_brim",
        bones=bones,
        muscles={"flexor": muscle},
        areas={"flexor": ends("proximal", rings[0], "distal", rings[1])},
        motion=hinge("distal", centre=(0, 0, 0), axis=(-1, 0, 0), angles=np.arange(0.0, 81.0, 2.0)),
        known={
            "length": lambda angle: taut(angle).length,
            "moment_arm": taut_moment_arm,
            "straight_moment_arm": straight_moment_arm,
        },
    )


def taut(angle: float) -> String:
    """Return the taut path of the muscle's middle line at an angle [degrees]."""
    return String(ORIGIN, flexed(INSERTION, angle), BRIM, BRIM_RADIUS + RADIUS, 1)


def taut_moment_arm(angle: float) -> float:
    """Return -dl/dq of the middle line [mm]: the lever of its pull on the bone that moves."""
    string = taut(angle)
    return lever(string.end, string.pull)


def straight_moment_arm(angle: float) -> float:
    """Return -dl/dq of the straight line from end to end [mm]."""
    end = flexed(INSERTION, angle)
    return lever(end, (ORIGIN - end) / np.linalg.norm(ORIGIN - end))


def brim(groove: float) -> Solid:
    """Return the brim: a solid of revolution about a line along x, its radius by x the groove's profile.

    The radius is 9 mm + d sin^2(pi x / 32 mm) within the groove of depth d, and 9 mm + d beside it.
    """
    rate = np.pi / (2.0 * HALF_GROOVE)
    # No steeper than a distance: divided by the length of the steepest gradient.
    steepest = np.hypot(1.0, groove * rate)

    def field(points: Floats) -> tuple[Floats, Floats]:
        away = points[:, 1:] - BRIM
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-12)
        x = np.clip(points[:, 0], -HALF_GROOVE, HALF_GROOVE)
        value = distance - BRIM_RADIUS - groove * np.sin(rate * x) ** 2
        slope = np.column_stack([-groove * rate * np.sin(2.0 * rate * x), away / distance[:, None]])
        return value / steepest, slope / steepest

    side = np.array([HALF_BRIM, 0.0, 0.0])
    middle = np.array([0.0, *BRIM])
    reach = np.array([HALF_BRIM, *np.full(2, BRIM_RADIUS + max(groove, 0.0))])
    whole = Solid(field, middle - reach, middle + reach)
    return whole.cut_by(middle - side, (-1, 0, 0), 2.0).cut_by(middle + side, (1, 0, 0), 2.0)


def _direction_at_start() -> Floats:
    points = taut(0.0).points(1.0)
    step: Floats = points[1] - points[0]
    return step


@cache
def _surfaces(groove: float) -> tuple[dict[str, Surface], Surface]:
    at_rest = taut(0.0)
    away, start = -at_rest.pull, _direction_at_start() / np.linalg.norm(_direction_at_start())
    # Balls cut flat carry the attachments; a curve behind the muscle joins the upper one to the brim.
    carrier = ball((0.0, *(ORIGIN - 7.0 * start)), 12.0).cut_by((0.0, *ORIGIN), (0.0, *start), 1.0)
    back = thick_curve(in_space([(58, 112), (61, 84), (36, 48), (-10, 16)]), [9.0, 8.0, 7.0, 6.0])
    upper = carrier.joined(back, 3.0).joined(brim(groove), 3.0)
    knee = INSERTION + 7.0 * away
    shaft = thick_curve(in_space(knee + np.array([(0, 0), (0, -22), (-8, -80)])), [12.0, 9.0, 10.0])
    bones = {
        "proximal": mesh_of(upper, 2.0, 6000),
        "distal": mesh_of(shaft.cut_by((0.0, *INSERTION), (0.0, *-away), 1.0), 2.5, 2500),
    }
    return bones, mesh_of(cord(at_rest.points(0.5), [RADIUS, RADIUS]), 1.6, 3000)

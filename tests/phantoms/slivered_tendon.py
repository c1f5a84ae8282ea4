"""A belly with a thin tendon of slivers, which is pulled far round an edge."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from phantoms.planar import flexed, in_space
from phantoms.straps import round_ring
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import thick_sheet
from vtkmuscle.phantoms.meshing import box, mesh_of, solid_of_revolution, volume_of_revolution
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Radii of the wedge's edge, which is round about the x axis, of the tendon and of the belly [mm].
EDGE, TENDON, BELLY = 15.0, 3.0, 16.0
#: Radius that the middle of the tendon runs round the edge at [mm].
MIDDLE = EDGE + TENDON
#: Heights of the tendon's end, of the belly's two ends [mm]; the edge is at 0.
END, BELLY_START, TOP = -40.0, 100.0, 220.0
#: Height of a row of triangles in the tendon and in the belly [mm]; number of sides of a row.
LONG, SHORT, SIDES = 10.0, 4.0, 24
#: How far the tendon's end is pulled [mm], and turned about the edge meanwhile [degrees].
PULL, TURN = 100.0, 90.0


def slivered_tendon(*, pulls: ArrayLike | None = None) -> Phantom:
    """Return a belly with a thin tendon of badly shaped triangles, pulled by 100 mm round an edge.

    The belly hangs from the block ``base``. Its tendon, 3 mm in radius, runs down past the edge of ``wedge``,
    round about the x axis, to the block ``pulled``. That is turned by 90 degrees about the edge, backward,
    and drawn away from it along the tendon, so that the way from end to end grows by 100 mm, evenly. The
    triangles of the tendon are slivers along it, as in the tendons of decimated scans: of aspect ratio 13,
    longest edge by least height.

    Known: ``length(pull)`` of the taut path of the muscle's middle line, 260 mm at rest, 360 at the end;
    ``volume`` of the muscle's mesh [mm^3]; ``tendon_start``, the height that the tendon's slivers lie below.
    """
    times = np.arange(0.0, PULL + 1.0, 2.5) if pulls is None else np.asarray(pulls, dtype=np.float64)
    bones, muscle = _surfaces()
    radius = float(_profile()[1][-1])
    upper, lower = (round_ring((-MIDDLE, z), (0, -1), 0.8 * r) for z, r in ((TOP, radius), (END, TENDON)))
    return phantom_from(
        "slivered_tendon",
        bones=bones,
        muscles={"muscle": muscle},
        areas={"muscle": ends("base", upper, "pulled", lower)},
        motion=RigidMotion(times, {"pulled": np.array([_pulled(pull) for pull in times])}),
        known={
            "length": lambda pull: TOP - END + pull,
            "volume": volume_of_revolution(*_profile(), SIDES),
            "tendon_start": BELLY_START,
        },
    )


def _pulled(pull: float) -> Floats:
    """Return the transform (4, 4) of the bone at the tendon's end: what it does not wind up draws it away."""
    turn = TURN * pull / PULL
    transform = rotation_about((0, 0, 0), (1, 0, 0), turn)
    transform[:3, 3] = in_space((pull - MIDDLE * np.radians(turn)) * flexed((0.0, -1.0), -turn)[None])[0]
    return transform


def _profile() -> tuple[Floats, Floats]:
    """Return heights and radii of the muscle's rows [mm], the belly's r = 3 + 13 sin^2(0.7 pi u), u to 1."""
    tendon = np.arange(END, BELLY_START, LONG)
    belly = np.arange(BELLY_START, TOP + SHORT / 2.0, SHORT)
    u = (belly - BELLY_START) / (TOP - BELLY_START)
    radii = TENDON + (BELLY - TENDON) * np.sin(0.7 * np.pi * u) ** 2
    return np.append(tendon, belly), np.append(np.full(len(tendon), TENDON), radii)


@cache
def _surfaces() -> tuple[dict[str, Surface], Surface]:
    half = 20.0
    plate = np.array([[(x, y, 0.0) for y in (0.0, 15.0, 30.0)] for x in (-half, 0.0, half)])
    bones = {
        "base": box((-half, -MIDDLE - half, TOP), (half, -MIDDLE + half, TOP + 16), 5.0),
        "wedge": mesh_of(thick_sheet(plate, np.full((3, 3), EDGE)), 2.5, 4000),
        "pulled": box((-8, -MIDDLE - 8, END - 16), (8, -MIDDLE + 8, END), 4.0),
    }
    points, triangles = solid_of_revolution(*_profile(), SIDES)
    return bones, (points + np.array([0.0, -MIDDLE, 0.0]), triangles)

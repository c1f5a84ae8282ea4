"""Muscles over a pulley about a hinge, each with a trap for paths; the moment arm is the pulley's.

The hinge is along x through the origin, and the bone ``proximal`` ends in a roller about it, ``distal``
begins below. A muscle runs down in front, at -y, winds round the roller, and pulls ``distal``, which turns to
the back and winds it up. Above the roller the muscle lies still: whatever happens there, the arm is minus the
radius that the muscle's middle runs round.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np

from phantoms.cords import cord
from phantoms.planar import flexed
from phantoms.straps import block, end_ring, round_ring, strap
from phantoms.taut_string import String, lever
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.implicit import Solid, rod, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, ends, phantom_from

#: Radius of the roller; thickness of straps, radius of cords [mm].
RADIUS, THICKNESS, CORD = 20.0, 8.0, 3.0
#: How far round the roller a muscle lies at rest [degrees], and its straight part below [mm].
WRAP, BELOW = 40.0, 45.0
AXIS, ANGLES = (1.0, 0.0, 0.0), np.arange(0.0, 81.0, 4.0)


def strap_along_bone() -> Phantom:
    """Return a strap that lies along a long bone, bowed off it, and over a hinge at the bone's far end.

    Like a vastus: 180 mm of the strap, 24 mm wide, run along ``proximal``, in an arch that is 16 mm in front
    of the bone in the middle, where muscle would be between. The arch goes with that bone, and not, by part,
    with the one that the strap ends on.

    The known moment arm is -24 mm at every angle.
    """
    return _strap("strap_along_bone", above=180.0, width=24.0, arch=16.0)


def broad_origin() -> Phantom:
    """Return a strap whose paths are from 40 to 220 mm long: it is cut obliquely where it begins.

    The strap is 40 mm wide. Points equally far along its paths are not beside each other.

    The known moment arm is -24 mm at every angle.
    """
    return _strap("broad_origin", above=190.0, width=40.0, slope=4.5)


def strap_beside_bone() -> Phantom:
    """Return a strap that winds round a roller, and with its edge lies on a bone that moves along.

    ``beside`` is a third bone: a post along the left edge of the strap, 40 mm wide, that turns with
    ``distal``. The strap's fibres are up to 40 mm of muscle away from it, and do not lie on it.

    The known moment arm is -24 mm at every angle.
    """
    return _strap("strap_beside_bone", above=120.0, width=40.0, post=True)


def tendon_between_bones() -> Phantom:
    """Return a tendon that runs down between two rods of one bone, 1 mm from each, and on over a roller.

    Like the tibialis posterior between tibia and fibula: the two rods are one surface of two pieces, which
    face each other.

    The known moment arm is -23 mm at every angle.
    """
    bones, muscle, areas = _tendon_between()
    return _phantom("tendon_between_bones", bones, muscle, areas, RADIUS + CORD)


def cord_over_roller(radii: list[float], middle: float) -> Phantom:
    """Return a round muscle of radii along its course; its middle runs round the roller at a radius [mm]."""
    line = _line(150.0, middle)
    bones = _bones(150.0, max(radii) + 8.0, line)
    areas = ends(
        "proximal",
        round_ring(line[0], (0, -1), 0.8 * radii[0]),
        "distal",
        round_ring(line[-1], line[-1] - line[-2], 0.8 * radii[-1]),
    )
    made = {name: mesh_of(bone, 2.3, 5000) for name, bone in bones.items()}
    return _phantom("cord", made, mesh_of(cord(line, radii), 1.6, 3500), areas, middle)


@cache
def _tendon_between() -> tuple[dict[str, Surface], Surface, list[AttachmentArea]]:
    above, middle = 150.0, RADIUS + CORD
    line = _line(above, middle)
    bones, far = _bones(above, 12.0, line), CORD + 1.0 + 6.0
    second = mesh_of(rod((far, -middle, 25.0), (far, -middle, above - 8.0), 6.0), 2.0, 1500)
    first = mesh_of(
        bones["proximal"].joined(rod((-far, -middle, 25.0), (-far, -middle, above + 5.0), 6.0), 1.0),
        2.2,
        5000,
    )
    areas = ends(
        "proximal",
        round_ring(line[0], (0, -1), 0.8 * CORD),
        "distal",
        round_ring(line[-1], line[-1] - line[-2], 0.8 * CORD),
    )
    both = np.vstack([first[0], second[0]]), np.vstack([first[1], second[1] + len(first[0])])
    made = {"proximal": both, "distal": mesh_of(bones["distal"], 2.5, 2500)}
    return made, mesh_of(cord(line, [CORD] * 2), 1.5, 3000), areas


#: The band is so far in front of the bone, so high, so round; the hinge is near the tendon's pull [mm].
FRONT, BAND, ROUND, HINGE = 10.0, 12.0, 8.0, np.array([-25.0, -20.0])


def tendon_under_band() -> Phantom:
    """Return a tendon that bows by 45 degrees round nothing, as under a retinaculum.

    The tendon, 3 mm in radius, runs down 7 mm in front of ``proximal``, bows away from it, held by a band
    that is not in the scene, and pulls ``distal``, whose hinge is 12 mm from the tendon. The band goes with
    ``proximal``, by far the nearest bone. So near the hinge the tendon slides little under its band.

    Known of the middle line at an angle of ``distal`` to the front, -30 to 30 degrees: ``moment_arm(angle)``
    and ``length(angle)`` [mm].
    """
    bones, muscle, areas = _tendon_under()
    return phantom_from(
        "tendon_under_band",
        bones=bones,
        muscles={"muscle": muscle},
        areas={"muscle": areas},
        motion=hinge("distal", centre=(0, *HINGE), axis=(-1, 0, 0), angles=np.arange(-30.0, 31.0, 3.0)),
        known={
            "moment_arm": lambda angle: lever(banded(angle).end - HINGE, banded(angle).pull),
            "length": lambda angle: banded(angle).length,
        },
    )


def banded(angle: float) -> String:
    """Return the middle line of the tendon under its band at an angle [degrees]."""
    end = HINGE + flexed((-25.0, -10.0), angle)
    return String(np.array([-FRONT, 130.0]), end, np.array([-FRONT - ROUND, BAND]), ROUND, -1)


@cache
def _tendon_under() -> tuple[dict[str, Surface], Surface, list[AttachmentArea]]:
    string = banded(0.0)
    line, (y, z) = string.points(0.5), string.end
    top = block((-12, -FRONT - 10, 130.0), (12, 30, 148.0))
    shank = thick_curve([(0, 10, 8), (0, 10, 135)], [10.0, 10.0]).joined(top, 3.0)
    foot = block((-10, y - 8, z - 22), (10, y + 8, z - 1))
    foot = foot.joined(thick_curve([(0, 10, z - 30), (0, y, z - 16)], [6.0, 6.0]), 3.0)
    upper = round_ring(line[0], (0, -1), 0.8 * CORD)
    areas = ends("proximal", upper, "distal", round_ring(line[-1], -string.pull, 0.8 * CORD))
    bones = {"proximal": mesh_of(shank, 2.5, 3000), "distal": mesh_of(foot, 2.5, 2000)}
    return bones, mesh_of(cord(line, [CORD] * 2), 1.5, 3000), areas


def _strap(name: str, **shape: float) -> Phantom:
    return _phantom(name, *_strap_parts(**shape), RADIUS + THICKNESS / 2.0)


@cache
def _strap_parts(
    above: float, width: float, arch: float = 0.0, slope: float = 0.0, *, post: bool = False
) -> tuple[dict[str, Surface], Surface, list[AttachmentArea]]:
    """Return bones, strap and areas; see :func:`_line`. The slope is of the upper end, along the width."""
    line = _line(above, RADIUS + THICKNESS / 2.0, arch)
    bones, muscle = _bones(above, width / 2.0 + 6.0, line, slope), strap(line, width, THICKNESS)
    upper = end_ring(line[0], (0, -1), width, THICKNESS)
    if slope:
        middle = above - slope * width / 2.0
        muscle = muscle.cut_by((0, 0, middle), (slope, 0, 1), 1.0)
        upper[:, 2] = middle - slope * upper[:, 0]
    lower = end_ring(line[-1], line[-1] - line[-2], width, THICKNESS)
    made = {name: mesh_of(bone, 2.5, 5000) for name, bone in bones.items()}
    if post:
        far, y = width / 2.0 + 7.0, line[0, 0]
        made["beside"] = mesh_of(thick_curve([(far, y, 25.0), (far, y, 90.0)], [7.0, 7.0]), 2.5, 1500)
    return made, mesh_of(muscle, 2.0, 4000), ends("proximal", upper, "distal", lower)


def _line(above: float, middle: float, arch: float = 0.0) -> Floats:
    """Return a middle line (k, 2): down, round the roller, and on.

    Above the roller it is ``above`` long [mm], and in front of its straight course by up to ``arch`` [mm].
    """
    down = np.linspace(1.0, 0.0, 100, endpoint=False)
    turns = np.radians(np.linspace(0.0, WRAP, 40))
    lower = np.radians(WRAP)
    last = -middle * np.array([np.cos(lower), np.sin(lower)]) + BELOW * np.array(
        [np.sin(lower), -np.cos(lower)]
    )
    return np.vstack(
        [
            np.column_stack([-middle - arch * np.sin(np.pi * down) ** 2, above * down]),
            -middle * np.column_stack([np.cos(turns), np.sin(turns)]),
            last,
        ]
    )


def _bones(above: float, half: float, line: Floats, slope: float = 0.0) -> dict[str, Solid]:
    """Return the bones of a muscle as wide as twice a half [mm] along a line."""
    upper = block((-half, (line[0, 0] - 12.0), above - slope * 2.0 * half), (half, 10, above + 22))
    if slope:
        upper = upper.cut_by((0, 0, above - slope * (half - 6.0)), (-slope, 0, -1), 1.0)
    roller = rod((-half, 0, 0), (half, 0, 0), RADIUS)
    shaft = thick_curve([(0, 2, 0), (0, 2, above + 5)], [9.0, 9.0])
    y, z = line[-1]
    lower = block((-half, y - 12, z - 22), (half, y + 12, z - 2))
    stem = thick_curve([(0, 3, -RADIUS - 9), (0, y, z - 8)], [6.0, 6.0])
    return {"proximal": roller.joined(shaft, 3.0).joined(upper, 3.0), "distal": lower.joined(stem, 3.0)}


def _phantom(
    name: str, bones: Mapping[str, Surface], muscle: Surface, areas: list[AttachmentArea], radius: float
) -> Phantom:
    moving = hinge("distal", centre=(0, 0, 0), axis=AXIS, angles=ANGLES)
    if "beside" in bones:
        moving.transforms["beside"] = moving.transforms["distal"]
    return phantom_from(
        name,
        bones=bones,
        muscles={"muscle": muscle},
        areas={"muscle": areas},
        motion=moving,
        known={"moment_arm": -radius},
    )

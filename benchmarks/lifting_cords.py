"""Cords and straps on a convex bone, which lift off the bone as the joint turns; the straight way is known.

The hinge is along x through the origin. The muscle runs down in front of a convex part of ``proximal``, at
-y, to ``distal``. To one side the joint winds the muscle up, to the other the muscle lifts off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import how_right  # noqa: F401 -- finds the phantoms of the tests
import numpy as np
from numpy.typing import ArrayLike
from phantoms.straps import end_ring, strap
from scipy.interpolate import CubicSpline
from scipy.spatial import ConvexHull

from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms import Phantom
from vtkmuscle.phantoms.implicit import Solid, ball, rod, thick_curve, union
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import ends, phantom_from

AXIS = (1.0, 0.0, 0.0)
#: Angles that lift a muscle off, and that wind it up [degrees].
OFF, ON = np.arange(-40.0, 1.0, 2.0), np.arange(0.0, 41.0, 2.0)
#: Radius of the bones at the ends, and the distance of their centres from a muscle's ends [mm].
KNOB, AWAY = 8.0, 9.0
TURNS = np.linspace(0.0, 2.0 * np.pi, 20_000, endpoint=False)


def lifting_cords() -> Iterator[tuple[str, Phantom]]:
    """Yield names and phantoms; radii of cords and thicknesses of straps are in the names."""
    for radius in (2.0, 3.5, 6.0):
        shape = (38.0, 24.0, 40.0), (0.0, 6.0), (-14.0, 120.0), (-18.0, -95.0)
        yield f"cord of {radius:g} mm off an ellipsoid", _planar(*shape, radius=radius)
    for radius in (3.5, 6.0):
        yield f"cord of {radius:g} mm off a cone", _over_cone(radius)
    for size, radius in ((15.0, 2.0), (25.0, 7.0)):
        shape = (size,) * 3, (0.0, 5.0), (-0.4 * size, 110.0), (-0.5 * size, -100.0)
        yield f"cord of {radius:g} mm off a ball", _planar(*shape, radius=radius)
    rods = (np.inf, 22.0, 22.0), (0.0, 8.0), (-12.0, 120.0), (-16.0, -95.0)
    for words, angles in (("off", OFF), ("on", ON)):
        yield f"cord of 3.5 mm {words} a rod", _planar(*rods, angles, radius=3.5)
    for thickness, size in ((6.0, 25.0), (20.0, 20.0)):
        front = 0.5 * size + 4.0
        shape = (np.inf, size, size), (0.0, 6.0), (-front, 115.0), (-0.1 * size - front, -100.0)
        yield f"strap of {thickness:g} mm off a rod", _planar(*shape, radius=thickness / 2.0, width=34.0)


def _planar(
    sizes: ArrayLike, centre: ArrayLike, start: ArrayLike, end: ArrayLike, angles: Floats = OFF, *,
    radius: float, width: float = 0.0,
) -> Phantom:  # fmt: skip
    """Return a muscle in front of an ellipsoid, or a rod of infinite size along x; the middle is at x = 0."""
    along, ay, az = np.asarray(sizes, dtype=np.float64)
    middle, first, last = (np.append(0.0, point) for point in (centre, start, end))
    normals = np.column_stack([np.cos(TURNS) / ay, np.sin(TURNS) / az])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    outline = np.column_stack([ay * np.cos(TURNS), az * np.sin(TURNS)]) + radius * normals + middle[1:]
    half = np.array([width / 2.0 + 9.0, 0.0, 0.0])
    bone = _ellipsoid(middle, np.array([along, ay, az])) if np.isfinite(along) else None

    def way(angle: float) -> Floats:
        """Return the front of the hull of the outline and both ends, (k, 2)."""
        moved = _turned(last, angle)[1:]
        points = np.vstack([first[1:], moved, outline, [[200.0, first[2]], [200.0, moved[1]]]])
        hull = ConvexHull(points).vertices.tolist()
        hull = hull[hull.index(0) :] + hull[: hull.index(0)]
        return np.asarray(points[hull[: hull.index(1) + 1]])

    def length(angle: float) -> float:
        return float(np.linalg.norm(np.diff(way(angle), axis=0), axis=1).sum())

    def arm(angle: float) -> float:
        return (length(angle - 0.25) - length(angle + 0.25)) / float(np.radians(0.5))

    line = np.column_stack([np.zeros(len(way(0.0))), way(0.0)])
    bone = bone or rod(middle - half, middle + half, ay)
    return _phantom(bone, line, angles, arm, radius=radius, width=width)


def _over_cone(radius: float) -> Phantom:
    """Return a cord over a cone about x of 18 degrees, which the taut cord crosses askew."""
    apex, half, axis = np.array([-70.0, 0.0, 0.0]), np.radians(18.0), np.array(AXIS)
    first, last = np.array([4.0, -20.0, 115.0]), np.array([-6.0, -22.0, -90.0])

    def field(points: Floats) -> tuple[Floats, Floats]:
        away = points - apex
        across = away - (away @ axis)[:, None] * axis
        size = np.linalg.norm(across, axis=1)
        slope = np.cos(half) * across / np.maximum(size, 1e-9)[:, None] - np.sin(half) * axis
        return size * np.cos(half) - (away @ axis) * np.sin(half), slope

    def taut(end: Floats) -> Floats:
        """Return the shortest line (k, 3) outside of the cone, by means and projection."""
        line = np.array([first, [0.0, -45.0, 20.0], [0.0, -45.0, -20.0], end])
        for count, rounds in ((24, 4000), (48, 8000), (96, 16_000)):
            steps = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
            places = np.linspace(0.0, steps[-1], count + 1)
            line = np.column_stack([np.interp(places, steps, column) for column in line.T])
            for _ in range(rounds):
                line[1:-1] = 0.5 * (line[:-2] + line[2:])
                distance, outward = field(line[1:-1])
                line[1:-1] -= np.minimum(distance - radius, 0.0)[:, None] * outward
        return line

    places = OFF[::2]
    lines = [taut(_turned(last, angle)) for angle in places]
    lengths = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines]
    slope = CubicSpline(np.radians(places), lengths).derivative()
    low, high = apex + 25.0 * axis, apex + 125.0 * axis
    bone = Solid(field, low - 46.0, high + 46.0).cut_by(low, -axis, 2.0).cut_by(high, axis, 2.0)
    return _phantom(bone, lines[-1], OFF, lambda angle: -float(slope(np.radians(angle))), radius=radius)


def _turned(point: Floats, angle: float) -> Floats:
    return apply_transform(rotation_about((0.0, 0.0, 0.0), AXIS, angle), point[None])[0]


def _ellipsoid(centre: Floats, axes: Floats) -> Solid:
    def field(points: Floats) -> tuple[Floats, Floats]:
        away = points - centre
        size, slope = np.linalg.norm(away / axes, axis=1), away / axes**2
        steep = np.maximum(np.linalg.norm(slope, axis=1), 1e-12)
        return (size - 1.0) * size / steep, slope / steep[:, None]

    return Solid(field, centre - axes - 5.0, centre + axes + 5.0)


def _phantom(
    bone: Solid, line: Floats, angles: Floats, arm: Callable[[float], float], *, radius: float,
    width: float = 0.0,
) -> Phantom:  # fmt: skip
    """Return a cord about a line (k, 3) at rest, or a strap of a width about a line at x = 0."""
    first, last = (way / np.linalg.norm(way) for way in (line[0] - line[1], line[-1] - line[-2]))
    beside = np.linspace(4.0 - width / 2.0, width / 2.0 - 4.0, 5 if width else 1)[:, None] * AXIS
    upper, lower = (
        union([ball(end + AWAY * away + shift, KNOB) for shift in beside], 1.0)
        for end, away in ((line[0], first), (line[-1], last))
    )
    if width:
        solid = strap(line[:, 1:], width, 2.0 * radius)
        towards = zip(line[[0, -1]], (-first, last), strict=True)
        rings = [end_ring(end[1:], way[1:], width, 2.0 * radius) for end, way in towards]
    else:
        steps = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
        places = np.linspace(0.0, steps[-1], max(int(steps[-1] / 3.0), 8) + 1)
        even = np.column_stack([np.interp(places, steps, column) for column in line.T])
        before, after = radius * np.outer((2, 1), first), radius * np.outer((1, 2), last)
        longer = np.vstack([even[0] + before, even, even[-1] + after])
        solid = thick_curve(longer, np.full(len(longer), radius))
        solid = solid.cut_by(line[0], first, 1.0).cut_by(line[-1], last, 1.0)
        rings = [_ring(line[0], first, 0.7 * radius), _ring(line[-1], last, 0.7 * radius)]
    return phantom_from(
        "lifting_cord",
        bones={
            "proximal": mesh_of(bone.joined(upper, 0.5), 2.0, 9000),
            "distal": mesh_of(lower, 2.0, 5000),
        },
        muscles={"cord": mesh_of(solid, 2.0 if width else 1.3, 4000)},
        areas={"cord": ends("proximal", rings[0], "distal", rings[1])},
        motion=hinge("distal", centre=(0, 0, 0), axis=AXIS, angles=angles),
        known={"moment_arm": arm},
    )


def _ring(centre: Floats, along: Floats, radius: float) -> Floats:
    """Return landmarks (12, 3) in a circle across a direction."""
    one, other = np.linalg.svd(along[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(12)[:, None] / 12
    return np.asarray(centre + radius * (np.cos(turns) * one + np.sin(turns) * other))

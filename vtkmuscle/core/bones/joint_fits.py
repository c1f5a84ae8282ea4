"""Centres and axes of joints by the round ends of bones."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.surface import diagonal
from vtkmuscle.core.types import MOST_ROUNDS, Bools, Floats, Ints

#: Bones touch where they are nearer than this part of the smaller bone's size. With half or twice as much the
#: centres of heads in three hips and a shoulder change by at most 0.1 mm.
TOUCHING = 0.02
#: Largest distance of a point from its ball, in radii; smallest cosine between its normal and the radius.
#: With 0.03 or 0.95 the joint of an elbow is not found; with 0.12 or without the cosine the centres of two
#: hips, a knee, an elbow and a shoulder change by up to 3.7 mm, the axes by up to 3.6 degrees.
NEAR, ALONG = 0.06, 0.9
#: Part of the whole ball from which on a fit is fully sure; a femur's head covers 0.7 to 0.9 (five subjects),
#: the back of a condyle 0.3 (one subject).
_COVERED = {"ball": 0.5, "hinge": 0.25}
#: Fewest points of a ball: three for each of its four numbers.
_FEWEST = 12


@dataclass(frozen=True, eq=False)
class JointFit:
    """A ball fitted to a bone, or two balls side by side."""

    centre: Floats  # (3,), of the ball, or the middle between two [mm]
    axis: Floats | None  # (3,), unit vector from one ball's centre to the other's
    radius: float  # of two balls the mean [mm]
    rms: float  # of the distances of points from the ball, of two the larger [mm]
    covered: float  # area of the points as a part of the whole ball's, of two the smaller

    @property
    def confidence(self) -> float:
        """Confidence from 0, off the ball, to 1, exactly on the ball and all round."""
        flat = max(0.0, 1.0 - self.rms / (NEAR * self.radius))
        return float(flat * min(1.0, self.covered / _COVERED["ball" if self.axis is None else "hinge"]))


class OrientedPoints(NamedTuple):
    """Points of a bone (n, 3) [mm], with unit normals, outward, and the area around each point (n,)."""

    points: Floats
    normals: Floats
    areas: Floats


def oriented_points(points: Floats, triangles: Ints) -> OrientedPoints:
    """Return the points of a surface with normals and areas."""
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(points)).astype(np.float64)
    return OrientedPoints(points, vertex_normals(points, triangles), areas)


def head_in(bone: Bone, socket: Bone) -> JointFit | None:
    """Return the ball of a bone's head in another bone's socket, or None.

    Seeds are the points near the other bone. Of two bones that are no ball joint none is fitted, or one with
    a low :attr:`~JointFit.confidence`: below 0.35 in hips, knees, elbows and an ankle. Heads of three femurs
    and a humerus have 0.58 to 0.66.
    """
    points, (low, high) = bone.points, socket.solids.box
    near = TOUCHING * min(diagonal(points), diagonal(socket.points))
    seeds: Bools = np.all((points >= low - near) & (points <= high + near), axis=1)
    seeds[seeds] = np.abs(socket.solids.distances(points[seeds])) < near
    try:
        _check_enough(seeds)  # far bones cost no normals
        return fitted_ball(oriented_points(points, bone.triangles), seeds)
    except InputError:  # too few points are round
        return None


def fitted_ball(surface: OrientedPoints, seeds: Bools) -> JointFit:
    """Return the ball fitted around seeds (n,) on a bone.

    Least squares in rounds: first of the seeds, then of all points on the previous ball. A ball with fewer
    than 12 points raises a ValueError.
    """
    (points, normals, areas), chosen = surface, seeds
    for _ in range(MOST_ROUNDS):
        _check_enough(chosen)
        weights = areas[chosen, None] ** 0.5
        # |p|^2 = 2 c.p + (r^2 - |c|^2), about a point nearby
        origin = points[chosen].mean(axis=0)
        local = points[chosen] - origin
        equations = np.column_stack([2.0 * local, np.ones(len(local))])
        ball = np.linalg.lstsq(weights * equations, weights[:, 0] * (local**2).sum(axis=1), rcond=None)[0]
        radius, centre = float(np.sqrt(ball[3] + ball[:3] @ ball[:3])), origin + ball[:3]
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        facing = np.einsum("ij,ij->i", away, normals) > ALONG * distance
        last, chosen = chosen, (np.abs(distance - radius) < NEAR * radius) & facing
        if np.array_equal(last, chosen):
            break
    _check_enough(chosen)
    rms = float(np.sqrt(((distance[chosen] - radius) ** 2).mean()))
    return JointFit(centre, None, radius, rms, float(areas[chosen].sum() / (4.0 * np.pi * radius**2)))


def fitted_hinge(surface: OrientedPoints, seeds: Bools) -> JointFit:
    """Return the axis through two condyle balls, each fitted as by :func:`fitted_ball`.

    Condyles lie side by side, along the longest extent of the seeds. The balls are fitted to the points
    facing the opposite bone, or to the points protruding most from the line of the shaft, as at the back of a
    femur's condyles; the surer fit is taken. Eckhoff et al. 2007, *Difference between the epicondylar and
    cylindrical axis of the knee*, doi:10.1097/BLO.0b013e318112416b.
    """
    _check_enough(seeds)
    points, normals, areas = surface
    centre = points[seeds].mean(axis=0)
    across = np.linalg.svd(points[seeds] - centre, full_matrices=False)[2][0]
    reach = float(np.abs((points[seeds] - centre) @ across).max())
    end = np.linalg.norm(points - centre, axis=1) < 2.0 * reach
    away = centre - np.average(points, axis=0, weights=areas)
    along = away - (away @ across) * across
    along /= np.linalg.norm(along)
    back = (centre - points) @ along
    shaft = points[(back > 2.0 * reach) & (back < 4.0 * reach)]
    starts = [seeds]
    if len(shaft):
        behind = np.cross(along, across)
        off = (points - shaft.mean(axis=0)) @ behind
        behind *= np.sign(off[end].max() + off[end].min())
        off = points @ behind
        starts.append(end & (normals @ behind > 0.5) & (off > off[end].max() - 0.5 * reach))
    fits, problem = [], InputError("", "the bone has no two condyles", "give the axis yourself")
    for start in filter(np.any, starts):
        side = (points - points[start].mean(axis=0)) @ across
        try:
            condyles = (start & (side * sign > 0.0) for sign in (1, -1))
            first, second = (fitted_ball(surface, condyle) for condyle in condyles)
        except InputError as error:
            problem = error
            continue
        axis, radius = first.centre - second.centre, 0.5 * (first.radius + second.radius)
        length = float(np.linalg.norm(axis))
        if length > 0.5 * radius:  # two balls in the same position give no axis
            middle, covered = 0.5 * (first.centre + second.centre), min(first.covered, second.covered)
            fits.append(JointFit(middle, axis / length, radius, max(first.rms, second.rms), covered))
    if not fits:
        raise problem
    return max(fits, key=lambda fit: fit.confidence)


def _check_enough(chosen: Bools) -> None:
    if chosen.sum() < _FEWEST:
        raise InputError("", "the end of the bone at the joint is not round", "give the joint's centre")

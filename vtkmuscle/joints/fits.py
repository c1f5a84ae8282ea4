"""Joint centres and axes from round bone surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats

#: A point lies on the ball where it is nearer to it than this part of the radius, and its normal is within
#: this cosine (25 degrees) of the radius.
NEAR, ALONG = 0.06, 0.9
#: Most rounds of fitting and choosing points; 5 to 10 are common.
_ROUNDS = 30
#: Part of the whole ball from which on a fit is fully sure; a femur's head covers 0.7 to 0.9 (five subjects),
#: the back of a condyle 0.3 (one subject).
_COVERED = {"ball": 0.5, "hinge": 0.25}
#: Fewest points of a ball.
_FEWEST = 12


@dataclass(frozen=True, eq=False)
class JointFit:
    """A ball fitted to a bone, or two balls.

    Two balls lie side by side.
    """

    centre: Floats  # (3,), of the ball, or the middle between two [mm]
    axis: Floats | None  # (3,), unit vector from one ball's centre to the other's
    radius: float  # of two balls the mean [mm]
    rms: float  # of the distances of points from the ball, of two the larger [mm]
    covered: float  # area of the points as a part of the whole ball's, of two the smaller

    @property
    def confidence(self) -> float:
        """Confidence of the fit, 0 to 1.

        1 for points exactly on the ball and all round, 0 for points off the ball.
        """
        flat = max(0.0, 1.0 - self.rms / (NEAR * self.radius))
        whole = _COVERED["ball" if self.axis is None else "hinge"]
        return float(flat * min(1.0, self.covered / whole))


def fitted_ball(points: Floats, normals: Floats, areas: Floats, seeds: Bools) -> JointFit:
    """Return the ball fitted around seeds on a bone.

    The seeds (n,) select points. Least squares in rounds: first of the seeds, then of all points on the
    previous ball. The bone has points (n, 3) [mm], unit normals, outward, and areas around each point. A
    ball with fewer than 12 points raises a ValueError.
    """
    chosen = seeds
    for _ in range(_ROUNDS):
        _check_enough(chosen)
        weights = areas[chosen, None] ** 0.5
        # |p|^2 = 2 c.p + (r^2 - |c|^2), about a point nearby
        near = points[chosen].mean(axis=0)
        local = points[chosen] - near
        equations = np.column_stack([2.0 * local, np.ones(len(local))])
        found = np.linalg.lstsq(weights * equations, weights[:, 0] * (local**2).sum(axis=1), rcond=None)[0]
        radius, centre = float(np.sqrt(found[3] + found[:3] @ found[:3])), near + found[:3]
        away = points - centre
        last, chosen = chosen, _on(away, radius, normals)
        if np.array_equal(last, chosen):
            break
    _check_enough(chosen)
    off = np.linalg.norm(away[chosen], axis=1) - radius
    covered = float(areas[chosen].sum() / (4.0 * np.pi * radius**2))
    return JointFit(centre, None, radius, float(np.sqrt((off**2).mean())), covered)


def fitted_hinge(points: Floats, normals: Floats, areas: Floats, seeds: Bools) -> JointFit:
    """Return the axis through two fitted condyle balls.

    Each ball is fitted as by :func:`fitted_ball`. Condyles lie side by side, along the longest extent of the
    seeds. The balls are fitted to the points facing the opposite bone, or to the points protruding most from
    the line of the shaft, as at the back of a femur's condyles; the surer fit is taken. Eckhoff et al. 2007,
    *Difference between the epicondylar and cylindrical axis of the knee*, doi:10.1097/BLO.0b013e318112416b.
    """
    _check_enough(seeds)
    centre = points[seeds].mean(axis=0)
    beside = np.linalg.svd(points[seeds] - centre, full_matrices=False)[2][0]
    reach = float(np.abs((points[seeds] - centre) @ beside).max())
    end = np.linalg.norm(points - centre, axis=1) < 2.0 * reach
    away = centre - np.average(points, axis=0, weights=areas)
    along = away - (away @ beside) * beside
    along /= np.linalg.norm(along)
    back = (centre - points) @ along
    shaft = points[(back > 2.0 * reach) & (back < 4.0 * reach)]
    behind = np.cross(along, beside)
    if len(shaft):
        off = (points - shaft.mean(axis=0)) @ behind
        behind *= np.sign(off[end].max() + off[end].min())
    off = points @ behind
    protruding = end & (normals @ behind > 0.5) & (off > off[end].max() - 0.5 * reach)
    found, problem = [], None
    for start in (seeds, protruding) if len(shaft) else (seeds,):
        side = (points - points[start].mean(axis=0)) @ beside if start.any() else off
        try:
            pair = [fitted_ball(points, normals, areas, start & (side * sign > 0.0)) for sign in (1.0, -1.0)]
        except InputError as error:
            problem = error
            continue
        axis = pair[0].centre - pair[1].centre
        radius, rms = 0.5 * (pair[0].radius + pair[1].radius), max(one.rms for one in pair)
        length = float(np.linalg.norm(axis))
        # Two balls in one place give no axis.
        if length > 0.5 * radius:
            covered = min(one.covered for one in pair)
            middle = 0.5 * (pair[0].centre + pair[1].centre)
            found.append(JointFit(middle, axis / length, radius, rms, covered))
    if not found:
        raise problem or InputError("", "the bone has no two condyles", "give the axis yourself")
    return max(found, key=lambda one: one.confidence)


def _on(away: Floats, radius: float, normals: Floats) -> Bools:
    """Return a mask of outward points on the ball.

    ``away`` are the vectors from the centre of the ball to the points.
    """
    distance = np.linalg.norm(away, axis=1)
    facing = np.einsum("ij,ij->i", away, normals) > ALONG * distance
    on: Bools = (np.abs(distance - radius) < NEAR * radius) & facing
    return on


def _check_enough(chosen: Bools) -> None:
    if chosen.sum() < _FEWEST:
        raise InputError("", "the end of the bone at the joint is not round", "give the joint's centre")

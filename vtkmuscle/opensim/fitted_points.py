"""Points on bodies and cylinders between them, so that a path has the lengths and moment arms of fibres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.muscle_paths import STEP, Cylinder, PathPoint, PointPath
from vtkmuscle.opensim.tree import KinematicTree

#: A cylinder must leave less than this part of the error.
WORTH = 0.9
#: Where on its part of the line a cylinder begins, in turn, and with which radii [m]: a bone's, a joint's.
PLACES = (0.25, 0.5, 0.75)
RADII = (0.015, 0.04)
#: What a length [m] and a direction change alike, as the search takes it.
SCALES = (0.01, 0.3)
#: Steps of the search, at most; it is begun anew from each place of a cylinder.
STEPS = 40


def fit_points(
    line: Floats,
    tree: KinematicTree,
    values: Mapping[str, Floats],
    ends: tuple[str, str],
    lengths: Floats,
    arms: Mapping[str, Floats],
    *,
    tolerance: float,
) -> PointPath:
    """Return a path over points and round cylinders that has lengths and moment arms.

    Between the fibres' mean ends, which stay, the path has a via point on either side of each joint, and may
    wind round a cylinder there, on either body. Where all these are is found by least squares of the lengths
    and of the moment arms, these times half the range of their coordinate. A cylinder is added where it helps
    most, as long as the tolerance is not met, and only if the path goes round it one way in all poses.

    Parameters
    ----------
    line : (f, n, 3) array
        The mean of the fibres in each pose, in the frame of the tree's root [m].
    tree : KinematicTree
        The bodies [m].
    values : mapping of str to (f,) array
        Of its coordinates.
    ends : (str, str)
        The bodies of origin and insertion.
    lengths : (f,) array
        Of the fibres, on the mean [m].
    arms : mapping of str to (f,) array
        Their moment arms by coordinates [m, 1 by a slide].
    tolerance : float
        Of what least squares leave, root mean square [m].

    Returns
    -------
    PointPath
        In metres. Its points are fixed to their bodies.
    """
    search = _Search(tree, values, lengths, arms)
    poses = tree.poses(tree.completed(values))
    shapes = {
        body: np.einsum("fji,fnj->fni", poses[body][:, :3, :3], line - poses[body][:, None, :3, 3])
        for body in _between(tree, ends)
    }
    bodies, last = list(shapes), line.shape[1] - 1
    on = [bodies[0], *(body for joint in pairwise(bodies) for body in joint), bodies[-1]]
    # Where a part of the line moves least on its body is a place of a via point to begin with.
    edges = np.linspace(0, last, 2 * len(on) - 1).round().astype(int)[1::2]
    spreads = {body: shape.var(axis=0).sum(axis=1) for body, shape in shapes.items()}
    inner = zip(on[1:-1], pairwise(edges), strict=True)
    at = [0, *(low + int(spreads[body][low : high + 1].argmin()) for body, (low, high) in inner), last]
    points = [PathPoint(body, shapes[body][:, i].mean(axis=0)) for body, i in zip(on, at, strict=True)]
    begun = PointPath(points)
    best = search.refined(begun)
    while search.error(best) > tolerance:
        taken = {one.after for one in best.cylinders}
        tried = [
            search.refined(replace(begun, cylinders=[*best.cylinders, cylinder]))
            for after in range(1, len(points) - 2, 2)
            if after not in taken
            for body in on[after : after + 2]
            for cylinder in _beginnings(shapes[body].mean(axis=0)[at[after] : at[after + 1] + 1], body, after)
        ]
        tried = [path for path in tried if not search.flips(path)]
        better = min(tried, key=search.error, default=best)
        if search.error(better) > WORTH * search.error(best):
            break
        best = better
    return best


class _Search:
    """What a path is to have, and where the bodies are in the poses in which it is to have it."""

    def __init__(
        self, tree: KinematicTree, values: Mapping[str, Floats], lengths: Floats, arms: Mapping[str, Floats]
    ) -> None:
        full = tree.completed(values)
        self.frames = len(lengths)
        halves = {name: np.ptp(full[name]) / 2.0 for name in arms}
        self.halves = np.array([halves[name] for name in arms])
        self.wanted = np.concatenate([lengths, *(halves[name] * arm for name, arm in arms.items())])
        moves = [{}, *({name: sign * STEP} for name in arms for sign in (-1.0, 1.0))]
        columns = {
            name: np.concatenate([full[name] + move.get(name, 0.0) for move in moves]) for name in tree.free
        }
        self.full = tree.completed(columns)
        self.poses = tree.poses(self.full)

    def off(self, path: PointPath) -> Floats:
        """Return by how much a path is longer, and its moment arms greater, in metres."""
        found = path.lengths_at(self.poses, self.full, self.full, {}).reshape(-1, self.frames)
        slopes = (found[1::2] - found[2::2]) / (2.0 * STEP)
        result: Floats = np.concatenate([found[0], (self.halves[:, None] * slopes).ravel()]) - self.wanted
        return result

    def error(self, path: PointPath) -> float:
        """Return the root mean square of that."""
        return float(np.sqrt((self.off(path) ** 2).mean()))

    def flips(self, path: PointPath) -> bool:
        """Return whether a path goes round a cylinder one way in some poses and the other way in others.

        Between these its moment arm jumps.
        """
        places = path.places(self.poses, self.full, {})
        for one in path.cylinders:
            first, second = places[one.after : one.after + 2]
            turns = one.ways(self.poses[one.body], first, second)[1]
            if turns.min() < 0.0 < turns.max():
                return True
        return False

    def refined(self, path: PointPath) -> PointPath:
        """Return the path with its via points and cylinders where they err least."""
        bodies = [point.body for point in path.points]
        first, last = path.points[0], path.points[-1]
        kept = path.cylinders
        middle = len(bodies) - 2

        def made(numbers: Floats) -> PointPath:
            places = SCALES[0] * numbers[: 3 * middle].reshape(-1, 3)
            points = [PathPoint(body, place) for body, place in zip(bodies[1:-1], places, strict=True)]
            rows = numbers[3 * middle :].reshape(-1, 7)
            cylinders = [
                replace(
                    one,
                    centre=SCALES[0] * row[:3],
                    axis=row[3:6] / np.linalg.norm(row[3:6]),
                    radius=SCALES[0] * abs(row[6]),
                )
                for one, row in zip(kept, rows, strict=True)
            ]
            return PointPath([first, *points, last], (), cylinders)

        begun = np.concatenate(
            [
                *(np.asarray(point.place) / SCALES[0] for point in path.points[1:-1]),
                *(
                    np.array([*one.centre / SCALES[0], *one.axis / SCALES[1], one.radius / SCALES[0]])
                    for one in kept
                ),
            ]
        )
        found = least_squares(lambda numbers: self.off(made(numbers)) / SCALES[0], begun, max_nfev=STEPS)
        return made(found.x)


def _beginnings(line: Floats, body: str, after: int) -> Iterator[Cylinder]:
    """Give cylinders on the inner side of a line (n, 3), on a body."""
    chord = line[-1] - line[0]
    chord = chord / np.linalg.norm(chord)
    for place in PLACES:
        top = line[round(place * (len(line) - 1))]
        bow = top - line[0] - ((top - line[0]) @ chord) * chord
        height = np.linalg.norm(bow)
        if height > 0.0:
            axis = np.cross(chord, bow / height)
            for radius in RADII:
                yield Cylinder(body, top - radius * bow / height, axis, radius, after)


def _between(tree: KinematicTree, ends: Sequence[str]) -> list[str]:
    """Return the bodies on the way from one to another."""
    first, second = ([body, *(joint.parent for joint in tree.way_up(body))] for body in ends)
    common = next(body for body in first if body in second)
    way = [*first[: first.index(common) + 1], *reversed(second[: second.index(common)])]
    return list(dict.fromkeys(way))

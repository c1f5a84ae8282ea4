"""A few points on bodies for a fibre's path: fixed ones, and ones that move with a coordinate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vtkmuscle.core.motion.frames import inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.functions import CubicSpline
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath
from vtkmuscle.opensim.tree import KinematicTree

#: Knots of a moving point's splines, at most.
KNOTS = 9
#: A further point must leave less than this part of the error.
WORTH = 0.98


@dataclass(frozen=True, eq=False)
class PointFit:
    """A path over a few points, and how far its length is from the fibre's.

    Attributes
    ----------
    path : PointPath
        In the tree's unit.
    error, largest_error : float
        Root mean square and largest over the poses, of the length's change.
    offset : float
        Mean by which the fibre is longer: a path over few points cuts corners.
    """

    path: PointPath
    error: float
    largest_error: float
    offset: float


def fit_points(
    points: Floats,
    tree: KinematicTree,
    values: Mapping[str, Floats],
    ends: tuple[str, str],
    *,
    tolerance: float,
    most: int = 8,
    moving: bool = True,
) -> PointFit:
    """Return a path over a few of a fibre's points that lengthens as the fibre does.

    It begins with the fibre's ends, fixed to their bodies. Of the points in between, that one is added, on
    that body, by which the length errs least, until it errs by less than the tolerance or nothing helps. A
    point that moves on its body follows splines of one coordinate; it stands only where both its neighbours
    are on other bodies, for OpenSim's moment arms leave out lengths within one body.

    Parameters
    ----------
    points : (f, n, 3) array
        Of the fibre in each pose, in the frame of the tree's root.
    tree : KinematicTree
        The bodies.
    values : mapping of str to (f,) array
        Of its coordinates.
    ends : (str, str)
        The bodies of origin and insertion.
    tolerance : float
        Of the change of length, root mean square.
    most : int, optional
        Points of the path, at most.
    moving : bool, optional
        Whether points may move on their bodies; False for what has none, as MuJoCo.

    Returns
    -------
    PointFit
        The path and its error.
    """
    full = tree.completed(values)
    poses = tree.poses(full)
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    bodies = _between(tree, ends)
    local = {
        body: np.einsum(
            "fij,fnj->fni", inverses(poses[body])[:, :3, :3], points - poses[body][:, None, :3, 3]
        )
        for body in bodies
    }
    last = points.shape[1] - 1
    chosen: dict[int, PathPoint] = {
        0: PathPoint(ends[0], local[ends[0]][:, 0].mean(axis=0)),
        last: PathPoint(ends[1], local[ends[1]][:, last].mean(axis=0)),
    }
    best = _fit(chosen, tree, full, lengths)
    names = tree.crossed(ends) if moving else ()
    while best.error > tolerance and len(chosen) < most:
        tried = [
            (more, _fit(more, tree, full, lengths)) for more in _with_one_more(chosen, local, full, names)
        ]
        more, better = min(tried, key=lambda one: one[1].error, default=(chosen, best))
        if better.error > WORTH * best.error:
            break
        chosen, best = more, better
    return best


def _with_one_more(
    chosen: Mapping[int, PathPoint],
    local: Mapping[str, Floats],
    full: Mapping[str, Floats],
    names: Sequence[str],
) -> Iterator[dict[int, PathPoint]]:
    """Give the chosen points with another one, on each body, fixed or moving."""
    count = next(iter(local.values())).shape[1]
    for number in range(1, count - 1):
        if number in chosen:
            continue
        for body, places in local.items():
            fixed = PathPoint(body, places[:, number].mean(axis=0))
            for point in (fixed, *(_moving(fixed, places[:, number], name, full[name]) for name in names)):
                more = {**chosen, number: point}
                if _apart(_in_order(more)):
                    yield more


def _in_order(chosen: Mapping[int, PathPoint]) -> list[PathPoint]:
    return [chosen[number] for number in sorted(chosen)]


def _apart(points: Sequence[PathPoint]) -> bool:
    """Return whether no moving point has a neighbour on its own body."""
    return not any(a.body == b.body and (a.moves or b.moves) for a, b in pairwise(points))


def _moving(point: PathPoint, places: Floats, name: str, values: Floats) -> PathPoint:
    """Return a point that follows splines of a coordinate through the means of its places."""
    levels = np.unique(values.round(6))
    if len(levels) > KNOTS:
        levels = np.unique(np.linspace(values.min(), values.max(), KNOTS).round(6))
    nearest = np.abs(values[:, None] - levels).argmin(axis=1)
    used = np.unique(nearest)
    if len(used) < 2:
        return point
    means = np.array([places[nearest == knot].mean(axis=0) for knot in used])
    knots = np.array([values[nearest == knot].mean() for knot in used])
    splines = [CubicSpline(knots, means[:, axis]) for axis in range(3)]
    return replace(point, place=means.mean(axis=0), functions=splines, coordinates=(name,) * 3)


def _fit(
    chosen: Mapping[int, PathPoint], tree: KinematicTree, full: Mapping[str, Floats], lengths: Floats
) -> PointFit:
    path = PointPath(_in_order(chosen))
    off = lengths - path.lengths(tree, full)
    change = off - off.mean()
    return PointFit(path, float(np.sqrt((change**2).mean())), float(np.abs(change).max()), float(off.mean()))


def _between(tree: KinematicTree, ends: tuple[str, str]) -> list[str]:
    """Return the bodies on the way from one to another."""
    parents = {joint.child: joint.parent for joint in tree.joints}

    def up(body: str) -> list[str]:
        found = [body]
        while found[-1] in parents:
            found.append(parents[found[-1]])
        return found

    first, second = up(ends[0]), up(ends[1])
    common = next(body for body in first if body in second)
    way = [*first[: first.index(common) + 1], *reversed(second[: second.index(common)])]
    return list(dict.fromkeys(way))

"""Paths fitted to lengths and moment arms: polynomials of coordinates, and points with cylinders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import comb

import numpy as np
from scipy.optimize import least_squares

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.muscle_paths import STEP, Cylinder, FunctionPath, PathPoint, PointPath, powers, terms

#: Parts of the values of each coordinate, at most. Poses of each but the outer two are held back, and the
#: order is chosen by the errors of a fit of the others there: between the levels of a grid as well.
PARTS = 5
#: The part by which a higher order must lessen the error at held-back poses.
WORTH = 0.05
#: Terms of a polynomial, at most, for each number that is fitted.
FILLED = 0.7
#: The highest sum of powers that is tried.
HIGHEST_ORDER = 6


def fit_length(
    lengths: Floats, values: Mapping[str, Floats], arms: Mapping[str, Floats] | None = None
) -> FunctionPath:
    """Return the polynomial of coordinates that gives lengths (f,) best in poses that it was not fitted to.

    ``values`` (f,) are of the coordinates that it depends on [radians, or their unit of length]; those that
    do not change are left out. Where moment arms -dl/dq (f,) are known, its derivatives are fitted to them
    too, each coordinate counted in half its range: few poses of a grid do then for several coordinates. Its
    order is the least whose error at poses that were held back is within 5 % of the best.

    Raises
    ------
    ValueError
        If no coordinate changes, or there are fewer poses than a straight line needs.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.fitted_paths import fit_length
    >>> knee = np.linspace(0.0, 2.0, 30)
    >>> fit_length(0.3 - 0.04 * knee + 0.01 * knee**2, {"knee": knee}).order
    2
    """
    moving = {name: column for name, column in values.items() if np.ptp(column) > 1e-9}
    if not moving:
        raise InputError("", "no coordinate changes over the poses, so a length is no function of one")
    samples = np.column_stack(list(moving.values()))
    # Powers are taken about the middle, in half ranges: high ones of plain radians are nearly the same.
    middle, half = samples.mean(axis=0), np.ptp(samples, axis=0) / 2.0
    scaled = (samples - middle) / half
    slopes = {i: -half[i] * arms[name] for i, name in enumerate(moving) if arms and name in arms}
    known = np.concatenate([lengths, *slopes.values()])
    held_back = [np.tile(held, 1 + len(slopes)) for held in _held_back(samples)]
    # A coordinate of k values has a polynomial of order k - 1 through them, 2 k - 1 with its slopes there.
    levels = min(
        (2 if i in slopes else 1) * len(np.unique(column.round(9))) for i, column in enumerate(samples.T)
    )
    errors: dict[int, float] = {}
    for order in range(1, HIGHEST_ORDER + 1):
        count = len(powers(samples.shape[1], order))
        if count > FILLED * min((~held).sum() for held in held_back) or order >= levels:
            break
        rows = np.vstack([terms(scaled, order), *(_slopes(scaled, order, i) for i in slopes)])
        off = [rows[held] @ _solved(rows[~held], known[~held]) - known[held] for held in held_back]
        errors[order] = float(np.sqrt((np.concatenate(off) ** 2).mean()))
    if not errors:
        raise InputError(
            "", f"{len(lengths)} poses are too few for a polynomial of {samples.shape[1]} coordinates"
        )
    least = min(errors.values())
    tiny = 1e-12 * float(np.abs(lengths).max())
    order = next(one for one, error in errors.items() if error <= (1.0 + WORTH) * least + tiny)
    rows = np.vstack([terms(scaled, order), *(_slopes(scaled, order, i) for i in slopes)])
    return FunctionPath(tuple(moving), order, _unscaled(_solved(rows, known), middle, half, order))


def _held_back(samples: Floats) -> list[Bools]:
    """Return the poses (f,) that are held back together, of samples (f, d)."""
    found = []
    for column in samples.T.round(9):
        levels = np.unique(column)
        parts = np.array_split(levels, min(PARTS, len(levels)))
        found += [np.isin(column, part) for part in parts[1:-1]]
    if found:
        return found
    numbers = np.random.default_rng(0).permutation(len(samples)) % PARTS
    return [numbers == number for number in range(PARTS) if number in numbers]


def _slopes(samples: Floats, order: int, variable: int) -> Floats:
    """Return the derivatives (f, m) of a polynomial's terms by one of its variables."""
    table = powers(samples.shape[1], order)
    factors = table[:, variable].astype(np.float64)
    table[:, variable] = np.maximum(table[:, variable] - 1, 0)
    result: Floats = factors * np.prod(samples[:, None, :] ** table, axis=2)
    return result


def _solved(rows: Floats, known: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(rows, known, rcond=None)[0], dtype=np.float64)


def _unscaled(coefficients: Floats, middle: Sequence[float] | Floats, half: Floats, order: int) -> Floats:
    """Return the coefficients for plain coordinates of a polynomial of scaled ones."""
    table = powers(len(half), order)
    place = {tuple(row): number for number, row in enumerate(table)}
    result = np.zeros(len(table))
    for coefficient, row in zip(coefficients, table, strict=True):
        # (q - m)^p / h^p, multiplied out one coordinate after the other.
        parts: dict[tuple[int, ...], float] = {(): float(coefficient)}
        for power, centre, width in zip(row, middle, half, strict=True):
            parts = {
                (*done, low): value * comb(int(power), low) * (-centre) ** (int(power) - low) / width**power
                for done, value in parts.items()
                for low in range(int(power) + 1)
            }
        for powers_of, value in parts.items():
            result[place[powers_of]] += value
    return result


#: A cylinder must leave less than this part of the error.
WORTH_A_CYLINDER = 0.9
#: Where on its part of the line a cylinder is placed first, and with which radii [m]: a bone's, a joint's.
PLACES = (0.25, 0.5, 0.75)
RADII = (0.015, 0.04)
#: Steps of a length [m] and of a direction that the search takes for equal.
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
    wind round a cylinder there, on either body. Points and cylinders are placed by least squares of the
    lengths and of the moment arms, these times half the range of their coordinate. Until the error is within
    the tolerance, a cylinder is added where it helps most, if the path goes round it one way in all poses.

    ``line`` (f, n, 3) is the mean of the fibres in each pose, in the frame of the tree's root [m], ``values``
    (f,) are the coordinates there. ``ends`` are the bodies of origin and insertion, ``lengths`` and ``arms``
    (f,) the mean length of the fibres [m] and their moment arms by coordinates [m, 1 by a slide]. The
    tolerance is for the root mean square error [m].
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
        if search.error(better) > WORTH_A_CYLINDER * search.error(best):
            break
        best = better
    return best


class _Search:
    """The lengths and moment arms that a path is fitted to, and the poses of the bodies there."""

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
        """Return the errors of a path's lengths, and of its moment arms times half ranges [m]."""
        found = path.lengths_at(self.poses, self.full, self.full, {}).reshape(-1, self.frames)
        slopes = (found[1::2] - found[2::2]) / (2.0 * STEP)
        result: Floats = np.concatenate([found[0], (self.halves[:, None] * slopes).ravel()]) - self.wanted
        return result

    def error(self, path: PointPath) -> float:
        """Return their root mean square."""
        return float(np.sqrt((self.off(path) ** 2).mean()))

    def flips(self, path: PointPath) -> bool:
        """Return whether a path goes round a cylinder both ways: its moment arm jumps in between."""
        places = path.places(self.poses, self.full, {})
        for one in path.cylinders:
            first, second = places[one.after : one.after + 2]
            turns = one.ways(self.poses[one.body], first, second)[1]
            if turns.min() < 0.0 < turns.max():
                return True
        return False

    def refined(self, path: PointPath) -> PointPath:
        """Return the path with the via points and cylinders that have the least error."""
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

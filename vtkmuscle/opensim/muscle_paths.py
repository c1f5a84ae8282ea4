"""Paths of muscles over points and round cylinders, and paths that are functions: lengths and moment arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.opensim.functions import CoordinateFunction
from vtkmuscle.opensim.tree import KinematicTree

#: How far beyond its range a conditional point still counts [radians, or units of length], as in OpenSim.
RANGE_MARGIN = 1e-5
#: A length that is none, against divisions by it.
TINY = 1e-300
#: Step of the central difference for moment arms [radians, or units of length].
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A point of a path, on a body.

    Parameters
    ----------
    body : str
        The body that it moves with.
    place : (3,) array_like, optional
        Where, in the body's frame; what does not follow a function.
    functions : sequence of (CoordinateFunction or None), optional
        x, y and z as functions of ``coordinates``, for a point that moves on its body.
    coordinates : sequence of (str or None), optional
        What they are functions of.
    only_in : (str, float, float), optional
        The point counts while this coordinate is between these values only.
    """

    body: str
    place: ArrayLike = (0.0, 0.0, 0.0)
    functions: Sequence[CoordinateFunction | None] = (None, None, None)
    coordinates: Sequence[str | None] = (None, None, None)
    only_in: tuple[str, float, float] | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves on its body."""
        return any(function is not None for function in self.functions)

    def places(
        self, values: Mapping[str, Floats], frames: int, ranges: Mapping[str, tuple[float, float] | None]
    ) -> Floats:
        """Return where it is in its body's frame (f, 3); beyond its coordinate's range it stays."""
        result = np.tile(np.asarray(self.place, dtype=np.float64), (frames, 1))
        for number, (function, name) in enumerate(zip(self.functions, self.coordinates, strict=True)):
            if function is not None:
                at = np.zeros(frames) if name is None else values[name]
                limits = None if name is None else ranges.get(name)
                result[:, number] = function(at if limits is None else np.clip(at, *limits))
        return result

    def counts(self, values: Mapping[str, Floats], frames: int) -> Bools:
        """Return in which frames (f,) it is part of the path."""
        if self.only_in is None:
            return np.ones(frames, dtype=np.bool_)
        name, low, high = self.only_in
        return (values[name] >= low - RANGE_MARGIN) & (values[name] <= high + RANGE_MARGIN)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder without ends, round which a path winds the shorter way between two of its points.

    Parameters
    ----------
    body : str
        The body that it moves with.
    centre, axis : (3,) array
        A point on its axis, and the direction of that, in the body's frame.
    radius : float
        Of the same unit.
    after : int
        Number of the path's point that is followed by it, counted from 0.
    """

    body: str
    centre: Floats
    axis: Floats
    radius: float
    after: int

    @property
    def frame(self) -> Floats:
        """A frame (3, 3) whose z axis is that of the cylinder."""
        z = self.axis / np.linalg.norm(self.axis)
        x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(z, x), z])

    def lengths(self, pose: Floats, first: Floats, second: Floats) -> Floats:
        """Return the way (f,) from points (f, 3) to others, straight where that misses the cylinder.

        Parameters
        ----------
        pose : (f, 4, 4) array
            Of its body.
        first, second : (f, 3) array
            Where the points are. Seen along the axis the way is two tangents and an arc; unrolled, it is
            straight.
        """
        return self.ways(pose, first, second)[0]

    def ways(self, pose: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
        """Return the ways, and which way round they go (f,): 1 or -1 about the axis, 0 where it is missed."""
        z = self.axis / np.linalg.norm(self.axis)
        a, b = (np.einsum("fji,fj->fi", pose[:, :3, :3], one - pose[:, :3, 3]) for one in (first, second))
        along = (b - a) @ z
        a, b = (one - self.centre - ((one - self.centre) @ z)[:, None] * z for one in (a, b))
        way = b - a
        straight = np.linalg.norm(way, axis=1)
        part = np.clip(-(a * way).sum(axis=1) / np.maximum(straight, TINY) ** 2, 0.0, 1.0)
        misses = np.linalg.norm(a + part[:, None] * way, axis=1) >= self.radius
        far = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        cosine = (a * b).sum(axis=1) / np.maximum(far[0] * far[1], TINY)
        arc = np.arccos(np.clip(cosine, -1.0, 1.0))
        tangents = np.zeros(len(arc))
        for one in far:
            misses |= one <= self.radius
            arc -= np.arccos(np.minimum(self.radius / np.maximum(one, TINY), 1.0))
            tangents += np.sqrt(np.maximum(one**2 - self.radius**2, 0.0))
        planar = np.where(misses, straight, tangents + self.radius * np.maximum(arc, 0.0))
        turns: Floats = np.where(misses, 0.0, np.sign(np.cross(a, b) @ z))
        return np.hypot(planar, along), turns


@dataclass(frozen=True, eq=False)
class PointPath:
    """Straight lines from point to point, and round cylinders.

    Parameters
    ----------
    points : sequence of PathPoint
        From origin to insertion.
    wraps : sequence of str, optional
        Names of surfaces that it winds round, which is not computed here.
    cylinders : sequence of Cylinder, optional
        Those that it winds round, one at most between two points.
    """

    points: Sequence[PathPoint]
    wraps: Sequence[str] = ()
    cylinders: Sequence[Cylinder] = ()

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that it touches, in order."""
        return tuple(dict.fromkeys(point.body for point in self.points))

    def coordinates(self, tree: KinematicTree) -> tuple[str, ...]:
        """Return the free coordinates that its length may depend on."""
        own = {name for point in self.points for name in point.coordinates if name is not None}
        own |= {point.only_in[0] for point in self.points if point.only_in is not None}
        return tree.freed({*own, *tree.crossed(self.bodies)})

    def lengths(
        self,
        tree: KinematicTree,
        values: Mapping[str, ArrayLike],
        *,
        counted_at: Mapping[str, ArrayLike] | None = None,
    ) -> Floats:
        """Return the length (f,) for values of the coordinates, in the tree's unit.

        Conditional points count as they do at other values, where such are given.

        Raises
        ------
        ValueError
            If it winds round surfaces, or there is no such coordinate.
        """
        if self.wraps:
            raise InputError(
                "",
                f"the path winds round {', '.join(self.wraps)}: wrapping is not computed here; take its "
                "length from OpenSim, or take the muscle's fibres instead",
            )
        full = tree.completed(values)
        held = full if counted_at is None else tree.completed(counted_at)
        ranges = {one.name: one.range for one in tree.coordinates}
        return self.lengths_at(tree.poses(full), full, held, ranges)

    def places(
        self,
        poses: Mapping[str, Floats],
        full: Mapping[str, Floats],
        ranges: Mapping[str, tuple[float, float] | None],
    ) -> Floats:
        """Return where its points are (n, f, 3), in the frame of the tree's root, where the bodies are."""
        frames = len(next(iter(poses.values())))
        found = [
            np.einsum("fij,fj->fi", poses[one.body][:, :3, :3], one.places(full, frames, ranges))
            + poses[one.body][:, :3, 3]
            for one in self.points
        ]
        return np.array(found).reshape(-1, frames, 3)

    def lengths_at(
        self,
        poses: Mapping[str, Floats],
        full: Mapping[str, Floats],
        held: Mapping[str, Floats],
        ranges: Mapping[str, tuple[float, float] | None],
    ) -> Floats:
        """Return the length (f,) where the bodies are known (f, 4, 4), and what points go by."""
        frames = len(next(iter(poses.values())))
        winds = {one.after: one for one in self.cylinders}
        total = np.zeros(frames)
        last = np.zeros((frames, 3))
        begun = np.zeros(frames, dtype=np.bool_)
        with np.errstate(over="ignore", invalid="ignore"):
            places = self.places(poses, full, ranges)
            for number, (point, place) in enumerate(zip(self.points, places, strict=True)):
                counted = point.counts(held, frames)
                round_it = winds.get(number - 1)
                if round_it is None:
                    way = np.linalg.norm(place - last, axis=1)
                else:
                    way = round_it.lengths(poses[round_it.body], last, place)
                total += np.where(counted & begun, way, 0.0)
                last[counted] = place[counted]
                begun |= counted
        if not np.isfinite(total).all():
            raise InputError("", "the path is longer than all numbers; check its points")
        return total


@dataclass(frozen=True, eq=False)
class FunctionPath:
    """A path that is nothing but its length, a polynomial of coordinates.

    Parameters
    ----------
    names : sequence of str
        The d coordinates [radians, or their unit of length].
    order : int
        Highest sum of powers.
    coefficients : (m,) array
        Of the terms in the order of :func:`powers`.
    """

    names: Sequence[str]
    order: int
    coefficients: Floats

    def coordinates(self, tree: KinematicTree) -> tuple[str, ...]:
        """Return the coordinates that its length depends on."""
        del tree
        return tuple(self.names)

    def lengths(
        self,
        tree: KinematicTree,
        values: Mapping[str, ArrayLike],
        *,
        counted_at: Mapping[str, ArrayLike] | None = None,
    ) -> Floats:
        """Return the length (f,) for values of the coordinates."""
        del counted_at
        full = tree.completed(values)
        samples = np.column_stack([full[name] for name in self.names])
        return terms(samples, self.order) @ self.coefficients


def powers(dimension: int, order: int) -> Ints:
    """Return the powers (m, d) of the terms of a polynomial of d variables, in OpenSim's order.

    Examples
    --------
    >>> from vtkmuscle.opensim.muscle_paths import powers
    >>> powers(2, 2).tolist()
    [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [2, 0]]
    """
    found = [
        tuple(np.bincount(chosen, minlength=dimension)) if chosen else (0,) * dimension
        for total in range(order + 1)
        for chosen in combinations_with_replacement(range(dimension), total)
    ]
    return np.array(sorted(found), dtype=np.int64).reshape(-1, dimension)


def terms(samples: Floats, order: int) -> Floats:
    """Return the terms (f, m) of a polynomial at samples (f, d)."""
    result: Floats = np.prod(samples[:, None, :] ** powers(samples.shape[1], order), axis=2)
    return result


def moment_arm(
    path: PointPath | FunctionPath, tree: KinematicTree, values: Mapping[str, ArrayLike], coordinate: str
) -> Floats:
    """Return the moment arm -dl/dq (f,) of a path by a coordinate, what it couples following.

    Parameters
    ----------
    path : PointPath or FunctionPath
        Of the muscle.
    tree : KinematicTree
        Of its bodies.
    values : mapping of str to (f,) array_like
        Of the coordinates.
    coordinate : str
        By which.

    Returns
    -------
    (f,) array
        In the tree's unit of length by an angle; without a unit by a translation. A central difference, with
        the conditional points that count at these values.
    """
    tree.coordinate(coordinate)
    full = tree.completed(values)
    ends = [
        path.lengths(tree, full | {coordinate: full[coordinate] + step}, counted_at=full)
        for step in (-STEP, STEP)
    ]
    return (ends[0] - ends[1]) / (2.0 * STEP)

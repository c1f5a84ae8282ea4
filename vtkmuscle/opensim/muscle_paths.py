"""Paths of muscles over points and round cylinders, and paths that are functions: lengths and moment arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.joints.functions import CoordinateFunction
from vtkmuscle.joints.tree import KinematicTree

#: How far beyond its range a conditional point still counts [radians, or units of length], as in OpenSim.
RANGE_MARGIN = 1e-5
#: A length that is none, against divisions by it.
TINY = 1e-300
#: Step of the central difference for moment arms [radians, or units of length].
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A point of a path, at a place (3,) on a body.

    A point that moves on its body has ``functions`` of ``coordinates`` for x, y and z, or None where the
    place holds. ``only_in`` names a coordinate, and its least and largest value at which the point counts.
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

    ``centre`` and ``axis`` (3,) are a point on its axis and the direction of that, in the body's frame;
    ``after`` is the number of the path's point before it, counted from 0.
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

    def ways(self, pose: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
        """Return the lengths (f,) of ways from points (f, 3) to others, where the body's pose is (f, 4, 4).

        Seen along the axis a way is two tangents and an arc; unrolled, it is straight. The second result is
        the direction in which it goes round (f,): 1 or -1 about the axis, 0 where it misses the cylinder.
        """
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
    """Straight lines from point to point, origin to insertion, and round cylinders.

    ``wraps`` are names of OpenSim's surfaces that it winds round, which is not computed here; ``cylinders``
    are, one at most between two points.
    """

    points: Sequence[PathPoint]
    wraps: Sequence[str] = ()
    cylinders: Sequence[Cylinder] = ()

    @property
    def named(self) -> set[str]:
        """The coordinates that its points move by, or count by."""
        moving = {name for point in self.points for name in point.coordinates if name is not None}
        return moving | {point.only_in[0] for point in self.points if point.only_in is not None}

    def coordinates(self, tree: KinematicTree) -> tuple[str, ...]:
        """Return the free coordinates that its length may depend on."""
        return tree.freed({*self.named, *tree.crossed([point.body for point in self.points])})

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
        """Return the length (f,) for poses of the bodies (f, 4, 4).

        Points move by the values ``full`` (f,) of the coordinates, and count by the values ``held`` (f,).
        """
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
                    way = round_it.ways(poses[round_it.body], last, place)[0]
                total += np.where(counted & begun, way, 0.0)
                last[counted] = place[counted]
                begun |= counted
        if not np.isfinite(total).all():
            raise InputError("", "the path is longer than all numbers; check its points")
        return total


@dataclass(frozen=True, eq=False)
class FunctionPath:
    """A path that is only its length, a polynomial of d coordinates [radians, or their unit of length].

    ``order`` is the highest sum of powers; the coefficients (m,) are in the order of :func:`powers`.
    """

    names: Sequence[str]
    order: int
    coefficients: Floats

    @property
    def named(self) -> set[str]:
        """The coordinates that it is a function of."""
        return set(self.names)

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
    """Return the moment arm -dl/dq (f,) of a path by a coordinate, for values (f,) of the coordinates.

    It is in the tree's unit of length by an angle, without a unit by a translation: a central difference,
    with the conditional points that count at these values. Coupled coordinates follow.
    """
    tree.coordinate(coordinate)
    full = tree.completed(values)
    ends = [
        path.lengths(tree, full | {coordinate: full[coordinate] + step}, counted_at=full)
        for step in (-STEP, STEP)
    ]
    return (ends[0] - ends[1]) / (2.0 * STEP)

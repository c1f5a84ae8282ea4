"""Muscle paths over points, round cylinders and as functions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations_with_replacement
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import perpendiculars
from vtkmuscle.core.types import TINY, Bools, Floats, Ints
from vtkmuscle.joints.functions import CoordinateFunction
from vtkmuscle.joints.tree import HALF_STEP, KinematicTree

#: Margin of a conditional point's range [rad, or units of length], as in OpenSim.
RANGE_MARGIN = 1e-5
#: Columns (f,) or poses (f, 4, 4) by name; values of coordinates.
Columns = Mapping[str, Floats]
Values = Mapping[str, ArrayLike]


class Posed(NamedTuple):
    """Bodies in poses: values (f,) of all coordinates, frames (f, 4, 4) of bodies, ranges of coordinates."""

    values: Columns
    bodies: Columns
    ranges: Mapping[str, tuple[float, float] | None]

    @classmethod
    def of(cls, tree: KinematicTree, values: Values, on: Iterable[str] | None = None) -> Self:
        """Return a tree's bodies ``on``, by default all, for values of coordinates."""
        full = tree.completed(values)
        return cls(full, tree.poses(full, on), {each.name: each.range for each in tree.coordinates})

    @property
    def frames(self) -> int:
        """Number of poses."""
        return len(next(iter(self.bodies.values())))


@dataclass(frozen=True, eq=False)
class PathPoint:
    """A point of a path: fixed, moving or conditional.

    A moving point has functions of coordinates for x, y and z. A conditional point is in the path while the
    coordinate in ``only_in`` lies between two values. ``position`` (3,) is in the body's frame.
    """

    body: str
    position: ArrayLike = (0.0, 0.0, 0.0)
    functions: Sequence[CoordinateFunction | None] = (None, None, None)
    coordinates: Sequence[str | None] = (None, None, None)
    only_in: tuple[str, float, float] | None = None

    @property
    def moves(self) -> bool:
        """Whether the point moves on its body."""
        return any(function is not None for function in self.functions)

    def positions(self, at: Posed) -> Floats:
        """Return positions (f, 3) in the root's frame, constant on the body beyond a coordinate's range."""
        result = np.tile(np.asarray(self.position, dtype=np.float64), (at.frames, 1))
        for number, (function, name) in enumerate(zip(self.functions, self.coordinates, strict=True)):
            if function is not None:
                values = np.zeros(at.frames) if name is None else at.values[name]
                limits = at.ranges.get(name or "")
                result[:, number] = function(values if limits is None else np.clip(values, *limits))
        body = at.bodies[self.body]
        return np.asarray(np.einsum("fij,fj->fi", body[:, :3, :3], result) + body[:, :3, 3])

    def counts(self, values: Columns) -> Bools | bool:
        """Return the frames (f,) with the point in the path."""
        if self.only_in is None:
            return True
        name, low, high = self.only_in
        return (values[name] >= low - RANGE_MARGIN) & (values[name] <= high + RANGE_MARGIN)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """An endless cylinder on a body: a path takes the shorter side round it.

    ``centre`` and ``axis`` (3,) are in the body's frame; ``after`` is the index of the path point before.
    """

    body: str
    centre: Floats
    axis: Floats
    radius: float
    after: int

    @property
    def frame(self) -> Floats:
        """A frame (3, 3) with z along the axis."""
        z = self.axis / np.linalg.norm(self.axis)
        return np.column_stack([*perpendiculars(z), z])

    def segments(self, pose: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
        """Return lengths and sides (f,) of segments between points (f, 3).

        ``pose`` (f, 4, 4) is the body's. Seen along the axis, a segment is two tangents and an arc; unrolled,
        a straight line. Sides are 1 or -1 about the axis, and 0 for a segment that misses the cylinder.
        """
        z = self.axis / np.linalg.norm(self.axis)
        a, b = (np.einsum("fji,fj->fi", pose[:, :3, :3], end - pose[:, :3, 3]) for end in (first, second))
        along = (b - a) @ z
        a, b = (end - self.centre - ((end - self.centre) @ z)[:, None] * z for end in (a, b))
        chord = b - a
        straight = np.linalg.norm(chord, axis=1)
        part = np.clip(-(a * chord).sum(axis=1) / np.maximum(straight, TINY) ** 2, 0.0, 1.0)
        misses = np.linalg.norm(a + part[:, None] * chord, axis=1) >= self.radius
        distances = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        cosine = (a * b).sum(axis=1) / np.maximum(distances[0] * distances[1], TINY)
        arc = np.arccos(np.clip(cosine, -1.0, 1.0))
        tangents = np.zeros(len(arc))
        for distance in distances:
            misses |= distance <= self.radius
            arc -= np.arccos(np.minimum(self.radius / np.maximum(distance, TINY), 1.0))
            tangents += np.sqrt(np.maximum(distance**2 - self.radius**2, 0.0))
        planar = np.where(misses, straight, tangents + self.radius * np.maximum(arc, 0.0))
        sides: Floats = np.where(misses, 0.0, np.sign(np.cross(a, b) @ z))
        return np.hypot(planar, along), sides


class MusclePath:
    """A path with a length in each pose."""

    def lengths_at(self, at: Posed, switching: Columns | None = None) -> Floats:
        """Return the lengths (f,). ``switching`` values, by default of the poses, decide on points."""
        raise NotImplementedError

    def lengths(self, tree: KinematicTree, values: Values) -> Floats:
        """Return the lengths (f,) for values (f,) of coordinates, in the tree's unit."""
        return self.lengths_at(Posed.of(tree, values))


@dataclass(frozen=True, eq=False)
class PointPath(MusclePath):
    """Straight lines from origin to insertion, over points and round cylinders.

    ``wraps`` are names of OpenSim's wrapping surfaces, without lengths here; of a path of an unsupported
    class, without points, the class. At most 1 cylinder lies between two points.
    """

    points: Sequence[PathPoint]
    wraps: Sequence[str] = ()
    cylinders: Sequence[Cylinder] = ()

    @property
    def named(self) -> set[str]:
        """Coordinates that move points or switch points on and off."""
        moving = {name for point in self.points for name in point.coordinates if name is not None}
        return moving | {point.only_in[0] for point in self.points if point.only_in is not None}

    def coordinates(self, tree: KinematicTree) -> tuple[str, ...]:
        """Return the free coordinates that affect the length: all for an unsupported class."""
        if not self.points:
            return tree.free
        return tree.freed({*self.named, *tree.crossed([point.body for point in self.points])})

    def positions(self, at: Posed) -> Floats:
        """Return the points (n, f, 3) in the root's frame."""
        return np.array([point.positions(at) for point in self.points]).reshape(-1, at.frames, 3)

    def lengths_at(self, at: Posed, switching: Columns | None = None) -> Floats:
        """Return the lengths (f,). A path that winds round surfaces raises a ValueError."""
        if self.wraps:
            problem = f"the path winds round {', '.join(self.wraps)}: wrapping is not computed here"
            raise InputError("", problem, "take the length from OpenSim, or export the muscle's fibres")
        cylinders = {cylinder.after: cylinder for cylinder in self.cylinders}
        total, previous = np.zeros(at.frames), np.zeros((at.frames, 3))
        started = np.zeros(at.frames, dtype=np.bool_)
        with np.errstate(over="ignore", invalid="ignore"):
            for number, (point, position) in enumerate(zip(self.points, self.positions(at), strict=True)):
                counted = np.broadcast_to(point.counts(switching or at.values), at.frames)
                cylinder = cylinders.get(number - 1)
                if cylinder is None:
                    segment = np.linalg.norm(position - previous, axis=1)
                else:
                    segment = cylinder.segments(at.bodies[cylinder.body], previous, position)[0]
                total += np.where(counted & started, segment, 0.0)
                previous[counted] = position[counted]
                started |= counted
        if not np.isfinite(total).all():
            raise InputError("", "the path's length overflows", "check its points")
        return total


@dataclass(frozen=True, eq=False)
class FunctionPath(MusclePath):
    """A path with a polynomial of coordinates as length.

    ``order`` is the highest sum of powers; the coefficients (m,) are in the order of :func:`powers`.
    """

    names: Sequence[str]
    order: int
    coefficients: Floats

    @property
    def named(self) -> set[str]:
        """Coordinates of the function."""
        return set(self.names)

    def coordinates(self, tree: KinematicTree) -> tuple[str, ...]:
        """Return the free coordinates that affect the length."""
        return tree.freed(self.names)

    def lengths_at(self, at: Posed, switching: Columns | None = None) -> Floats:
        """Return the lengths (f,) in poses."""
        samples = np.column_stack([at.values[name] for name in self.names])
        return terms(samples, self.order) @ self.coefficients


def powers(dimension: int, order: int) -> Ints:
    """Return the powers (m, d) of polynomial terms in OpenSim's order."""
    numbers = range(dimension)
    chosen = chain(*(combinations_with_replacement(numbers, total) for total in range(order + 1)))
    rows = sorted(tuple(map(each.count, numbers)) for each in chosen)
    return np.array(rows, dtype=np.int64).reshape(-1, dimension)


def terms(samples: Floats, order: int) -> Floats:
    """Return a polynomial's terms (f, m) at samples (f, d)."""
    return np.asarray(np.prod(samples[:, None, :] ** powers(samples.shape[1], order), axis=2))


def moment_arm(path: MusclePath, tree: KinematicTree, values: Values, coordinate: str) -> Floats:
    """Return the moment arm -dl/dq (f,) of a path, in the tree's unit of length, or 1 for a translation.

    The central difference keeps the conditional points of ``values``; coupled coordinates follow.
    """
    tree.coordinate(coordinate)
    full = tree.completed(values)
    near = (full | {coordinate: full[coordinate] + step} for step in (-HALF_STEP, HALF_STEP))
    before, after = (path.lengths_at(Posed.of(tree, values), full) for values in near)
    return (before - after) / (2.0 * HALF_STEP)

"""Vertices in groups, and those in groups: halves of halves, down to single vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.bins import stable_order
from vtkmuscle.core.types import Floats, Ints

#: Squares of distances that differ by less than this part of the greatest from the mean are equal: in a
#: symmetric mesh rounding would choose between them.
EQUALLY_FAR = 1e-9


class VertexGroups(NamedTuple):
    """A binary tree over the vertices of a mesh.

    Attributes
    ----------
    order : (n,) int array
        The vertices, so that each group's are next to each other.
    first, last : (g,) int arrays
        Where each group begins and ends (excluded) in ``order``; group 0 is all vertices, and a group comes
        before those that it is made of.
    parts : (g, 2) int array
        What each group is made of: another group, or the vertex v as -1 - v.
    radii : (g,) array
        Greatest distance of its vertices from their mean [mm].
    """

    order: Ints
    first: Ints
    last: Ints
    parts: Ints
    radii: Floats

    def with_means(self, values: Floats) -> Floats:
        """Return values of the vertices (n, 3), and below them their means over the groups, (n + g, 3)."""
        n = len(self.order)
        result = np.empty((n + len(self.first), 3))
        result[:n] = values
        _means(self.parts, self.last - self.first, n, result)
        return result

    @property
    def sizes(self) -> Ints:
        """How many vertices each vertex (1) and each group has, (n + g,)."""
        return np.concatenate([np.ones(len(self.order), dtype=np.int64), self.last - self.first])


def vertex_groups(points: Floats) -> VertexGroups:
    """Return the vertices of a mesh in groups.

    A group is divided halfway between the vertex that is farthest from its mean and the one farthest from
    that: this depends on distances alone, and not on how the mesh is turned.

    Parameters
    ----------
    points : (n, 3) array
        At rest [mm]; at least one.
    """
    n = len(points)
    order = np.arange(n)
    spans, parts, radii = np.empty((n - 1, 2), np.int64), np.empty((n - 1, 2), np.int64), np.empty(n - 1)
    if n > 1:
        squares = np.empty(n)
        _squares(points, order, points.mean(axis=0), squares)
        equal = EQUALLY_FAR * squares.max()
        _divide(np.ascontiguousarray(points), equal if equal > 0.0 else 1.0, order, spans, parts, radii)
    return VertexGroups(order, spans[:, 0].copy(), spans[:, 1].copy(), parts, radii)


@array_kernel
def _divide(points: Floats, equal: float, order: Ints, spans: Ints, parts: Ints, radii: Floats) -> None:
    """Do what :func:`vertex_groups` says; all but the points are written."""
    waiting = np.empty((len(points), 3), dtype=np.int64)  # first, last, and which part of a group it is
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, len(points), -1
    members, mean = np.empty(len(points), dtype=np.int64), np.empty(3)
    from_one, from_two = np.empty(len(points)), np.empty(len(points))
    count, depth = 0, 1
    while depth > 0:
        depth -= 1
        first, last, part = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2]
        if part >= 0:
            parts[part >> 1, part & 1] = count if last - first > 1 else -1 - order[first]
        if last - first == 1:
            continue
        n = last - first
        mean[0], mean[1], mean[2] = 0.0, 0.0, 0.0
        for i in range(n):
            members[i] = order[first + i]
            for axis in range(3):
                mean[axis] += points[members[i], axis]
        for axis in range(3):
            mean[axis] /= n
        vertices = members[:n]
        radii[count] = np.sqrt(_squares(points, vertices, mean, from_one))
        centre = _farthest(from_one[:n], equal)
        _squares(points, vertices, points[vertices[centre]], from_one)
        centre = _farthest(from_one[:n], equal)
        _squares(points, vertices, points[vertices[centre]], from_two)
        _farthest(from_two[:n], equal)
        for i in range(n):
            from_one[i] -= from_two[i]
        sorted_by = stable_order(from_one[:n])
        for i in range(n):
            order[first + i] = vertices[sorted_by[i]]
        spans[count, 0], spans[count, 1] = first, last
        middle = (first + last + 1) // 2
        waiting[depth, 0], waiting[depth, 1], waiting[depth, 2] = middle, last, 2 * count + 1
        waiting[depth + 1, 0], waiting[depth + 1, 1], waiting[depth + 1, 2] = first, middle, 2 * count
        depth += 2
        count += 1


@kernel
def _squares(points: Floats, vertices: Ints, centre: Floats, squares: Floats) -> float:
    """Write the squared distances of some points (k,) from a place; return the greatest."""
    greatest = 0.0
    for i in range(len(vertices)):
        v = vertices[i]
        x, y, z = points[v, 0] - centre[0], points[v, 1] - centre[1], points[v, 2] - centre[2]
        squares[i] = x * x + y * y + z * z
        greatest = max(greatest, squares[i])
    return greatest


@array_kernel
def _farthest(squares: Floats, equal: float) -> int:
    """Replace squares (k,) by how many times `equal` they are, rounded; return the first of the greatest."""
    found = 0
    for i in range(len(squares)):
        squares[i] = np.rint(squares[i] / equal)
        if squares[i] > squares[found]:
            found = i
    return found


@kernel
def _means(parts: Ints, sizes: Ints, n: int, values: Floats) -> None:
    """Write the means of the groups below the n values of the vertices, the smallest groups first."""
    for group in range(len(parts) - 1, -1, -1):
        one, two = parts[group, 0], parts[group, 1]
        a, b = (n + one if one >= 0 else -1 - one), (n + two if two >= 0 else -1 - two)
        # The first part has as many vertices as the second, or one more.
        part = ((sizes[group] + 1) // 2) / sizes[group]
        for k in range(3):
            values[n + group, k] = part * values[a, k] + (1.0 - part) * values[b, k]

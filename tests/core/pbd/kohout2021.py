"""Kohout and Cervenka 2021, written from the paper alone, in loops over plain numbers: the tests' oracle.

Equations, lines and sections are those of doi:10.1007/978-3-030-72379-8_24. Nothing of vtkmuscle is used.
Where the paper cannot be run as it reads, or leaves open what to do, a comment begins with "Reading:".
"""

import itertools
import math

import numpy as np
from scipy.ndimage import binary_fill_holes


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def plus(a, b, factor=1.0):
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def times(factor, a):
    return (factor * a[0], factor * a[1], factor * a[2])


def transformed(matrix, point):
    return tuple(dot(matrix[k][:3], point) + matrix[k][3] for k in range(3))


# ------------------------------------------------------------------------------------ constraints


def eq1(p, moveable, ids, gradients, value, stiffness):
    """Eq. 1: move points against a constraint.

    Reading: fixed points count in the sum (Algorithm 1 gives all points a mass of 1) but do not move (section
    3: PBD updates "the position of the moveable points").
    """
    squares = sum(dot(g, g) for g in gradients)
    if squares == 0.0:
        return
    for i, gradient in zip(ids, gradients, strict=True):
        if moveable[i]:
            p[i] = plus(p[i], gradient, -stiffness * value / squares)


def eq2_3(p1, p2, d):
    """Value and gradients of the distance constraint."""
    length = math.dist(p1, p2)
    if length == 0.0:
        return 0.0, ()
    u = times(1.0 / length, sub(p1, p2))
    return length - d, (u, times(-1.0, u))


def eq4_5(p, triangles, v0):
    """Value and gradients of the volume constraint.

    Reading: the sum is six times the volume, and so V0 has to be. It does not depend on where the origin is,
    but its digits do: here it is among the points.
    """
    total, gradients = -v0, [(0.0, 0.0, 0.0)] * len(p)
    p = [sub(point, p[0]) for point in p]
    for a, b, c in triangles:
        total += dot(p[a], cross(p[b], p[c]))
        for i, j, k in ((a, b, c), (b, c, a), (c, a, b)):
            gradients[i] = plus(gradients[i], cross(p[j], p[k]))
    return total, gradients


def eq6_7(p1, p2, p3, p4, phi0):
    """Value and gradients of the local shape constraint, or None where eq. 7 has none.

    Reading: eq. 7 divides by sqrt(1 - d^2), 0 where the triangles are in a plane: no correction there. That
    root is the sine |n1 x n2| of the angle, by which the arccosine loses no digits near 0 and pi. What is
    divided by it, the part of one normal that is across the other, has its length, and is across the edge:
    the quotient is that direction of length 1, which does not lose them either.
    """
    e, a, b = sub(p2, p1), sub(p3, p1), sub(p4, p1)
    normal1, normal2 = cross(e, a), cross(e, b)
    size1, size2 = math.sqrt(dot(normal1, normal1)), math.sqrt(dot(normal2, normal2))
    if size1 == 0.0 or size2 == 0.0:
        return None
    n1, n2 = times(1.0 / size1, normal1), times(1.0 / size2, normal2)
    d = dot(n1, n2)
    both = cross(n1, n2)
    root = math.sqrt(dot(both, both))
    value = math.atan2(root, d) - phi0
    if root == 0.0:
        return value, None
    # m . grad n, for n = (e x a) / |e x a| and m the other normal: only what is across n counts.
    across1, across2 = cross(e, n1), cross(e, n2)
    across1 = times(math.copysign(1.0, dot(across1, n2)) / math.sqrt(dot(e, e)), across1)
    across2 = times(math.copysign(1.0, dot(across2, n1)) / math.sqrt(dot(e, e)), across2)
    at3 = times(1.0 / size1, cross(across1, e))
    at4 = times(1.0 / size2, cross(across2, e))
    at2 = plus(times(1.0 / size1, cross(a, across1)), times(1.0 / size2, cross(b, across2)))
    g2, g3, g4 = (times(-1.0, g) for g in (at2, at3, at4))
    g1 = times(-1.0, plus(plus(g2, g3), g4))
    return value, (g1, g2, g3, g4)


def eq9(u, v):
    """Stiffness of an edge along u beside a fibre along v, unit vectors.

    Reading: an edge has no sign, nor has a fibre, while 1 - u . v would be 0 or 2 by that of u: section 3.1
    wants 0 where both are collinear.
    """
    return 1.0 - abs(dot(u, v))


# ------------------------------------------------------------------------------------ voxels


class Voxels:
    """A bone as in section 3.2.

    Reading: a grid of n_max cells "automatically determined from the sizes of the bounding box" has cells
    that are cubes, but for what rounding down to whole numbers leaves.
    """

    def __init__(self, points, triangles, n_max):
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        side = (float(np.prod(high - low)) / n_max) ** (1.0 / 3.0)
        self.counts = [max(1, math.floor(float(length) / side)) for length in high - low]
        self.low = [float(x) for x in low]
        self.size = [float(length) / count for length, count in zip(high - low, self.counts, strict=True)]
        self.solid = set()
        for triangle in triangles:
            self.solid |= self.touched([self.at(tuple(map(float, points[i]))) for i in triangle])
        self.fill()

    def at(self, point):
        """Return where a point is, in cells."""
        return tuple((x - o) / s for x, o, s in zip(point, self.low, self.size, strict=True))

    def touched(self, corners):
        """Return the cells that a triangle meets: what it leaves in them when cut by their six sides."""
        spans = []
        for k, count in enumerate(self.counts):
            values = [corner[k] for corner in corners]
            first, last = math.floor(min(values) - 1e-9), math.floor(max(values) + 1e-9)
            spans.append(range(max(0, first), min(count - 1, last) + 1))
        found = set()
        for cell in itertools.product(*spans):
            polygon = corners
            for k in range(3):
                polygon = cut(polygon, k, cell[k] - 1e-9, 1.0)
                polygon = cut(polygon, k, cell[k] + 1.0 + 1e-9, -1.0)
            if polygon:
                found.add(cell)
        return found

    def fill(self):
        """Add the cells inside: a flood does not come to them.

        Reading: "with 8-directions" has no meaning in three dimensions; the flood goes through faces.
        """
        cells = np.zeros(self.counts, dtype=bool)
        cells[tuple(np.transpose(sorted(self.solid)))] = True
        self.solid = set(map(tuple, np.argwhere(binary_fill_holes(cells)).tolist()))

    def outside(self, at):
        """Return whether a point, in cells, is outside.

        Reading: a point that "moves to the point [...] where the traversal stopped" is on the face of an
        outside cell and of one of the bone. It is outside, and x_i on a face in both cells; rounding must
        not have a say.
        """
        beside = [{math.floor(x - 1e-9), math.floor(x + 1e-9)} for x in at]
        return any(cell not in self.solid for cell in itertools.product(*beside))

    def scenario1(self, start, end):
        """Return which part of the way from one point, in cells, to another leads to an outside cell."""
        way = sub(end, start)
        crossings = {0.0, 1.0}
        for a, w in zip(start, way, strict=True):
            for face in range(math.ceil(min(a, a + w)), math.floor(max(a, a + w)) + 1):
                if w:
                    crossings.add((face - a) / w)
        inner = sorted(t for t in crossings if 0.0 <= t <= 1.0)
        for first, last in itertools.pairwise(inner):
            middle = plus(start, way, (first + last) / 2.0)
            cell = tuple(map(math.floor, middle))
            if last - first > 1e-12 and cell not in self.solid:
                at_end = all(c - 1e-9 <= x <= c + 1.0 + 1e-9 for c, x in zip(cell, end, strict=True))
                return 1.0 if at_end else first
        return 1.0


def cut(polygon, axis, at, sign):
    """Return what of a polygon is on one side of a plane: sign (x - at) >= 0."""
    kept = []
    for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        from_a, from_b = sign * (a[axis] - at), sign * (b[axis] - at)
        if from_a >= 0.0:
            kept.append(a)
        if from_a * from_b < 0.0:
            kept.append(plus(a, sub(b, a), from_a / (from_a - from_b)))
    return kept


# ------------------------------------------------------------------------------------ the algorithms


class Muscle:
    """Algorithm 1, lines 8 to 21, and Algorithm 2.

    Parameters
    ----------
    points, triangles, fixed_to : arrays
        The muscle, and the bone of each fixed point (-1: moveable).
    fibres : list of arrays
        Polylines; none for an isotropic muscle.
    bones : dict of int to Voxels
        Those that are collided with.
    order : list of int
        Numbers of the edges that have a moveable point, in the order in which they are projected.
    """

    def __init__(
        self, points, triangles, fixed_to, fibres=(), bones=None, *, shape=0.9, damping=0.99, dt=1.0,
        force=None, order=None,
    ):  # fmt: skip
        self.x = [tuple(map(float, point)) for point in points]
        self.v = [(0.0, 0.0, 0.0) for _ in points]
        self.fixed_to = [int(bone) for bone in fixed_to]
        self.moveable = [bone < 0 for bone in self.fixed_to]
        self.triangles = [tuple(map(int, triangle)) for triangle in triangles]
        self.bones = bones or {}
        self.shape, self.damping, self.dt, self.force = shape, damping, dt, force or (0.0, 0.0, 0.0)
        self.met = {"back to x": 0, "stopped": 0, "pushed": 0}
        self.edges, self.pairs = edges_and_pairs(self.triangles, order)
        self.d = [math.dist(self.x[i], self.x[j]) for i, j in self.edges]
        self.k = [self.anisotropy(i, j, fibres) for i, j in self.edges]
        self.phi0 = []
        for pair in self.pairs:
            found = eq6_7(*(self.x[i] for i in pair), 0.0)
            self.phi0.append(None if found is None else found[0])
        self.v0 = eq4_5(self.x, self.triangles, 0.0)[0]

    def anisotropy(self, i, j, fibres):
        """Section 3.1.

        Reading: the fibre nearest to an edge is that nearest to its middle; of equally near ones (to 1e-9 of
        the longest segment) the first.
        """
        if not len(fibres) or self.x[i] == self.x[j]:
            return 1.0
        middle = np.array(times(0.5, plus(self.x[i], self.x[j])))
        u = times(1.0 / math.dist(self.x[i], self.x[j]), sub(self.x[j], self.x[i]))
        starts = np.vstack([line[:-1] for line in fibres])
        ways = np.vstack([line[1:] - line[:-1] for line in fibres])
        lengths = np.linalg.norm(ways, axis=1)
        starts, ways, lengths = starts[lengths > 0], ways[lengths > 0], lengths[lengths > 0]
        part = np.clip(((middle - starts) * ways).sum(axis=1) / lengths**2, 0.0, 1.0)
        away = np.linalg.norm(starts + part[:, None] * ways - middle, axis=1)
        nearest = int(np.flatnonzero(away <= away.min() + 1e-9 * lengths.max())[0])
        return eq9(u, tuple(ways[nearest] / lengths[nearest]))

    def step(self, now, before, iterations):
        """Algorithm 2, with transforms of all bones, rest to now and to the step before; returns the mesh."""
        p = []
        for i, bone in enumerate(self.fixed_to):
            if bone >= 0:
                p.append(transformed(now[bone], self.x[i]))  # line 9
            else:
                self.v[i] = plus(self.v[i], self.force, self.dt)  # line 11
                self.v[i] = times(self.damping, self.v[i])  # line 12
                p.append(plus(self.x[i], self.v[i], self.dt))  # line 13
        for _ in range(iterations):
            self.iterate(p, now, before)
        for i in range(len(p)):
            if self.moveable[i]:
                self.v[i] = times(1.0 / self.dt, sub(p[i], self.x[i]))  # line 34
                self.x[i] = p[i]  # line 35
        # Reading: line 39 takes each vertex to x_i, which of fixed points is where they are at rest.
        return np.array(p)

    def iterate(self, p, now, before):
        """Lines 17 to 30."""
        for (i, j), d, k in zip(self.edges, self.d, self.k, strict=True):
            value, gradients = eq2_3(p[i], p[j], d)
            # Reading: k C in eq. 1 moves points as C does; k multiplies the correction.
            if gradients:
                eq1(p, self.moveable, (i, j), gradients, value, k)
        value, gradients = eq4_5(p, self.triangles, self.v0)
        eq1(p, self.moveable, range(len(p)), gradients, value, 1.0)
        for pair, phi0 in zip(self.pairs, self.phi0, strict=True):
            found = None if phi0 is None else eq6_7(*(p[i] for i in pair), phi0)
            if found is not None and found[1] is not None:
                eq1(p, self.moveable, pair, found[1], found[0], self.shape)
        for i in range(len(p)):
            for bone, voxels in self.bones.items():
                if self.moveable[i]:
                    self.collide(p, i, voxels, now[bone], before[bone])

    def collide(self, p, i, voxels, now, before):
        """Section 3.2, with a bone as it is now."""
        back = np.linalg.inv(now).tolist()
        start, end = (voxels.at(transformed(back, point)) for point in (p[i], self.x[i]))
        if voxels.outside(start):
            return
        if not voxels.outside(end):
            self.met["pushed"] += 1
            p[i] = transformed((np.asarray(now) @ np.linalg.inv(before)).tolist(), self.x[i])
            return
        part = voxels.scenario1(start, end)
        self.met["back to x" if part == 1.0 else "stopped"] += 1
        p[i] = plus(p[i], sub(self.x[i], p[i]), part)


def edges_and_pairs(triangles, order=None):
    """Return edges, and for each of two triangles (p1, p2, p3, p4) as in section 2.3.

    Reading: "for all edges" names no order; here by their points' numbers, or those of the edges in another.
    """
    beside = {}
    for a, b, c in triangles:
        for i, j, k in ((a, b, c), (b, c, a), (c, a, b)):
            beside.setdefault((min(i, j), max(i, j)), []).append(k)
    edges = sorted(beside)
    if order is not None:
        edges = [edges[number] for number in order]
    return edges, [(*edge, *beside[edge]) for edge in edges if len(beside[edge]) == 2]

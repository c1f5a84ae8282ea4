"""Closed surfaces with known insides, for tests of distances and collisions, and polylines."""

import numpy as np
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from vtkmuscle.core.mesh.surface import opposite_half_edges
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.data.arrays import Polylines, polylines_from


def lines_of(lines):
    """Return polylines as a data set, from points (n, 3) of each."""
    offsets = np.append(0, np.cumsum([len(line) for line in lines]))
    return polylines_from(Polylines(np.vstack(lines).astype(float), offsets))


def turns_of(lines):
    """Return the angles between successive segments of lines (..., n, 3) [degrees]."""
    steps = np.diff(lines, axis=-2)
    steps /= np.linalg.norm(steps, axis=-1, keepdims=True)
    return np.degrees(np.arccos((steps[..., 1:, :] * steps[..., :-1, :]).sum(axis=-1).clip(-1.0, 1.0)))


def nearest_other(places):
    """Return the distance of each place to the nearest other one."""
    return cKDTree(places).query(places, 2)[0][:, 1]


def convex(points):
    """Return a closed, outward oriented surface through points in convex position."""
    triangles = ConvexHull(points).simplices.astype(np.int64)
    corners = points[triangles]
    inward = np.einsum(
        "ij,ij->i",
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
        corners[:, 0] - points.mean(axis=0),
    )
    triangles[inward < 0] = triangles[inward < 0][:, ::-1]
    return points, triangles


def ball(*, radius=10.0, centre=(0.0, 0.0, 0.0), n_points=400):
    directions = np.random.default_rng(3).normal(size=(n_points, 3))
    return convex(radius * directions / np.linalg.norm(directions, axis=1, keepdims=True) + np.array(centre))


class HalfSpace:
    """A bone that fills all beyond an x [mm]."""

    def __init__(self, x):
        self.x, self.box = x, (np.array([x, -np.inf, -np.inf]), np.full(3, np.inf))
        self.solids = self

    def depth(self, points):
        return np.maximum(points[:, 0] - self.x, 0.0)


def box(low=(0.0, 0.0, 0.0), high=(4.0, 2.0, 1.0)):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    return convex(np.array(low) + corners * (np.array(high) - np.array(low)))


def ring(*, big=10.0, small=3.0, n_around=48, n_across=24):
    """Return a torus about the z axis."""
    u, v = np.meshgrid(np.arange(n_around), np.arange(n_across), indexing="ij")
    a, b = 2 * np.pi * u.ravel() / n_around, 2 * np.pi * v.ravel() / n_across
    distance = big + small * np.cos(b)
    points = np.column_stack([distance * np.cos(a), distance * np.sin(a), small * np.sin(b)])

    def number(i, j):
        return (i % n_around) * n_across + j % n_across

    corners = [number(u, v), number(u + 1, v), number(u + 1, v + 1), number(u, v + 1)]
    p, q, r, s = (corner.ravel() for corner in corners)
    return points, np.vstack([np.column_stack([p, q, r]), np.column_stack([p, r, s])]).astype(np.int64)


def grid(m, n):
    """Return a flat surface of m by n unit squares in z = 0, each of two triangles."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(m + 1.0), np.arange(n + 1.0), indexing="ij"))
    i = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel()
    right = i + n + 1
    triangles = np.vstack([np.column_stack([i, right, right + 1]), np.column_stack([i, right + 1, i + 1])])
    return np.column_stack([x, y, np.zeros_like(x)]), triangles


def distance_to_box(points, low, high):
    half = (np.array(high) - np.array(low)) / 2.0
    beyond = np.abs(points - (np.array(high) + np.array(low)) / 2.0) - half
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


def sphere(radius, n_points=6000):
    """Return a ball of evenly spread points, within 0.2 % of its radius."""
    turn = np.pi * (3.0 - 5.0**0.5) * np.arange(n_points)
    z = 1.0 - (2.0 * np.arange(n_points) + 1.0) / n_points
    return convex(
        radius * np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    )


def union(*shapes):
    points, triangles, count = [], [], 0
    for shape in shapes:
        points.append(shape[0])
        triangles.append(shape[1] + count)
        count += len(shape[0])
    return np.vstack(points), np.vstack(triangles)


def closed_surface(points, triangles):
    """Return a surface to be cut into sections."""
    triangles = np.ascontiguousarray(triangles)
    return ClosedSurface(points, triangles, opposite_half_edges(triangles))


def rigid(rng):
    """Return a turn and a shift of some 200 mm, by chance."""
    transform = np.eye(4)
    transform[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    transform[:3, 3] = 200.0 * rng.normal(size=3)
    return transform

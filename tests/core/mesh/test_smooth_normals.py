import numpy as np
import pytest

from vtkmuscle.core.mesh.normals import smooth_normals, triangle_normals
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.phantoms.meshing import box


def ball(n=24):
    """Return a ball of radius 10 by latitude and longitude."""
    theta, phi = np.linspace(0.3, np.pi - 0.3, n), 2 * np.pi * np.arange(2 * n) / (2 * n)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = 10 * np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(2 * n), indexing="ij")
    a, b = i * 2 * n + j, i * 2 * n + (j + 1) % (2 * n)
    quads = np.stack([a, a + 2 * n, b + 2 * n, b], axis=-1).reshape(-1, 4)
    return points, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def normals_at(points, triangles, queries):
    faces, places, _ = triangle_tree(points, triangles).nearest(queries)
    return smooth_normals(points, triangles, faces, places)


def test_on_a_ball_they_are_its_radii(rng):
    points, triangles = ball()
    turn, z = rng.uniform(0, 2 * np.pi, 200), rng.uniform(-0.8, 0.8, 200)
    away = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    found = normals_at(points, triangles, 10 * away)
    assert np.degrees(np.arccos(np.abs((found * away).sum(axis=1)))).max() < 1.5


def test_on_an_edge_both_triangles_give_the_same():
    points, triangles = ball(8)
    edge = points[[100, 101]].mean(axis=0)
    beside = np.flatnonzero(np.isin(triangles, [100, 101]).sum(axis=1) == 2)
    assert len(beside) == 2
    one, two = smooth_normals(points, triangles, beside, np.tile(edge, (2, 1)))
    assert one == pytest.approx(two, abs=1e-12)
    flat = triangle_normals(points, triangles[beside])
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    assert np.degrees(np.arccos(flat[0] @ flat[1])) > 5.0


def test_the_faces_of_a_block_keep_their_own():
    points, triangles = box((0.0, 0, 0), (20.0, 10.0, 5.0), 2.0)
    found = normals_at(points, triangles, np.array([[10.0, 5.0, 5.0], [19.9, 9.9, 5.0], [20.0, 0.1, 0.1]]))
    assert np.allclose(np.abs(found), [[0, 0, 1], [0, 0, 1], [1, 0, 0]])

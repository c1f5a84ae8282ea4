"""Nearest points on triangles, and pseudonormals."""

import numpy as np
from oracles import igl
from shapes import box

from vtkmuscle.core.mesh.triangle_tree import (
    CORNER,
    EDGE,
    FACE,
    nearest_on_triangle,
    pseudonormals,
)


def test_the_nearest_point_and_where_it_is_agree_with_libigl():
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(1000):
        corners, p = rng.normal(size=(3, 3)), 2.0 * rng.normal(size=3)
        *found, where = nearest_on_triangle(*p, *corners)
        _, _, nearest = igl.point_mesh_squared_distance(p[None], corners, np.array([[0, 1, 2]]))
        np.testing.assert_allclose(found, nearest.reshape(3), atol=1e-9)
        if where >= CORNER:
            np.testing.assert_array_equal(found, corners[where - CORNER])
        elif where != FACE:
            a, b = corners[where - EDGE], corners[(where - EDGE + 1) % 3]
            np.testing.assert_allclose(np.cross(b - a, found - a), 0.0, atol=1e-9)
        seen.add(where)
    assert seen == set(range(7))


def test_pseudonormals_of_a_box_do_not_depend_on_its_diagonals():
    points, triangles = box(high=(1.0, 1.0, 1.0))
    normals, rows = pseudonormals(points, triangles)
    normals = normals[rows]
    at_corners = normals[:, CORNER:].reshape(-1, 3)
    expected = (2.0 * points[triangles.reshape(-1)] - 1.0) * np.pi / 2.0
    np.testing.assert_allclose(at_corners, expected, atol=1e-12)
    # Every edge normal points to the outside of the two faces it belongs to.
    middles = 0.5 * (points[triangles] + points[np.roll(triangles, -1, axis=1)])
    outward = np.where(np.isin(middles, (0.0, 1.0)), 2.0 * middles - 1.0, 0.0)
    lengths = np.linalg.norm(normals[:, EDGE:CORNER], axis=2, keepdims=True)
    np.testing.assert_allclose(
        normals[:, EDGE:CORNER] / lengths,
        outward / np.linalg.norm(outward, axis=2, keepdims=True),
        atol=1e-12,
    )

from __future__ import annotations

import numpy as np
from oracles import igl

from vtkmuscle.core.mesh.solids import points_inside
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.phantoms.meshing import box, solid_of_revolution


def test_points_are_inside_where_the_winding_number_says_so(rng):
    points, triangles = solid_of_revolution([0.0, 20.0, 40.0, 90.0], [5.0, 20.0, 4.0, 9.0], 30)
    points = points + rng.normal(scale=0.2, size=points.shape)
    queries = rng.uniform(points.min(axis=0) - 5.0, points.max(axis=0) + 5.0, (3000, 3))
    expected = igl.winding_number(points, triangles, queries) > 0.5
    assert 200 < expected.sum() < 2800
    np.testing.assert_array_equal(points_inside(queries, triangle_tree(points, triangles)), expected)
    np.testing.assert_array_equal(
        points_inside(queries, triangle_tree(points, triangles[:, ::-1].copy())), expected
    )


def test_rays_through_points_and_along_edges_count_once():
    points, triangles = box((0.0, 0.0, 0.0), (4.0, 4.0, 4.0), 1.0)
    grid = np.stack(np.meshgrid(*[np.arange(0.5, 4.0, 0.5)] * 3), axis=-1).reshape(-1, 3)
    up = np.array([0.0, 0.0, 4.0])
    tree = triangle_tree(points, triangles)
    assert points_inside(grid, tree).all()
    assert not points_inside(grid + up, tree).any()
    assert not points_inside(grid - up, tree).any()
    assert len(points_inside(np.empty((0, 3)), tree)) == 0

from __future__ import annotations

import numpy as np
import pytest

from vtkmuscle.core.mesh.solids import points_inside
from vtkmuscle.core.mesh.triangle_tree import tree_of_deformed, triangle_tree
from vtkmuscle.phantoms.meshing import solid_of_revolution


@pytest.fixture
def rest():
    return solid_of_revolution([0.0, 20.0, 40.0, 90.0], [5.0, 20.0, 4.0, 9.0], 30)


def bend(points):
    return points + points[:, 2:] ** 2 / 100.0 * [1.0, 0.5, 0.0]


def test_one_frame_has_one_tree_and_another_frame_another(rest):
    points, triangles = rest
    first = tree_of_deformed(triangle_tree(points, triangles), bend(points), triangles)
    assert tree_of_deformed(None, bend(points), triangles.copy()) is first
    assert tree_of_deformed(None, points, triangles) is not first


def test_a_surface_that_was_changed_behind_its_back_is_another_one(rest):
    points, triangles = rest
    first = tree_of_deformed(None, points, triangles)
    points[0] += 1.0
    second = tree_of_deformed(None, points, triangles)
    assert second is not first
    np.testing.assert_array_equal(second.points, points)


def test_answers_are_those_of_a_new_tree(rest):
    points, triangles = rest
    tree = tree_of_deformed(triangle_tree(points, triangles), bend(points), triangles)
    new = triangle_tree(bend(points), triangles)
    queries = np.random.default_rng(0).uniform(-30.0, 100.0, (500, 3))
    np.testing.assert_allclose(tree.nearest(queries)[2], new.nearest(queries)[2], atol=1e-12)
    np.testing.assert_array_equal(points_inside(queries, tree), points_inside(queries, new))

from __future__ import annotations

import numpy as np
import pytest

from vtkmuscle.core.mesh import solids
from vtkmuscle.core.mesh.solids import deformed_surface, points_inside
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.phantoms.meshing import solid_of_revolution


@pytest.fixture
def rest():
    return solid_of_revolution([0.0, 20.0, 40.0, 90.0], [5.0, 20.0, 4.0, 9.0], 30)


def bend(points):
    return points + points[:, 2:] ** 2 / 100.0 * [1.0, 0.5, 0.0]


def test_one_frame_has_one_surface_and_another_frame_another(rest):
    points, triangles = rest
    first = deformed_surface(bend(points), triangles, triangle_tree(points, triangles))
    assert deformed_surface(bend(points), triangles.copy(), None) is first
    assert deformed_surface(points, triangles, None) is not first


def test_a_surface_that_was_changed_behind_its_back_is_another_one(rest):
    points, triangles = rest
    first = deformed_surface(points, triangles, None)
    points[0] += 1.0
    second = deformed_surface(points, triangles, None)
    assert second is not first
    np.testing.assert_array_equal(second.tree.points, points)


def test_answers_are_those_of_a_new_tree(rest):
    points, triangles = rest
    surface = deformed_surface(bend(points), triangles, triangle_tree(points, triangles))
    new = triangle_tree(bend(points), triangles)
    queries = np.random.default_rng(0).uniform(-30.0, 100.0, (500, 3))
    np.testing.assert_allclose(surface.tree.nearest(queries)[2], new.nearest(queries)[2], atol=1e-12)
    np.testing.assert_array_equal(surface.inside(queries), points_inside(queries, new))


def test_only_points_that_have_moved_are_looked_at_again(rest, monkeypatch):
    points, triangles = rest
    surface = deformed_surface(points, triangles, None)
    queries = np.random.default_rng(1).uniform(points.min(axis=0), points.max(axis=0), (500, 3))
    before = surface.inside(queries)
    assert 50 < before.sum() < 450
    asked = []

    def counted(places, tree):
        asked.append(len(places))
        return points_inside(places, tree)

    monkeypatch.setattr(solids, "points_inside", counted)
    moved = queries.copy()
    moved[np.flatnonzero(before)[:20]] += 500.0
    after = surface.inside(moved)
    assert asked == [20]
    assert not after[np.flatnonzero(before)[:20]].any()
    assert after.sum() == before.sum() - 20
    np.testing.assert_array_equal(surface.inside(queries), before)

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from vtkmuscle.core.morphing.even_spread import spread_evenly


def rectangle(n=600, width=4.0, depth=3.0):
    """Return a triangulated rectangle."""
    rng = np.random.default_rng(1)
    t = np.linspace(0.0, 1.0, 20)
    border = [np.column_stack([t, 0 * t]), np.column_stack([t, 0 * t + 1])]
    border += [side[:, ::-1] for side in border]
    nodes = np.unique(np.vstack([*border, rng.random((n, 2))]), axis=0) * [width, depth]
    return nodes, Delaunay(nodes).simplices.astype(np.int64)


def areas_of(nodes, triangles):
    a, b, c = (nodes[triangles[:, i]] for i in range(3))
    u, v = b - a, c - a
    return 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def test_where_all_parts_are_enlarged_alike_points_stay():
    nodes, triangles = rectangle()
    points = np.random.default_rng(2).random((500, 2)) * [4.0, 3.0]
    moved = spread_evenly(nodes, triangles, 7.0 * areas_of(nodes, triangles), points)
    np.testing.assert_allclose(moved, points, atol=1e-12)


@pytest.mark.parametrize("power", [0.5, 2.0, 3.0])
def test_a_known_density_is_made_even(power):
    # The map (x, y) -> (x^power, y) of the unit square: even images come from x = u^(1 / power).
    nodes, triangles = rectangle(4000, 1.0, 1.0)
    areas = areas_of(np.column_stack([nodes[:, 0] ** power, nodes[:, 1]]), triangles)
    points = np.random.default_rng(3).random((500, 2))
    moved = spread_evenly(nodes, triangles, areas, points)
    assert np.abs(moved[:, 0] ** power - points[:, 0]).max() < 0.04
    assert np.abs(moved[:, 1] - points[:, 1]).max() < 0.06


def test_points_stay_in_the_rectangle_and_in_their_order():
    nodes, triangles = rectangle()
    areas = areas_of(nodes, triangles) * np.random.default_rng(4).exponential(size=len(triangles)) ** 2
    x, y = np.meshgrid(np.linspace(0.0, 4.0, 40), np.linspace(0.0, 3.0, 30), indexing="ij")
    moved = spread_evenly(nodes, triangles, areas, np.column_stack([x.ravel(), y.ravel()])).reshape(40, 30, 2)
    np.testing.assert_allclose(moved[..., 0].min(), 0.0, atol=1e-12)
    np.testing.assert_allclose(moved.max(axis=(0, 1)), [4.0, 3.0], atol=1e-12)
    assert (np.diff(moved[..., 0], axis=0) > 0).all()
    assert (np.diff(moved[..., 1], axis=1) >= 0).all()
    # A column of points stays one.
    assert np.ptp(moved[..., 0], axis=1).max() < 1e-12

"""Diffusion over a surface: what it leaves alone, and how far it goes."""

import numpy as np
import pytest
from shapes import grid

from vtkmuscle.core.skinning.diffusion import Diffusion


def plane(n=41, *, jitter=0.0):
    """Return points and triangles, nearly equilateral, of n x n points one apart, and which are inside."""
    points, triangles = grid(n - 1, n - 1)
    i, j, _ = points.T
    inside = (i > 0) & (j > 0) & (i < n - 1) & (j < n - 1)
    points = np.column_stack([i - 0.5 * j, np.sqrt(0.75) * j, 0.0 * i])
    points[inside, :2] += jitter * np.random.default_rng(0).uniform(-1.0, 1.0, (inside.sum(), 2))
    return points, triangles, inside


@pytest.mark.parametrize("time", [0.1, 0.5, 3.0, 40.0])
def test_a_linear_field_on_a_plane_stays_whatever_the_triangles_are(time):
    points, triangles, inside = plane(jitter=0.1)
    field = points @ np.array([[1.0, 2.0, 0.0], [-3.0, 0.5, 1.0], [0.0, 0.0, 0.0]])
    now = field.copy()
    Diffusion(points, triangles).spread(now, time, inside)
    np.testing.assert_allclose(now, field, atol=1e-9)


@pytest.mark.parametrize("sigma", [1.5, 3.0, 6.0])
def test_a_peak_spreads_by_the_root_of_twice_the_time(sigma):
    points, triangles, inside = plane(61)
    diffusion, centre = Diffusion(points, triangles), len(points) // 2
    heat = np.zeros_like(points)
    heat[centre] = 1.0
    diffusion.spread(heat, 0.5 * sigma**2 / diffusion.time_unit, inside)
    assert heat.sum(axis=0) == pytest.approx(np.ones(3), rel=1e-3)
    away = points - points[centre]
    assert (heat[:, 0] @ away[:, 0] ** 2) ** 0.5 == pytest.approx(sigma, rel=0.02)


@pytest.mark.parametrize("time", [0.3, 2.0, 25.0])
def test_points_outside_keep_theirs_and_there_are_no_new_extremes(time, rng):
    points, triangles, inside = plane(jitter=0.1)
    field = rng.uniform(-1.0, 1.0, points.shape)
    now = field.copy()
    Diffusion(points, triangles).spread(now, time, inside)
    assert np.array_equal(now[~inside], field[~inside])
    assert np.abs(now).max() <= np.abs(field).max() + 1e-12
    assert np.std(now[inside]) < np.std(field[inside])


def test_points_in_one_place_and_triangles_without_area_leave_vectors_finite(rng):
    points, triangles, inside = plane(9)
    points[41], points[22] = points[40], 0.5 * (points[21] + points[23])
    field = rng.uniform(-1.0, 1.0, points.shape)
    Diffusion(points, triangles).spread(field, 3.0, inside)
    assert np.abs(field).max() <= 1.0

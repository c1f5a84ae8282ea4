"""Meshes with edges half as long, flat and rounded."""

import numpy as np
import pytest
from shapes import ball, ring

from vtkmuscle.core.estimate import convergence_error
from vtkmuscle.core.mesh.rest_shape import halved, rounded_volume
from vtkmuscle.core.mesh.surface import edge_lengths, signed_volume, survey, unique_edges


def test_halving_keeps_the_surface_and_halves_every_edge():
    points, triangles = ball()
    finer, parts, edges = halved(points, triangles)
    report = survey(finer, parts)
    assert report.closed
    assert report.oriented
    assert signed_volume(finer, parts) == pytest.approx(signed_volume(points, triangles), rel=1e-12)
    np.testing.assert_allclose(finer[len(points) :], points[edges].mean(axis=1))
    longest = edge_lengths(finer, unique_edges(parts)).max()
    assert longest == pytest.approx(edge_lengths(points, unique_edges(triangles)).max() / 2.0)


@pytest.mark.parametrize(
    ("surface", "known"),
    [(ball(radius=10.0), 4000.0 * np.pi / 3.0), (ring(big=10.0, small=3.0), 2.0 * np.pi**2 * 90.0)],
)
def test_volume_error_by_rounding_covers_what_flat_triangles_miss(surface, known):
    flat = signed_volume(*surface)
    rounded = rounded_volume(*surface)
    missed = known - flat
    stated = convergence_error(flat, rounded, order=2.0)
    assert missed <= stated <= 4.0 * missed


def test_rounding_leaves_a_quarter_of_what_even_triangles_miss():
    surface = ring(big=10.0, small=3.0)
    missed = 2.0 * np.pi**2 * 90.0 - signed_volume(*surface)
    assert rounded_volume(*surface) - signed_volume(*surface) == pytest.approx(0.75 * missed, rel=0.02)

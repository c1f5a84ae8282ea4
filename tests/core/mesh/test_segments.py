"""Segments of polylines."""

import numpy as np

from vtkmuscle.core.mesh.polylines import segment_distances, segments


def test_segments_are_those_within_lines_and_none_from_line_to_line():
    points = np.arange(21.0).reshape(7, 3)
    a, b = segments(points, np.array([0, 2, 3, 7]))
    np.testing.assert_array_equal(a, points[[0, 3, 4, 5]])
    np.testing.assert_array_equal(b, points[[1, 4, 5, 6]])


def test_distances_are_the_least_over_all_of_the_segment():
    rng = np.random.default_rng(0)
    points, a, b = rng.normal(size=(3, 50, 3))
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    along = [
        np.linalg.norm(p - (1 - shares) * s - shares * e, axis=1).min()
        for p, s, e in zip(points, a, b, strict=True)
    ]
    np.testing.assert_allclose(segment_distances(points, a, b), along, atol=1e-6)
    np.testing.assert_allclose(segment_distances(points, a, a), np.linalg.norm(points - a, axis=1))

"""Smoothing about the common course: bends that fibres share stay, what each does alone is smoothed."""

import numpy as np
from numpy.testing import assert_allclose

from vtkmuscle.core.fibres.spreading import smooth_about_course
from vtkmuscle.core.mesh.polylines import smooth_polylines

SEGMENTS = 15
OFFSETS = np.arange(0, 8 * (SEGMENTS + 1) + 1, SEGMENTS + 1)


def bent(radius=26.0):
    """Return eight fibres side by side round a roller."""
    turns = np.linspace(0.0, 2.0, SEGMENTS + 1)
    bend = radius * np.column_stack([0.0 * turns, np.cos(turns), np.sin(turns)])
    return np.vstack([bend + np.array([aside, 0.0, 0.0]) for aside in np.linspace(-9.0, 9.0, 8)])


def test_a_bend_that_all_fibres_have_keeps_its_radius():
    fibres = bent()
    smoothed = smooth_about_course(fibres, OFFSETS, 4.0, 5)
    assert_allclose(smoothed, fibres, atol=1e-9)
    plain = smooth_polylines(fibres, OFFSETS, 4.0, 5)
    assert np.hypot(plain[:, 1], plain[:, 2]).min() < 25.7  # that is what it is for


def test_what_each_fibre_does_alone_is_smoothed_as_before(rng):
    noise = rng.normal(size=(8, SEGMENTS + 1, 3))
    noise -= noise.mean(axis=0)
    noise[:, [0, -1]] = 0.0
    fibres = bent() + noise.reshape(-1, 3)
    smoothed = smooth_about_course(fibres, OFFSETS, 4.0, 5) - bent()
    assert_allclose(smoothed, smooth_polylines(noise.reshape(-1, 3), OFFSETS, 4.0, 5), atol=1e-9)


def test_lines_without_a_common_course_are_smoothed_as_they_are(rng):
    points = rng.normal(size=(20, 3))
    for offsets in (np.array([0, 20]), np.array([0, 8, 20])):
        assert_allclose(
            smooth_about_course(points, offsets, 4.0, 2), smooth_polylines(points, offsets, 4.0, 2), atol=0
        )

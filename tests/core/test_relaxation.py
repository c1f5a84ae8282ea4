from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from vtkmuscle.core.relaxation import relaxed_points
from vtkmuscle.core.templates import sobol_points


@pytest.mark.parametrize("n", [1, 2, 3, 100, 1000])
def test_without_steps_they_are_sobol_points_and_with_steps_inside(n):
    assert np.array_equal(relaxed_points(n, 0), sobol_points(n))
    points = relaxed_points(n, 7)
    assert points.shape == (n, 2)
    assert (points > 0).all()
    assert (points < 1).all()
    assert np.array_equal(points, relaxed_points(n, 7))


@pytest.mark.parametrize("n", [50, 100, 1000])
def test_no_place_is_far_from_a_relaxed_point(n):
    places = np.random.default_rng(0).random((50_000, 2))
    hexagonal = 1.006 * np.sqrt(1.0 / (n * 2.0 * np.sqrt(3.0)))
    before, after = (
        np.percentile(cKDTree(relaxed_points(n, steps)).query(places)[0], 95) / hexagonal for steps in (0, 5)
    )
    assert before > 1.35
    assert after < 1.18


def test_what_is_returned_may_be_changed():
    relaxed_points(20, 2)[:] = 0.0
    assert relaxed_points(20, 2).min() > 0.0


def test_one_step_moves_a_point_to_the_centre_of_its_part():
    n = 30
    place = (np.stack(np.meshgrid(*[np.arange(400)] * 2), axis=-1).reshape(-1, 2) + 0.5) / 400
    nearest = cKDTree(sobol_points(n)).query(place)[1]
    centres = [place[nearest == p].mean(axis=0) for p in range(n)]
    np.testing.assert_allclose(relaxed_points(n, 1), centres, atol=0.02)

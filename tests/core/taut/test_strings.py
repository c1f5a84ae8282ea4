"""The kernel's springs and its elimination, each on its own; what they do together is in test_paths.py."""

import numpy as np
import pytest

from vtkmuscle.core.taut.places import nearest_segment, value_along
from vtkmuscle.core.taut.ring_contact import _leaves_ring
from vtkmuscle.core.taut.springs import add_spring, solve

RING = np.array([[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0], [-3.0, 3.0]])
FRAME = np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def test_the_elimination_solves_the_whole_system(rng):
    n = 12
    p, y = rng.normal(size=(n, 3)), np.zeros((n, 3))
    matrices, right = np.tile([2.0, 0.0, 0.0, 2.0, 0.0, 2.0], (n, 1)), np.zeros((n, 3))
    for i in rng.choice(np.arange(1, n - 1), size=5, replace=False):
        add_spring(
            rng.normal(size=3), float(rng.uniform(1.0, 1e4)), float(rng.normal()), matrices[i], right[i]
        )
    whole, target = np.zeros((n, 3, n, 3)), right.copy()
    for i in range(1, n - 1):
        a, b, c, d, e, g = matrices[i]
        whole[i, :, i] = [[a, b, c], [b, d, e], [c, e, g]]
        whole[i, :, i - 1] = whole[i, :, i + 1] = -np.eye(3)
    for end in (0, n - 1):
        whole[end, :, end], target[end] = np.eye(3), p[end]
    expected = np.linalg.solve(whole.reshape(3 * n, 3 * n), target.reshape(-1)).reshape(n, 3)
    solve(p, matrices, right, y)
    np.testing.assert_allclose(y[1:-1], expected[1:-1], atol=1e-9)


def test_a_spring_is_the_slope_of_its_energy(rng):
    n, x, stiffness, at = rng.normal(size=3), rng.normal(size=3), 7.0, 0.4
    matrix, right = np.zeros(6), np.zeros(3)
    add_spring(n, stiffness, at, matrix, right)
    a, b, c, d, e, g = matrix
    force = np.array([[a, b, c], [b, d, e], [c, e, g]]) @ x - right
    energy = [0.5 * stiffness * (n @ (x + s * np.eye(3)).T - at) ** 2 for s in (1e-6, -1e-6)]
    np.testing.assert_allclose(force, (energy[0] - energy[1]) / 2e-6, rtol=1e-6)


def test_what_is_between_points_of_a_track_is_smooth_and_goes_through_no_kink(rng):
    values = rng.normal(size=9)
    places = np.linspace(0.0, 8.0, 4001)
    found = np.array([value_along(values, at) for at in places])
    slopes = np.gradient(found[:, 0], places)
    np.testing.assert_allclose(found[5:-5, 1], slopes[5:-5], atol=5e-3)
    assert np.abs(np.diff(found[:, 1])).max() < 0.02
    assert found[:, 0].max() <= values.max()
    assert found[:, 0].min() >= values.min()
    np.testing.assert_allclose(
        [value_along(np.arange(9.0), at) for at in (2.0, 3.7)], [[2.0, 1.0], [3.7, 1.0]]
    )


@pytest.mark.parametrize("start", [0, 7, 18])
def test_the_nearest_segment_is_found_from_anywhere(start):
    turn = np.linspace(0.0, 3.0, 20)
    track = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    for segment in (0, 4, 18):
        middle = 1.2 * (track[segment] + track[segment + 1]) / 2.0
        assert nearest_segment(track, middle, start) == segment


@pytest.mark.parametrize(("x", "point"), [(0.0, 0), (2.9, 0), (3.1, 3), (-9.0, 3)])
def test_a_string_leaves_a_ring_where_it_crosses_outside_of_it(x, point):
    string = np.column_stack([np.full(6, x), np.zeros(6), np.linspace(-5.4, 4.6, 6)])
    assert _leaves_ring(*FRAME, RING, 0.0, string) == point
    # One that is that far outside at rest may be.
    assert _leaves_ring(*FRAME, RING, abs(x), string) == 0


def test_a_string_beside_the_plane_of_a_ring_is_left_alone():
    string = np.column_stack([np.full(6, 9.0), np.zeros(6), np.linspace(1.0, 9.0, 6)])
    assert _leaves_ring(*FRAME, RING, 0.0, string) == 0

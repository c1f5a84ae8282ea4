import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import qmc
from shapes import grid

from vtkmuscle.core.mesh.sampling import PatchSamples, samples_inside, sobol, space_order
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.data.muscle_geometry import MuscleGeometry


def sheet(size=8, spacing=5.0):
    """Return a flat square sheet, 40 x 40 mm."""
    points, triangles = grid(size, size)
    return spacing * points, triangles


def test_dense_samples_are_on_the_triangles_between_the_points_and_nowhere_else():
    points, triangles = sheet()
    samples = PatchSamples(points, triangles, np.flatnonzero(points[:, 0] <= 20)).dense(1000)
    assert len(samples) >= 1000
    assert samples.min() >= 0
    assert samples[:, 0].max() <= 20
    assert_array_equal(samples[:, 2], 0)


def test_dense_samples_are_of_even_density_whatever_the_triangles():
    points, triangles = sheet()
    points[points[:, 0] > 15, 0] += 60  # the fourth column of cells is 13 times as wide as the others
    samples = PatchSamples(points, triangles, np.arange(len(points))).dense(4000)
    counts = np.histogram2d(samples[:, 0], samples[:, 1], bins=[10, 4], range=[[0, 100], [0, 40]])[0]
    assert_allclose(counts / len(samples), 1 / 40, rtol=0.1)


def test_the_area_of_a_curve_is_equally_wide_whatever_the_triangles():
    points, triangles = sheet()
    points[points[:, 0] > 15, 0] += 60
    muscle, line = MuscleGeometry(points, triangles), np.array([[0.0, 20.0, 0.0], [100.0, 20.0, 0.0]])
    area = AttachmentArea("origin", "bone", line, False)
    within, covered = muscle.patch(area).within, muscle.covered([area], "origin")
    samples = covered.dense(4000)
    assert len(samples) >= 4000
    assert np.abs(samples[:, 1] - 20.0).max() <= within < 20.0
    assert_allclose(np.histogram(samples[:, 0], 10, (0.0, 100.0))[0] / len(samples), 0.1, rtol=0.1)
    assert_allclose(samples.mean(axis=0), [50.0, 20.0, 0.0], atol=0.5)
    assert covered.area == pytest.approx(200.0 * within, rel=0.02)
    assert_allclose(covered.onto(np.array([[40.0, 39.0, 3.0]])), [[40.0, 20.0 + within, 0.0]], atol=0.01)


def test_points_without_a_common_triangle_are_sampled_along_edges_and_single_points_as_they_are():
    points, triangles = sheet()
    row = np.flatnonzero(points[:, 0] == 10)
    samples = PatchSamples(points, triangles, row).dense(500)
    assert_array_equal(samples[:, 0], 10)
    assert_allclose(np.histogram(samples[:, 1], 4, (0.0, 40.0))[0] / len(samples), 0.25, atol=0.01)
    for loose in (row[:1], row[[0, 4]]):
        of_points, counts = np.unique(
            PatchSamples(points, triangles, loose).dense(500), axis=0, return_counts=True
        )
        assert_array_equal(of_points, points[loose])
        assert np.ptp(counts) <= 1
        assert counts.sum() >= 500


def in_rod(places):
    return np.minimum(10.0 - np.hypot(places[:, 0], places[:, 1]), 50.0 - np.abs(places[:, 2]))


def rod():
    turns, heights = np.meshgrid(2.0 * np.pi * np.arange(12) / 12, np.linspace(-50.0, 50.0, 11))
    return np.column_stack([10.0 * np.cos(turns).ravel(), 10.0 * np.sin(turns).ravel(), heights.ravel()])


def test_positions_in_a_body_are_of_even_density():
    samples = samples_inside(lambda places: in_rod(places) > 0.0, rod(), 3000)
    assert len(samples) == 3000
    assert (in_rod(samples) > 0.0).all()
    shares = [np.mean(np.hypot(*samples[:, :2].T) < radius) for radius in (2.5, 5.0, 7.5)]
    assert_allclose(shares, np.square([0.25, 0.5, 0.75]), atol=0.015)
    assert_allclose(np.histogram(samples[:, 2], 4, (-50.0, 50.0))[0] / 3000, 0.25, atol=0.015)


@pytest.mark.parametrize(("count", "dimension", "first"), [(1, 1, 0), (100, 2, 0), (777, 3, 3 * 8192)])
def test_sobol_numbers_are_those_of_scipy(count, dimension, first):
    sequence = qmc.Sobol(dimension, scramble=False)
    if first:
        sequence.fast_forward(first)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of counts that are no power of two
        np.testing.assert_array_equal(sobol(count, dimension, first=first), sequence.random(count))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_neighbours_in_the_order_are_neighbours_in_space(dimensions):
    places = np.random.default_rng(0).random((4096, dimensions))
    order = space_order(places)
    np.testing.assert_array_equal(np.sort(order), np.arange(4096))

    def steps(sequence):
        return np.linalg.norm(np.diff(sequence, axis=0), axis=1).mean()

    assert steps(places[order]) < 3.0 * 4096 ** (-1 / dimensions) < 0.5 * steps(places)


def test_places_in_one_point_keep_their_order():
    assert space_order(np.ones((5, 3))).tolist() == [0, 1, 2, 3, 4]

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from scipy.stats import qmc

from vtkmuscle.core.fibres.spreading import cloud, smooth_about_course, steps_to_centres
from vtkmuscle.core.mesh.polylines import smooth_polylines

BOX = np.array([20.0, 30.0, 100.0])


@pytest.fixture(scope="module")
def samples():
    """Return positions in a box, of even density."""
    return qmc.Sobol(3, scramble=False).random(2**13) * BOX


def along_z(feet, n_points=12):
    heights = np.linspace(0.0, BOX[2], n_points)
    lines = np.array([np.column_stack([np.tile(foot, (n_points, 1)), heights]) for foot in feet])
    return lines.reshape(-1, 3), np.arange(len(feet) + 1) * n_points


def farthest(points, samples):
    """Return the 95th percentile of the distance from fibres along z, in the plane."""
    return np.percentile(cKDTree(points[:, :2]).query(samples[:, :2])[0], 95)


def relaxed(points, offsets, samples, times):
    for _ in range(times):
        points = points + steps_to_centres(points, offsets, cloud(samples))
    return points


def test_a_fibre_by_itself_goes_to_the_middle_of_the_muscle(samples):
    points, offsets = along_z([[3.0, 4.0]])
    moved = relaxed(points, offsets, samples, 1)
    assert_allclose(moved[:, :2], np.tile(BOX[:2] / 2, (12, 1)), atol=0.5)
    assert_allclose(moved[:, 2], points[:, 2], atol=1e-12)


def test_fibres_that_are_spread_evenly_stay(samples):
    x, y = np.meshgrid(2.5 + 5.0 * np.arange(4), 2.5 + 5.0 * np.arange(6))
    points, offsets = along_z(np.column_stack([x.ravel(), y.ravel()]))
    assert cloud(samples).volume == pytest.approx(np.prod(BOX), rel=0.02)
    assert np.linalg.norm(steps_to_centres(points, offsets, cloud(samples)), axis=1).max() < 0.35


def test_crowded_fibres_come_to_fill_the_box(samples):
    points, offsets = along_z(BOX[:2] / 2 + np.random.default_rng(0).normal(size=(30, 2)))
    ideal = 1.006 * np.sqrt(BOX[0] * BOX[1] / (2 * np.sqrt(3) * 30))
    assert farthest(points, samples) > 3.0 * ideal
    assert farthest(relaxed(points, offsets, samples, 30), samples) < 1.4 * ideal


def test_steps_are_across_the_fibre(samples):
    rng, t = np.random.default_rng(1), np.linspace(0, 1, 16)
    lines = [np.outer(1 - t, a) + np.outer(t, b) for a, b in rng.random((10, 2, 3)) * BOX]
    offsets = np.arange(11) * 16
    steps = steps_to_centres(np.vstack(lines), offsets, cloud(samples)).reshape(10, 16, 3)
    along = np.array([line[-1] - line[0] for line in lines])
    assert_allclose(np.einsum("ijk,ik->ij", steps, along), 0.0, atol=1e-9)
    assert np.linalg.norm(steps, axis=2).max() > 1.0


@pytest.mark.parametrize("n_points", [2, 3, 200])
def test_how_many_points_a_fibre_has_does_not_matter(samples, n_points):
    feet = [[5.0, 5.0], [9.0, 20.0], [14.0, 8.0]]
    expected = steps_to_centres(*along_z(feet, 16), cloud(samples))[[0, 15, 16, 31, 32, 47]]
    points, offsets = along_z(feet, n_points)
    steps = steps_to_centres(points, offsets, cloud(samples))
    assert_allclose(steps[np.sort(np.r_[offsets[:-1], offsets[1:] - 1])], expected, atol=1e-9)


def test_fibres_without_length_and_in_one_point_give_finite_steps(samples):
    steps = steps_to_centres(np.tile([[1.0, 2.0, 3.0]], (8, 1)), np.array([0, 4, 8]), cloud(samples))
    assert np.isfinite(steps).all()


SEGMENTS = 15
OFFSETS = np.arange(0, 8 * (SEGMENTS + 1) + 1, SEGMENTS + 1)


def bent(radius=26.0):
    """Return eight fibres side by side round a roller."""
    turns = np.linspace(0.0, 2.0, SEGMENTS + 1)
    bend = radius * np.column_stack([0.0 * turns, np.cos(turns), np.sin(turns)])
    return np.vstack([bend + np.array([aside, 0.0, 0.0]) for aside in np.linspace(-9.0, 9.0, 8)])


def test_a_bend_that_all_fibres_have_keeps_its_radius():
    fibres = bent()
    assert_allclose(smooth_about_course(fibres, OFFSETS, 4.0, 5), fibres, atol=1e-9)
    plain = smooth_polylines(fibres, OFFSETS, 4.0, 5)
    assert np.hypot(plain[:, 1], plain[:, 2]).min() < 25.7  # that is what it is for


def test_what_each_fibre_does_alone_is_smoothed_as_before(rng):
    noise = rng.normal(size=(8, SEGMENTS + 1, 3))
    noise -= noise.mean(axis=0)
    noise[:, [0, -1]] = 0.0
    smoothed = smooth_about_course((bent() + noise.reshape(-1, 3)), OFFSETS, 4.0, 5) - bent()
    assert_allclose(smoothed, smooth_polylines(noise.reshape(-1, 3), OFFSETS, 4.0, 5), atol=1e-9)


def test_lines_without_a_common_course_are_smoothed_as_they_are(rng):
    points = rng.normal(size=(20, 3))
    for offsets in (np.array([0, 20]), np.array([0, 8, 20])):
        assert_allclose(
            smooth_about_course(points, offsets, 4.0, 2), smooth_polylines(points, offsets, 4.0, 2), atol=0
        )

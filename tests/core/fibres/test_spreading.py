import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from scipy.stats import qmc

from vtkmuscle.core.fibres.spreading import Cloud, smooth_about_course, smoothing_of, steps_to_centres
from vtkmuscle.core.mesh.polylines import smooth_polylines

BOX = np.array([20.0, 30.0, 100.0])
VOLUME = 60_000.0


@pytest.fixture(scope="module")
def samples():
    """Return positions in a box, of even density."""
    return qmc.Sobol(3, scramble=False).random(2**13) * BOX


def cloud(samples, volume):
    return Cloud(samples, volume)


def along_z(feet, n_points=12):
    heights = np.linspace(0.0, BOX[2], n_points)
    lines = np.array([np.column_stack([np.tile(foot, (n_points, 1)), heights]) for foot in feet])
    return lines.reshape(-1, 3), np.arange(len(feet) + 1) * n_points


def farthest(points, samples):
    """Return the 95th percentile of the distance from fibres along z, in the plane."""
    return np.percentile(cKDTree(points[:, :2]).query(samples[:, :2])[0], 95)


def relaxed(points, offsets, samples, times):
    for _ in range(times):
        points = points + steps_to_centres(points, offsets, cloud(samples, VOLUME))
    return points


def test_a_fibre_by_itself_goes_to_the_middle_of_the_muscle(samples):
    points, offsets = along_z([[3.0, 4.0]])
    moved = relaxed(points, offsets, samples, 1)
    assert_allclose(moved[:, :2], np.tile(BOX[:2] / 2, (12, 1)), atol=0.5)
    assert_allclose(moved[:, 2], points[:, 2], atol=1e-12)


def test_fibres_that_are_spread_evenly_stay(samples):
    x, y = np.meshgrid(2.5 + 5.0 * np.arange(4), 2.5 + 5.0 * np.arange(6))
    points, offsets = along_z(np.column_stack([x.ravel(), y.ravel()]))
    assert np.linalg.norm(steps_to_centres(points, offsets, cloud(samples, VOLUME)), axis=1).max() < 0.35


def test_crowded_fibres_come_to_fill_the_box(samples):
    points, offsets = along_z(BOX[:2] / 2 + np.random.default_rng(0).normal(size=(30, 2)))
    ideal = 1.006 * np.sqrt(BOX[0] * BOX[1] / (2 * np.sqrt(3) * 30))
    assert farthest(points, samples) > 3.0 * ideal
    assert farthest(relaxed(points, offsets, samples, 30), samples) < 1.4 * ideal


def test_steps_are_across_the_fibre(samples):
    rng, t = np.random.default_rng(1), np.linspace(0, 1, 16)
    lines = [np.outer(1 - t, a) + np.outer(t, b) for a, b in rng.random((10, 2, 3)) * BOX]
    offsets = np.arange(11) * 16
    steps = steps_to_centres(np.vstack(lines), offsets, cloud(samples, VOLUME)).reshape(10, 16, 3)
    along = np.array([line[-1] - line[0] for line in lines])
    assert_allclose(np.einsum("ijk,ik->ij", steps, along), 0.0, atol=1e-9)
    assert np.linalg.norm(steps, axis=2).max() > 1.0


@pytest.mark.parametrize("n_points", [2, 3, 200])
def test_how_many_points_a_fibre_has_does_not_matter(samples, n_points):
    feet = [[5.0, 5.0], [9.0, 20.0], [14.0, 8.0]]
    within = cloud(samples, 0.9 * VOLUME)  # rounding decides about the passes of twice the whole's spacing
    expected = steps_to_centres(*along_z(feet, 16), within)[[0, 15, 16, 31, 32, 47]]
    points, offsets = along_z(feet, n_points)
    steps = steps_to_centres(points, offsets, within)
    assert_allclose(steps[np.sort(np.r_[offsets[:-1], offsets[1:] - 1])], expected, atol=1e-9)


def test_fibres_in_the_middles_of_their_cells_stay_there_in_a_bend():
    """On chords and with pulls along the fibres they would creep out of the bend, or into it."""
    radius, straight, thickness, width = 18.0, 60.0, 6.0, 12.0
    ends, wound = straight + np.array([0.0, 2.0 * radius]), 2.0 * straight + 2.0 * radius

    def placed(along, aside, height):
        """Return positions along a strap that winds round an axis over two radians."""
        turn = np.clip((along - ends[0]) / radius, 0.0, 2.0)
        beyond = np.where(along < ends[0], along - ends[0], np.maximum(along - ends[1], 0.0))
        out = np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
        onward = np.column_stack([-np.sin(turn), np.cos(turn), 0.0 * turn])
        across = np.column_stack([0.0 * turn, 0.0 * turn, np.broadcast_to(aside, len(turn))])
        return np.reshape(radius + height, (-1, 1)) * out + beyond[:, None] * onward + across

    u = qmc.Sobol(4, scramble=False).random(2**15)
    heights, along = thickness * (u[:, 2] - 0.5), wound * u[:, 0]
    bent = (along > ends[0]) & (along < ends[1])
    kept = ~bent | (u[:, 3] < (1.0 + heights / radius) / (1.0 + 0.5 * thickness / radius))
    kept &= bent | (u[:, 3] < 1.0 / (1.0 + 0.5 * thickness / radius))  # even density
    samples = placed(along, width * (u[:, 1] - 0.5), heights)[kept]
    layers, rows = (np.arange(5) + 0.5) / 5.0 - 0.5, (np.arange(10) + 0.5) / 10.0 - 0.5
    at = np.linspace(0.0, wound, 16)
    lines = [placed(at, width * aside, thickness * layer) for layer in layers for aside in rows]
    points, offsets = np.vstack(lines), np.arange(len(lines) + 1) * 16
    within = cloud(samples, thickness * width * wound)
    for _ in range(20):
        points = points + steps_to_centres(points, offsets, within)
    middle = points.reshape(50, 16, 3)[:, 7:9]
    assert np.abs(np.hypot(middle[..., 0], middle[..., 1]).mean(axis=0) - radius).max() < 0.05


def test_fibres_without_length_and_in_one_point_give_finite_steps(samples):
    steps = steps_to_centres(np.tile([[1.0, 2.0, 3.0]], (8, 1)), np.array([0, 4, 8]), cloud(samples, VOLUME))
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
    assert smoothing_of(15) == (4.0, 1)  # as published
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

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.fibres.trimming import EndArea, closest_to_ray, ends_as_printed


def distance_to_ray(points, start, ahead):
    t = np.maximum((points - start) @ ahead, 0.0)
    return np.linalg.norm(points - start - t[:, None] * ahead, axis=1)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_no_point_of_the_triangles_is_closer_to_the_ray(seed):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(5, 3, 3)) + rng.normal(scale=2.0, size=3)
    start, ahead = rng.normal(size=3), rng.normal(size=3)
    ahead /= np.linalg.norm(ahead)
    found = closest_to_ray(start, ahead, corners)
    weights = rng.dirichlet([0.6, 0.6, 0.6], (5, 4000))
    sampled = np.einsum("mks,msd->mkd", weights, corners).reshape(-1, 3)
    least = distance_to_ray(sampled, start, ahead).min()
    assert distance_to_ray(found[None], start, ahead)[0] <= least + 1e-9
    nearest = np.linalg.norm(sampled - found, axis=1).min()
    assert nearest < 0.3  # it is on a triangle


def plate(height):
    points = np.array([[-5.0, -5, height], [5, -5, height], [5, 5, height], [-5, 5, height]])
    return EndArea(points, points, np.array([[0, 1, 2], [0, 2, 3]]), np.arange(4))


def test_a_fibre_is_cut_at_the_planes_and_goes_on_in_its_own_direction():
    line = np.column_stack([0.1 * np.arange(-10.0, 11.0), np.zeros(21), np.arange(-10.0, 11.0)])
    line[-1] += [3.0, 0, 0]  # beyond the plane, and so gone
    points, offsets = ends_as_printed(
        line, np.array([0, 21]), axis=np.array([0.0, 0, 1]), origin=plate(-8.5), insertion=plate(8.5)
    )
    assert offsets.tolist() == [0, len(points)]
    np.testing.assert_allclose(points[[0, -1], 2], [-8.5, 8.5])
    np.testing.assert_allclose(points[:, 0], 0.1 * points[:, 2], atol=1e-12)


@pytest.mark.parametrize("x", [0.0, 2.0])
def test_parallel_fibres_beside_an_area_end_on_its_nearest_rim(x):
    """Why fibres share the area out by default."""
    line = np.array([[x + 20.0, 1.0, 0.0], [x + 20.0, 1.0, 5.0], [x + 20.0, 1.0, 12.0]])
    points, _ = ends_as_printed(
        line, np.array([0, 3]), axis=np.array([0.0, 0, 1]), origin=plate(-1.0), insertion=plate(8.5)
    )
    np.testing.assert_allclose(points[-1], [5.0, 1.0, 8.5], atol=1e-12)

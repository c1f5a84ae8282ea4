import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.morphing.bijective import interpolated, onto_region
from vtkmuscle.core.morphing.section_maps import count_outside, mean_value_map
from vtkmuscle.core.morphing.triangulation import triangulate


def area(polygon):
    x, y = polygon.T
    return 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()


def from_region(contour, image, points):
    """Return the places in a section that the harmonic map takes to points of a convex region."""
    return interpolated(*onto_region(contour, image), points)


def star(n, seed, roughness=0.5):
    """Return a polygon that winds in and out about the origin."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * np.arange(n) / n
    waves = sum(rng.normal() / k * np.cos(k * angles + rng.uniform(0, 6)) for k in range(2, 7))
    radii = 10 * np.exp(roughness * waves)
    return np.column_stack([radii * np.cos(angles), 0.6 * radii * np.sin(angles)])


def square_border(n):
    """Return n points around the unit square, its corners among them, n a multiple of 4."""
    s = 4 * np.arange(n) / n
    corners = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1), (0, 0)])
    return np.column_stack([np.interp(s, range(5), column) for column in corners.T])


def crescent(n=100):
    """Return a half ring, far from convex."""
    angles = np.linspace(0, np.pi, n)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([10 * arc, 7 * arc[::-1]])


@settings(deadline=None, max_examples=40)
@given(n=st.sampled_from([3, 4, 5, 9, 40, 200]), seed=st.integers(0, 10**6))
def test_triangulations_fill_the_polygon_and_are_delaunay(n, seed):
    polygon = star(n, seed)
    inner = np.random.default_rng(seed).uniform(-10, 10, (30, 2))
    points, triangles, neighbours = triangulate(polygon, inner)
    areas = [area(points[t]) for t in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(area(polygon))
    assert len(points) - n == 30 - count_outside(polygon, inner)
    for t, others in enumerate(neighbours):
        for side, other in enumerate(others):
            if other >= 0:
                edge = {triangles[t, side], triangles[t, (side + 1) % 3]}
                assert edge < set(triangles[other])
                assert t in neighbours[other]
                assert _opposite_angles(points, triangles[t], triangles[other], edge) <= np.pi + 1e-6


def _opposite_angles(points, *both):
    *pair, edge = both
    total = 0.0
    for triangle in pair:
        (apex,) = set(triangle) - edge
        u, v = (points[i] - points[apex] for i in edge)
        total += np.arccos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1, 1))
    return total


@pytest.mark.parametrize("n", [3, 5000])
def test_small_and_large_contours(n):
    points, triangles, _ = triangulate(star(n, 1, 0.3), np.array([[0.123, 0.456]]))
    assert len(triangles) == n  # n - 2, and two more for the inner point
    assert len(points) == n + 1


def test_a_polygon_that_crosses_itself_is_not_triangulated():
    bow = np.array([(0.0, 0), (1, 1), (1, 0), (0, 1)])
    assert not len(triangulate(bow, np.zeros((0, 2)))[1])
    assert not len(onto_region(bow, square_border(4))[1])


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10**6), roughness=st.floats(0.0, 0.6))
def test_no_point_leaves_a_section_however_concave(seed, roughness):
    contour = star(160, seed, roughness)
    points = np.random.default_rng(seed).uniform(size=(300, 2))
    places = from_region(contour, square_border(160), points)
    assert count_outside(contour, places) == 0


def test_the_map_is_one_to_one_where_mean_values_fold():
    contour, border = crescent(), square_border(200)
    grid = np.stack(np.meshgrid(*[np.linspace(0.02, 0.98, 60)] * 2, indexing="ij"), axis=-1)
    folds = {}
    for name, mapped in (
        ("bijective", from_region(contour, border, grid.reshape(-1, 2))),
        ("mean-value", mean_value_map(border, contour, grid.reshape(-1, 2))),
    ):
        g = mapped.reshape(grid.shape)
        u, v = np.diff(g, axis=0)[:, :-1], np.diff(g, axis=1)[:-1]
        folds[name] = ((u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) < -1e-12).sum()
    assert folds["bijective"] == 0
    assert folds["mean-value"] > 0


def test_a_square_is_mapped_to_itself_and_values_are_continued_linearly():
    border = square_border(40)
    heights = 2 * border[:, :1] - 3 * border[:, 1:] + 1
    points = np.random.default_rng(0).uniform(size=(50, 2))
    places = from_region(np.hstack([border, heights]), border, points)
    assert np.allclose(places[:, :2], points, atol=1e-8)
    assert np.allclose(places[:, 2], points @ [2, -3] + 1, atol=1e-8)


def test_points_on_the_border_go_to_the_contour():
    contour, border = star(80, 5), square_border(80)
    places = from_region(contour, border, border)
    assert np.allclose(places, contour, atol=1e-7)


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6))
def test_the_fast_mean_value_map_is_that_of_the_coordinates(seed):
    rng = np.random.default_rng(seed)
    border = square_border(60)
    images = rng.normal(size=(60, 3))
    points = np.vstack([rng.uniform(size=(40, 2)), border[:5], 0.5 * (border[:5] + border[1:6])])
    expected = mean_value_map(border, images, points)
    assert np.allclose(mean_value_map(border, images, points), expected, atol=1e-9)

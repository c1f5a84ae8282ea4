import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import igl

from vtkmuscle.core.morphing.correspondence import mean_value_weights as mean_value_coordinates

SQUARE = np.array([(0.0, 0), (2, 0), (2, 1), (0, 1)])
CONCAVE = np.array([(0.0, 0), (4, 0), (4, 3), (2, 0.5), (0, 3)])


def star(rng, n):
    """Return a simple polygon, star-shaped about the origin and mostly concave."""
    angles = np.sort(rng.random(n) + np.arange(n)) * 2 * np.pi / n
    radii = rng.uniform(0.2, 1.0, n)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def by_angles(polygon, point):
    """Return the coordinates of a point by the definition, with angles (Hormann, Floater 2006, eq. 11)."""
    s = polygon - point
    r = np.linalg.norm(s, axis=1)
    z = s[:, 0] + 1j * s[:, 1]
    angles = np.angle(np.roll(z, -1) / z)
    w = (np.tan(np.roll(angles, 1) / 2) + np.tan(angles / 2)) / r
    return w / w.sum()


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), n=st.integers(3, 40))
def test_sum_to_one_and_reproduce_linear_functions(seed, n):
    rng = np.random.default_rng(seed)
    polygon = star(rng, n)
    inside = polygon[rng.integers(n, size=20)] * rng.uniform(0, 0.999, (20, 1))
    edges = rng.integers(n, size=20)
    shares = rng.random((20, 1))
    on_edges = polygon[edges] * shares + polygon[(edges + 1) % n] * (1 - shares)
    near = on_edges + rng.normal(size=(20, 2)) * 10.0 ** rng.integers(-18, -3, (20, 1))
    points = np.vstack([inside, on_edges, near, polygon])
    weights = mean_value_coordinates(polygon, points)
    # Outside of a concave polygon the sum of the unnormalised weights may vanish; inside it cannot.
    good = np.abs(weights).max(axis=1) < 1e3
    assert good[:40].all()
    assert np.abs(weights.sum(axis=1) - 1)[good].max() < 1e-10
    assert np.abs(weights @ polygon - points)[good].max() < 1e-10


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6), n=st.integers(3, 30))
def test_agree_with_the_definition_and_with_libigl(seed, n):
    rng = np.random.default_rng(seed)
    polygon = star(rng, n)
    points = polygon[rng.integers(n, size=10)] * rng.uniform(0.05, 0.9, (10, 1))
    weights = mean_value_coordinates(polygon, points)
    expected = np.array([by_angles(polygon, point) for point in points])
    assert np.allclose(weights, expected, atol=1e-9)
    assert np.allclose(weights, igl.mvc(points, polygon), atol=1e-7)


@pytest.mark.parametrize("polygon", [SQUARE, CONCAVE, CONCAVE[::-1].copy()])
def test_vertices_and_edges_are_exact(polygon):
    assert np.array_equal(mean_value_coordinates(polygon, polygon), np.eye(len(polygon)))
    middles = (polygon + np.roll(polygon, -1, axis=0)) / 2
    expected = (np.eye(len(polygon)) + np.roll(np.eye(len(polygon)), 1, axis=1)) / 2
    assert np.allclose(mean_value_coordinates(polygon, middles), expected, atol=1e-15)


def test_repeated_vertices_and_vertices_on_edges_do_no_harm():
    polygon = np.array([(0.0, 0), (1, 0), (1, 0), (2, 0), (2, 1), (0, 1), (0, 1)])
    points = np.array([(0.3, 0.2), (1.0, 0.0), (1.5, 0.0), (0.0, 1.0), (0.0, 0.5), (1.0, 1e-300)])
    weights = mean_value_coordinates(polygon, points)
    assert np.isfinite(weights).all()
    assert np.allclose(weights @ polygon, points, atol=1e-14)

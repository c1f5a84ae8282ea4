import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.mesh.rest_shape import project_volume, volume_and_gradient
from vtkmuscle.core.mesh.surface import signed_volume


def finite_differences(function, points, h):
    """Return the central differences of fourth order of a function of (k, 3) points."""
    gradient = np.zeros_like(points)
    for index in np.ndindex(points.shape):
        offset = np.zeros_like(points)
        offset[index] = h
        near = function(points + offset) - function(points - offset)
        far = function(points + 2 * offset) - function(points - 2 * offset)
        gradient[index] = (8 * near - far) / (12 * h)
    return gradient


def test_volume_is_that_of_the_mesh_also_far_away():
    points, triangles, _ = spindle(seed=3)
    gradient = np.empty_like(points)
    near = volume_and_gradient(points, triangles, gradient)
    assert near == pytest.approx(signed_volume(points, triangles), rel=1e-13)
    far_gradient = np.empty_like(points)
    far = volume_and_gradient(points + np.array([1e6, -1e6, 1e6]), triangles, far_gradient)
    assert far == pytest.approx(near, rel=1e-10)
    assert np.allclose(far_gradient, gradient, atol=1e-7)


def test_volume_gradient_agrees_with_finite_differences():
    points, triangles, _ = spindle(rings=4, around=5, seed=4)
    gradient, other = np.empty_like(points), np.empty_like(points)
    volume_and_gradient(points, triangles, gradient)
    expected = finite_differences(lambda p: volume_and_gradient(p, triangles, other), points, 1e-2)
    assert np.linalg.norm(gradient - expected) <= 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("scale", [0.8, 0.95, 1.05, 1.3])
def test_volume_projection_restores_the_volume(scale):
    points, triangles, fixed_to = spindle(seed=5)
    rest = signed_volume(points, triangles)
    squeezed = points * [scale, 1.0, 1.0]
    w = (fixed_to < 0).astype(float)
    before = squeezed.copy()
    for _ in range(4):
        project_volume(squeezed, w, triangles, rest, 0.0, np.empty_like(points))
    assert signed_volume(squeezed, triangles) == pytest.approx(rest, rel=1e-9)
    assert np.array_equal(squeezed[fixed_to >= 0], before[fixed_to >= 0])


def test_volume_projection_of_a_crushed_muscle_is_finite():
    points, triangles, _ = spindle()
    crushed = np.zeros_like(points)
    crushed[0, 0] = 1e-9
    for _ in range(3):
        project_volume(crushed, np.ones(len(points)), triangles, 1e4, 1e3, np.empty_like(points))
    assert np.isfinite(crushed).all()

import numpy as np
import pytest
from constraint_oracles import dihedral_and_gradient, dihedral_angle, distance_and_gradient
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_by_one import sweep_dihedrals, sweep_distances
from spindle import spindle

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.constraints import (
    ARCTANGENT,
    LARGEST_TURN,
    per_iteration_stiffness,
    project_volume,
    volume_and_gradient,
)

ANGLES = [0.0, 1e-9, -1e-9, 0.3, -0.3, 1.5, -1.5, 2.5, -2.5, 3.1, -3.1, np.pi / 2]


def hinge(angle):
    """Return two triangles over an edge, a flat plane with its normal along y bent by an angle."""
    x, y = np.cos(angle / 2), -np.sin(angle / 2)
    return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [x, y, 0.7], [-1.3 * x, 1.3 * y, 1.1]])


def finite_differences(function, points, h=1e-5):
    """Return the central differences of fourth order of a function of (k, 3) points."""
    gradient = np.zeros_like(points)
    for index in np.ndindex(points.shape):
        offset = np.zeros_like(points)
        offset[index] = h
        near = function(points + offset) - function(points - offset)
        far = function(points + 2 * offset) - function(points - 2 * offset)
        gradient[index] = (8 * near - far) / (12 * h)
    return gradient


def agree(gradient, expected):
    return np.linalg.norm(gradient - expected) <= 1e-6 * np.linalg.norm(expected)


def test_distance_gradient_agrees_with_finite_differences():
    points = np.random.default_rng(0).normal(size=(2, 3))
    _, gradient = distance_and_gradient(*points, 0.7)
    assert agree(gradient, finite_differences(lambda p: distance_and_gradient(*p, 0.7)[0], points, 1e-3))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("rest", [0.0, 0.4, -0.4])
def test_dihedral_gradient_agrees_with_finite_differences(angle, rest):
    points = hinge(angle)
    value, gradient = dihedral_and_gradient(*points, rest)

    def change(p):
        return np.angle(np.exp(1j * (dihedral_and_gradient(*p, rest)[0] - value)))

    assert agree(gradient, finite_differences(change, points, 1e-3))


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10**6), rest=st.floats(-3.0, 3.0))
def test_dihedral_gradient_of_random_triangles(seed, rest):
    points = np.random.default_rng(seed).normal(size=(4, 3))
    e = points[1] - points[0]
    heights = [np.linalg.norm(np.cross(e, p - points[0])) / np.linalg.norm(e) for p in points[2:]]
    if min(*heights, np.linalg.norm(e)) < 0.2:
        return
    value, gradient = dihedral_and_gradient(*points, rest)
    assert abs(value) <= np.pi + 1e-12
    moving = finite_differences(
        lambda p: np.angle(np.exp(1j * (dihedral_and_gradient(*p, rest)[0] - value))), points, 1e-3
    )
    assert agree(gradient, moving)


@pytest.mark.parametrize("angle", ANGLES)
def test_dihedral_angle_is_signed(angle):
    value, defined = dihedral_angle(*hinge(angle))
    assert defined
    assert value == pytest.approx(angle, abs=1e-12)


def test_dihedral_angle_is_positive_on_a_convex_body():
    points, triangles, _ = spindle()
    sphere = points / np.linalg.norm(points, axis=1, keepdims=True)
    quads = mesh_topology(len(points), triangles).quads
    angles, defined = dihedral_angle(*(sphere[quads[:, i]] for i in range(4)))
    assert signed_volume(sphere, triangles) > 0
    assert defined.all()
    assert (angles > -1e-9).all()
    assert angles.max() > 0.1


@pytest.mark.parametrize("now", ANGLES)
@pytest.mark.parametrize("rest", [0.0, 0.5, -0.5, 3.0, -3.0])
def test_dihedral_projection_is_a_newton_step_of_the_reference(now, rest):
    points = hinge(now)
    value, gradient = dihedral_and_gradient(*points, rest)
    turn = np.clip(value, -LARGEST_TURN, LARGEST_TURN)
    expected = points - 0.7 * turn * gradient / (gradient**2).sum()
    quads = np.arange(4)[None]
    sweep_dihedrals(points, np.ones(4), quads, np.cos([rest]), np.sin([rest]), 0.7)
    difference = np.linalg.norm(points - expected)
    mirrored = np.linalg.norm(points + expected - 2 * hinge(now))
    # Opposite the rest angle both ways round are as short.
    assert difference < 1e-9 or (abs(abs(value) - np.pi) < 1e-6 and mirrored < 1e-5)


@pytest.mark.parametrize("rest", [0.3, -0.3, 1.4, -1.4])
def test_dihedral_projection_reaches_the_rest_angle(rest):
    points = hinge(0.0)
    for _ in range(200):
        sweep_dihedrals(points, np.ones(4), np.arange(4)[None], np.cos([rest]), np.sin([rest]), 0.9)
    assert float(dihedral_angle(*points)[0]) == pytest.approx(rest, abs=1e-9)


def test_thin_triangles_that_are_folded_over_do_not_grow_beyond_their_height():
    points = np.array([[0.0, 0, 0], [0, 10, 0], [0.1, 5, 0], [0.1, 5, 0.02]])  # folded over, flat at rest
    sweep_dihedrals(points, np.ones(4), np.arange(4)[None], np.ones(1), np.zeros(1), 1.0)
    heights = np.linalg.norm(points[2:, [0, 2]] - points[:2, [0, 2]].mean(axis=0), axis=1)
    assert (heights < 1.06 * 0.102).all()  # by the cosine of the turn, where a whole one would triple them


def test_dihedral_projection_of_a_tiny_lever_arm_beside_fixed_points_stays_small():
    points = hinge(0.2)
    points[2] = points[0] + 1e-7 * (points[2] - points[0])  # only p2 is free, and it hardly turns anything
    before = points.copy()
    sweep_dihedrals(points, np.array([0.0, 1.0, 0.0, 0.0]), np.arange(4)[None], np.ones(1), np.zeros(1), 1.0)
    assert np.array_equal(points[[0, 2, 3]], before[[0, 2, 3]])
    assert np.abs(points - before).max() < 1.0


@pytest.mark.parametrize("height", [1e-2, 1e-4, 1e-6, 1e-8, 1e-12, 0.0])
def test_degenerate_triangles_contribute_nothing_smoothly(height):
    points = np.array([[0.0, 0, 0], [0, 2, 0], [height, 1, 0.5 * height], [-1.0, 1, 0.3]])
    before = points.copy()
    sweep_dihedrals(points, np.ones(4), np.arange(4)[None], np.cos([2.0]), np.sin([2.0]), 1.0)
    assert np.abs(points - before).max() <= 4.0 * height


def test_points_in_one_place_are_left_alone_by_the_distance():
    points = np.zeros((2, 3))
    sweep_distances(points, np.ones(2), np.array([[0, 1]]), np.ones(1), np.ones(1))
    assert (points == 0).all()


@pytest.mark.parametrize(("w", "moved"), [((1.0, 1.0), (0.5, 0.5)), ((0.0, 1.0), (0.0, 1.0))])
def test_distance_is_shared_by_the_free_points(w, moved):
    points = np.array([[0.0, 0, 0], [3.0, 0, 0]])
    sweep_distances(points, np.array(w), np.array([[0, 1]]), np.array([1.0]), np.array([0.5]))
    assert np.allclose(points[:, 0], [moved[0], 3.0 - moved[1]], atol=1e-14)


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
    assert agree(gradient, expected)


@pytest.mark.parametrize("scale", [0.8, 0.95, 1.05, 1.3])
def test_volume_projection_restores_the_volume(scale):
    points, triangles, fixed_to = spindle(seed=5)
    rest = signed_volume(points, triangles)
    squeezed = points * [scale, 1.0, 1.0]
    w = (fixed_to < 0).astype(float)
    before = squeezed.copy()
    for _ in range(4):
        project_volume(squeezed, w, triangles, rest, 0.0, 1.0, np.empty_like(points))
    assert signed_volume(squeezed, triangles) == pytest.approx(rest, rel=1e-9)
    assert np.array_equal(squeezed[fixed_to >= 0], before[fixed_to >= 0])


def test_volume_projection_of_a_crushed_muscle_is_finite():
    points, triangles, _ = spindle()
    crushed = np.zeros_like(points)
    crushed[0, 0] = 1e-9
    for _ in range(3):
        project_volume(crushed, np.ones(len(points)), triangles, 1e4, 1e3, 1.0, np.empty_like(points))
    assert np.isfinite(crushed).all()


@settings(deadline=None, max_examples=30)
@given(points=arrays(np.float64, (4, 3), elements=st.floats(-1e3, 1e3)), rest=st.floats(-3.1, 3.1))
def test_projections_of_any_four_points_are_finite(points, rest):
    p, w = points.copy(), np.ones(4)
    sweep_dihedrals(p, w, np.arange(4)[None], np.cos([rest]), np.sin([rest]), 1.0)
    sweep_distances(p, w, np.array([[0, 1], [2, 3]]), np.ones(2), np.ones(2))
    assert np.isfinite(p).all()


@pytest.mark.parametrize("k", [0.0, 0.3, 0.9, 1.0])
@pytest.mark.parametrize("n", [1, 10, 100])
def test_stiffness_means_the_same_for_any_number_of_iterations(k, n):
    assert (1.0 - per_iteration_stiffness(k, n)) ** n == pytest.approx(1.0 - k, abs=1e-12)


def test_rounding_of_a_stiffness_of_one_is_not_seen_in_that_of_an_iteration():
    assert per_iteration_stiffness(1.0 - 1e-15, 100) == 1.0


def test_the_polynomial_is_the_arctangent_to_the_last_digits():
    t = np.linspace(-1.0, 1.0, 20_001)
    assert np.abs(t * np.polynomial.polynomial.polyval(t * t, ARCTANGENT) - np.arctan(t)).max() < 1e-15


def test_distance_projection_is_a_newton_step_of_the_reference():
    points = np.random.default_rng(0).normal(size=(2, 3))
    value, gradient = distance_and_gradient(*points, 0.7)
    expected = points - 0.4 * value * gradient / (gradient**2).sum()
    sweep_distances(points, np.ones(2), np.array([[0, 1]]), np.array([0.7]), np.array([0.4]))
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-14)

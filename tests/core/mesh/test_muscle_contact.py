import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import sphere

from vtkmuscle.core.mesh.triangle_tree import MuscleContact, Neighbour, triangle_tree

RADIUS = 20.0


BALL = triangle_tree(*sphere(RADIUS))
#: How far the ball's triangles are inside the sphere.
SAGITTA = 0.03


def contact(n):
    return MuscleContact([Neighbour(BALL, np.zeros(n))], np.ones(n, dtype=bool), np.zeros(3))


def directions(seed, n):
    found = np.random.default_rng(seed).normal(size=(n, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), height=st.floats(-10.0, 10.0))
def test_points_go_straight_out_and_those_outside_stay(seed, height):
    way = directions(seed, 50)
    p = (RADIUS + height) * way
    before = p.copy()
    hit = contact(50).keep_out(p)
    if height >= 0.0:
        np.testing.assert_array_equal(p, before)
        assert not hit.any()
    elif height < -SAGITTA:
        assert hit.all()
        np.testing.assert_allclose(np.linalg.norm(p, axis=1), RADIUS, atol=2 * SAGITTA)
        assert (np.linalg.norm(np.cross(p, way), axis=1) < 0.6).all()


@pytest.mark.parametrize("stride", [0.05, 0.4, 3.0])
def test_points_that_move_along_the_neighbour_are_kept_out_all_the_way(stride):
    """The planes are found again as the points go on: after 12 mm they are not in the ball."""
    keeper = contact(1)
    p = np.array([[0.0, 0.0, 25.0]])
    for _ in range(int(12.0 / stride)):
        p += np.array([[stride, 0.0, 0.0]])
        p *= 19.5 / np.linalg.norm(p)
        keeper.keep_out(p)
        assert np.linalg.norm(p) > RADIUS - 2 * SAGITTA

"""Via rings: the plane and the polygon of a ring of landmarks, and what is within it."""

import numpy as np
import pytest
from shapes import rigid

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.paths.via_rings import is_in_polygon, moved_ring, passes_through, via_ring, within_ring
from vtkmuscle.phantoms.meshing import box

SQUARE = np.array([(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0)])
#: Seen whole from its middle, but not convex.
STAR = np.array(
    [(r * np.cos(t), r * np.sin(t)) for r, t in zip([5, 2] * 5, np.pi * np.arange(10) / 5, strict=True)]
)


def test_a_ring_has_the_plane_of_its_landmarks_wherever_it_is(rng):
    for _ in range(10):
        transform = rigid(rng)
        ring = via_ring(apply_transform(transform, np.add(SQUARE, [7.0, 0.0, 3.0])))
        np.testing.assert_allclose(ring.centre, (transform @ [7.0, 0.0, 3.0, 1.0])[:3], atol=1e-9)
        np.testing.assert_allclose(ring.normal, transform[:3, 2], atol=1e-12)
        frame = np.vstack([ring.axes, ring.normal])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_centre_is_that_of_the_area_however_landmarks_crowd():
    side = np.linspace(-2.0, 2.0, 50)[:-1]
    crowded = np.vstack([np.column_stack([side, 0 * side - 2.0, 0 * side]), SQUARE[1:]])
    ring = via_ring(crowded)
    np.testing.assert_allclose(ring.centre, 0.0, atol=1e-12)
    np.testing.assert_allclose(ring.centre + ring.corners @ ring.axes, crowded, atol=1e-12)


def test_the_other_way_round_is_the_same_ring_seen_from_below():
    ring, turned = via_ring(SQUARE), via_ring(SQUARE[::-1])
    np.testing.assert_allclose(ring.normal, -turned.normal)
    points = np.random.default_rng(1).uniform(-4, 4, (200, 3))
    np.testing.assert_array_equal(within_ring(ring, points), within_ring(turned, points))


def test_a_bent_ring_is_flattened():
    turn = 2.0 * np.pi * np.arange(16) / 16
    saddle = np.column_stack([5.0 * np.cos(turn), 5.0 * np.sin(turn), np.cos(2.0 * turn)])
    ring = via_ring(saddle)
    np.testing.assert_allclose(ring.normal, [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(ring.corners, axis=1), 5.0, atol=1e-9)


def test_landmarks_that_repeat_count_once():
    doubled = np.repeat(SQUARE, 2, axis=0)
    np.testing.assert_allclose(via_ring(doubled).corners, via_ring(SQUARE).corners)


@pytest.mark.parametrize("corners", [SQUARE[:, :2], STAR], ids=["square", "star"])
def test_inside_is_where_the_winding_number_says(corners, rng):
    places = rng.uniform(-6.0, 6.0, (500, 2))
    ends = np.roll(corners, -1, axis=0)
    a, b = corners[None] - places[:, None], ends[None] - places[:, None]
    turns = np.arctan2(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0], (a * b).sum(axis=2)).sum(axis=1)
    inside = [is_in_polygon(corners, x, y) for x, y in places]
    np.testing.assert_array_equal(inside, np.abs(turns) > np.pi)


def test_a_ring_that_a_bone_takes_along_is_that_of_its_moved_landmarks(rng):
    transform = rigid(rng)
    landmarks = apply_transform(rigid(rng), SQUARE)
    moved, made = moved_ring(via_ring(landmarks), transform), via_ring(apply_transform(transform, landmarks))
    points = made.centre + rng.uniform(-4.0, 4.0, (100, 3))
    np.testing.assert_allclose(moved.centre, made.centre, atol=1e-9)
    np.testing.assert_array_equal(within_ring(moved, points), within_ring(made, points))


def test_what_a_muscle_passes_through():
    points, triangles = box((-1.0, -1.0, -10.0), (1.0, 1.0, 10.0), 2.0)
    assert passes_through(via_ring(SQUARE), points, triangles)
    assert passes_through(via_ring(0.1 * SQUARE), points, triangles)  # within the muscle
    assert passes_through(via_ring(np.add(SQUARE, [2.5, 0.0, 0.0])), points, triangles)  # in part
    assert not passes_through(via_ring(np.add(SQUARE, [4.0, 0.0, 0.0])), points, triangles)  # beside it
    assert not passes_through(via_ring(np.add(SQUARE, [0.0, 0.0, 11.0])), points, triangles)  # above it


@pytest.mark.parametrize(
    ("landmarks", "message"),
    [
        (SQUARE[:2], "3 landmarks or more.*there are 2"),
        (SQUARE[[0, 1, 1]], "there are 2"),
        (SQUARE * [1.0, 1e-6, 1.0], "on a line"),
        (SQUARE[[0, 2, 1, 3]], "crosses itself"),
        (SQUARE + [[0, 0, 3.0], [0, 0, -3.0]] * 2, "off the plane of a ring"),
        (np.column_stack([STAR[[0, 1, 2, 4, 3, 5, 6, 7, 8, 9]], np.zeros(10)]), "turns back after landmark"),
    ],
)
def test_what_is_no_ring_is_refused(landmarks, message):
    with pytest.raises(ValueError, match=message):
        via_ring(landmarks)

import re

import numpy as np
import pytest
from shapes import grid

from vtkmuscle.core.attachments.contacts import attached_ends
from vtkmuscle.core.attachments.patches import MOST_LANDMARKS, attachment_patch, outline

LONG, WIDE = 60, 12
#: A flat strip in z = 0.
STRIP = grid(LONG, WIDE)
X, Y = STRIP[0][:, 0], STRIP[0][:, 1]
#: How far the strip's points are from a bone that is near its middle only.
AWAY = 10.0 * (np.abs(X - 30.0) + np.abs(Y - 6.0))


def along(first, last):
    """Return how far the strip's points are from a bone that covers it from one x to another."""
    return np.maximum(np.maximum(first - X, X - last), 0.0)


def ends_of(distances, **settings):
    return attached_ends(*STRIP, distances, **({"within": 1.0} | settings))


def points_of(end):
    return np.concatenate([part for _, part in end.contacts])


@pytest.mark.parametrize("depth", [0.0, 5.0])
def test_the_ends_are_what_is_near_the_two_bones_and_inside(depth):
    larger, smaller = ends_of({"lower": along(57, 60), "upper": along(0, 6) - depth * (X < 3)})
    assert (larger.bone, smaller.bone) == ("upper", "lower")
    np.testing.assert_array_equal(np.sort(points_of(larger)), np.flatnonzero(X <= 7))
    np.testing.assert_array_equal(np.sort(points_of(smaller)), np.flatnonzero(X >= 56))
    assert larger.confidence == smaller.confidence == 1.0


def test_a_bone_that_the_muscle_passes_is_not_taken_however_much_lies_on_it():
    """As semimembranosus lies on the femur's condyle, and rectus femoris on its shaft."""
    distances = {"passed": along(6, 50), "upper": along(0, 1), "lower": along(59, 60)}
    ends = ends_of(distances)
    assert {end.bone for end in ends} == {"upper", "lower"}
    assert all(0.0 < end.confidence < 0.2 for end in ends)  # the muscle goes on for 6 and 10 of 60 mm
    assert all(end.confidence == 1.0 for end in ends_of(distances, between=["lower", "upper"]))


def test_two_bones_that_reach_as_far_leave_no_confidence():
    upper, lower = sorted(
        ends_of({"a": along(0, 5), "b": along(54, 60), "c": along(54, 60)}), key=lambda end: end.bone
    )
    assert upper.bone == "a"
    assert upper.confidence > 0.7  # the rival would be as long as the strip is wide
    assert lower.confidence == pytest.approx(0.0, abs=1e-9)


def test_a_fleshy_end_takes_its_half_and_a_tendon_the_last_quarter_of_the_way():
    fleshy, tendon = ends_of({"upper": along(0, 50), "lower": along(33, 60)})
    assert (fleshy.bone, tendon.bone) == ("upper", "lower")
    reached = X[points_of(fleshy)].max()
    assert LONG / 2 <= reached <= LONG / 2 + WIDE / 2  # the ends are corners: half-way is askew
    assert X[points_of(tendon)].min() == pytest.approx(60 - 0.25 * (60 - reached), abs=2.0)


def test_an_end_that_stays_off_its_bone_is_near_at_its_nearest():
    ends = ends_of({"upper": along(-3, -3), "lower": along(50, 60)})
    upper = next(end for end in ends if end.bone == "upper")
    np.testing.assert_array_equal(np.sort(points_of(upper)), np.flatnonzero(X <= 1))


def test_bones_that_move_as_one_share_an_end_where_both_reach_it():
    """As the gluteus maximus arises from ilium and sacrum, but from no bone that it passes."""
    left, right = along(0, 3) + 100.0 * (Y > 4), along(0, 3) + 100.0 * (Y < 8)
    distances = {"left": left, "right": right, "passed": along(20, 30) + (Y > 6), "other": along(58, 60)}
    apart = ends_of(distances)
    assert {bone for end in apart for bone, _ in end.contacts} in ({"left", "other"}, {"right", "other"})
    together = ends_of(distances, bodies=[["left", "right", "passed"], ["other"]])
    shared = dict(next(end for end in together if end.bone != "other").contacts)
    np.testing.assert_array_equal(np.sort(shared.pop("left")), np.flatnonzero((X <= 4) & (Y <= 4)))
    np.testing.assert_array_equal(np.sort(shared.pop("right")), np.flatnonzero((X <= 4) & (Y >= 8)))
    assert not shared


def test_what_an_area_cuts_off_from_the_rest_belongs_to_it():
    """As the tip of a tendon that stands out of the bone, and a dip in the middle of an area."""
    upper = np.where(((X == 4) & (Y == 6)), 9.0, along(2, 10) + 9.0 * (X > 10))
    larger, _ = ends_of({"upper": upper, "lower": along(58, 60)})
    np.testing.assert_array_equal(np.sort(points_of(larger)), np.flatnonzero(X <= 10))


def test_neither_order_of_bones_nor_numbers_of_points_matter(rng):
    points, triangles = STRIP
    order = rng.permutation(len(points))
    place = np.argsort(order)
    distances = {"upper": along(0, 24), "passed": along(25, 45), "lower": along(44, 60)}
    mixed = {bone: distances[bone][order] for bone in reversed(distances)}
    ends = attached_ends(points[order], place[triangles], mixed, within=1.0)
    for one, other in zip(ends_of(distances), ends, strict=True):
        assert one.bone == other.bone
        mean, mean_of_mixed = (
            found.mean(axis=0) for found in (points[points_of(one)], points[order][points_of(other)])
        )
        # Of corners that are as far off either may count.
        np.testing.assert_allclose(mean, mean_of_mixed, atol=1.0)


@pytest.mark.parametrize(
    ("distances", "words"),
    [
        ({"upper": along(0, 5)}, r"is near fewer than two bones; .* 'upper' \(0\); join a separate tendon"),
        (
            dict.fromkeys(["upper", "lower"], AWAY),
            "no connected part of the muscle is near 'upper' and 'lower'; join a separate tendon",
        ),
        (
            {"upper": along(0, 5), "foot": 90 - X},
            r"is near fewer than two bones; .* 'upper' \(0\), 'foot' \(30\)",
        ),
        (
            {"upper": along(0, 5), "shank": along(20, 30)},
            r"extends 30 beyond .* nearest to 'shank', and ends at \(60, \d+, 0\), 30 from",
        ),
    ],
)
def test_a_belly_that_ends_far_from_bones_is_refused(distances, words):
    with pytest.raises(ValueError, match=words):
        ends_of(distances)


def test_a_bone_that_is_named_and_far_is_refused():
    with pytest.raises(ValueError, match=re.escape("the muscle comes no nearer to 'foot' than 30")):
        ends_of({"upper": along(0, 5), "lower": along(50, 60), "foot": 90 - X}, between=["upper", "foot"])


def test_the_outline_of_a_patch_goes_round_it_once():
    hole = (np.abs(X - 20) < 2) & (np.abs(Y - 6) < 2)
    ring, closed = outline(*STRIP, np.flatnonzero((X >= 10) & (X <= 30) & ~hole))
    assert closed
    assert MOST_LANDMARKS / 2 <= len(ring) <= MOST_LANDMARKS
    arms = ring - ring.mean(axis=0)
    area = np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)) / 2
    assert area == pytest.approx(20 * WIDE, rel=0.05)


def test_a_patch_without_triangles_is_its_points_in_order():
    points, closed = outline(*STRIP, np.flatnonzero((Y == 6) & (X < 5))[[3, 0, 4, 2, 1]])
    assert not closed
    assert list(points[:, 0]) in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0])


def test_islands_that_an_edge_joins_are_in_one_ring():
    bands = (X >= 20) & (X <= 23) | (X >= 26) & (X <= 28)
    patch = np.flatnonzero(bands & (np.abs(Y - 6) <= 2) | (Y == 6) & (X >= 20) & (X <= 28))
    ring, closed = outline(*STRIP, patch)
    assert closed
    np.testing.assert_array_equal(attachment_patch(*STRIP, ring, closed).points, patch)


def test_the_ring_gives_back_the_patch_but_for_its_holes():
    """Even where a bone lies on the other side: landmarks that are the muscle's points stay there."""
    hole, whole = (X == 20) & (Y == 6), (X >= 10) & (X <= 30) & (Y >= 2)
    ring, closed = outline(*STRIP, np.flatnonzero(whole & ~hole))
    for bone in (None, lambda places: 5.0 + places[:, 2], lambda places: 5.0 - places[:, 2]):
        patch = attachment_patch(*STRIP, ring, closed, bone_distance=bone).points
        np.testing.assert_array_equal(patch, np.flatnonzero(whole))

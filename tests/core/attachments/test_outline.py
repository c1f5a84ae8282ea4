from __future__ import annotations

import numpy as np
import pytest
from test_contacts import STRIP, WIDE, X, Y

from vtkmuscle.core.attachments.patches import MOST_LANDMARKS, attachment_patch, outline


def test_the_outline_of_a_patch_goes_round_it_once():
    hole = (np.abs(X - 20) < 2) & (np.abs(Y - 6) < 2)
    ring, closed = outline(*STRIP, np.flatnonzero((X >= 10) & (X <= 30) & ~hole))
    assert closed
    assert MOST_LANDMARKS / 2 <= len(ring) <= MOST_LANDMARKS
    arms = ring - ring.mean(axis=0)
    area = np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)) / 2
    assert area == pytest.approx(20 * WIDE, rel=0.05)


def test_a_patch_without_triangles_is_its_points_in_order():
    line = np.flatnonzero((Y == 6) & (X < 5))
    points, closed = outline(*STRIP, line[[3, 0, 4, 2, 1]])
    assert not closed
    assert list(points[:, 0]) in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0])


def test_islands_that_an_edge_joins_are_in_one_ring():
    bands = (X >= 20) & (X <= 23) | (X >= 26) & (X <= 28)
    patch = np.flatnonzero(bands & (np.abs(Y - 6) <= 2) | (Y == 6) & (X >= 20) & (X <= 28))
    ring, closed = outline(*STRIP, patch)
    assert closed
    np.testing.assert_array_equal(attachment_patch(*STRIP, ring, closed), patch)


def test_the_ring_gives_back_the_patch_but_for_its_holes():
    """Even where a bone lies on the other side: landmarks that are the muscle's points stay there."""
    hole = (X == 20) & (Y == 6)
    whole = (X >= 10) & (X <= 30) & (Y >= 2)
    ring, closed = outline(*STRIP, np.flatnonzero(whole & ~hole))
    for bone in (None, lambda places: 5.0 + places[:, 2], lambda places: 5.0 - places[:, 2]):
        patch = attachment_patch(*STRIP, ring, closed, bone_distance=bone)
        np.testing.assert_array_equal(patch, np.flatnonzero(whole))

"""Fibres seen on a surface: their pieces, and angles to others."""

import numpy as np
import pytest

from vtkmuscle.core.template.fitting import SuperficialFibres, angle_to_nearest, superficial_pieces


def test_pieces_share_out_their_fibres():
    lines = np.array([[0.0, 0, 0], [0, 0, 10], [5, 0, 0], [5, 0, 0], [5, 3, 0]])
    seen = superficial_pieces(lines, np.array([0, 2, 5]), np.array([[0.0, 0, -50], [0, 0, 50]]))
    assert seen.lengths.sum() == pytest.approx(13.0)
    assert seen.lengths.max() <= 2.0
    assert np.allclose(np.abs(seen.directions @ [0, 0, 1]).round(12) @ seen.lengths, 10.0)
    assert np.allclose(seen.middles[:5], [[0, 0, z] for z in (1, 3, 5, 7, 9)])
    with pytest.raises(ValueError, match="all fibres have length 0"):
        superficial_pieces(lines[2:4], np.array([0, 2]), lines)


def test_angles_have_no_sign_and_the_longer_pieces_count_more():
    places = np.arange(4.0)[:, None] * [10.0, 0, 0]
    ways = np.array([[-3.0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]])
    others = np.stack([places - ways / 2, places + ways / 2], axis=1).reshape(-1, 3)
    for i, angle in enumerate((0, 90, 45, 0)):
        one = SuperficialFibres(places[[i]], np.eye(3)[[0]], np.ones(1))
        assert np.degrees(angle_to_nearest(one, others, np.arange(0, 9, 2))) == pytest.approx(angle)
    two = SuperficialFibres(places[[0, 1]], np.eye(3)[[0, 0]], np.array([3.0, 1.0]))
    assert np.degrees(angle_to_nearest(two, others, np.arange(0, 9, 2))) == pytest.approx(np.sqrt(90**2 / 4))


def test_the_angle_to_others_is_that_to_the_nearest_of_them():
    seen = SuperficialFibres(np.array([[0.0, 0, 0], [10, 0, 0]]), np.eye(3)[[0, 0]], np.ones(2))
    others = np.array([[-1.0, 0, 1], [1, 0, 1], [9, -1, 0], [11, 1, 0]])
    angle = angle_to_nearest(seen, others, np.array([0, 2, 4]))
    assert np.degrees(angle) == pytest.approx(np.sqrt(45**2 / 2))

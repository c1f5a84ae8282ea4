from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle.core.fibres.between_areas import EndSurface, bend_inside, filled_share, straight_fibres


def rectangle(corner, along, across, n=8):
    """Return a flat area of 2 n^2 triangles."""
    u, v = (a.reshape(-1, 1) for a in np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2, indexing="ij"))
    points = np.asarray(corner) + u * along + v * across
    i = np.arange(n)[:, None] * (n + 1) + np.arange(n)
    quads = np.stack([i, i + n + 1, i + n + 2, i + 1], axis=-1).reshape(-1, 4)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return EndSurface(points, triangles, np.arange(len(points)))


@pytest.fixture
def plates():
    """Return two equal plates of 40 x 15 mm, 12 mm from each other and shifted by 16 mm."""
    sides = np.array([40.0, 0, 0]), np.array([0, 15.0, 0])
    return rectangle((0.0, 0, 0), *sides), rectangle((16.0, 0, 12.0), *sides)


@pytest.mark.parametrize("count", [40, 400])
def test_between_equal_plates_that_are_shifted_all_fibres_are_the_shift(plates, count):
    fibres = straight_fibres(*plates, count, 5)
    assert fibres.shape == (count, 6, 3)
    ways = fibres[:, -1] - fibres[:, 0]
    assert np.abs(np.linalg.norm(ways, axis=1) / 20.0 - 1).max() < 0.01
    angles = np.degrees(np.arcsin(ways[:, 2] / np.linalg.norm(ways, axis=1)))
    assert np.abs(angles - np.degrees(np.arcsin(0.6))).max() < 1.0
    assert np.allclose(np.diff(fibres, axis=1), ways[:, None] / 5)


def test_fibres_between_plates_fill_the_block_between_them(plates):
    assert filled_share(straight_fibres(*plates, 100, 3), *plates, 40.0 * 15 * 12) == pytest.approx(
        1.0, rel=0.02
    )


def test_fibres_may_begin_on_several_pieces():
    sides = np.array([10.0, 0, 0]), np.array([0, 10.0, 0])
    one, two = rectangle((0.0, 0, 0), *sides), rectangle((30.0, 0, 0), *sides)
    first = len(one.points)
    both = EndSurface(
        np.vstack([one.points, two.points]),
        np.vstack([one.triangles, two.triangles + first]),
        np.arange(2 * first),
    )
    fibres = straight_fibres(both, rectangle((15.0, 0, 40.0), *sides), 100, 1)
    left = fibres[:, 0, 0] < 20.0
    assert abs(left.sum() - 50) <= 2
    assert fibres[left, 1, 0].max() < fibres[~left, 1, 0].min() + 1.0


def wide_over_narrow(takes):
    """Return plates of 60 and 40 mm by 15 mm, 12 mm from each other and shifted by 16 mm."""
    across = np.array([0, 15.0, 0])
    plates = rectangle((-10.0, 0, 0), [60.0, 0, 0], across), rectangle((16.0, 0, 12.0), [40.0, 0, 0], across)
    return [replace(plate, takes=take) for plate, take in zip(plates, takes, strict=True)]


@pytest.mark.parametrize("turned", [False, True])
def test_what_fibres_of_one_cross_section_do_not_reach_stays_bare(turned):
    plates = wide_over_narrow([(1.0, 1.0)] * 2)[:: -1 if turned else 1]
    fibres = straight_fibres(*plates, 300, 1)[:, :: -1 if turned else 1]
    ways = fibres[:, 1] - fibres[:, 0]
    angles = np.degrees(np.arccos(ways @ [0.8, 0, 0.6] / np.linalg.norm(ways, axis=1)))
    assert np.percentile(angles, 95) < 6.0  # of equal shares of both: 23
    assert np.abs(np.percentile(fibres[:, 0, 0], [2, 98]) - [0.0, 40.0]).max() < 2.5
    assert np.abs(np.percentile(fibres[:, 1, 0], [2, 98]) - [16.0, 56.0]).max() < 2.0


@pytest.mark.parametrize("takes", [[(0.0, np.inf)] * 2, [(1.0, 1.0), (1.0, 2.0)]])
def test_where_tendons_are_between_or_fibres_may_end_on_both_faces_all_is_covered(takes):
    fibres = straight_fibres(*wide_over_narrow(takes), 300, 1)
    assert np.abs(np.percentile(fibres[:, 0, 0], [2, 98]) - [-10.0, 50.0]).max() < 2.5


def test_loose_points_are_shared():
    point = EndSurface(np.zeros((1, 3)), np.empty((0, 3), np.int64), np.zeros(1, np.int64))
    fibres = straight_fibres(point, rectangle((-5.0, -5, 30), [10, 0, 0], [0, 10, 0]), 9, 4)
    assert np.array_equal(fibres[:, 0], np.zeros((9, 3)))
    assert filled_share(fibres, point, point, 1.0) == 0.0


def test_fibres_that_leave_are_bent_inside_and_others_stay(plates):
    fibres = straight_fibres(*plates, 50, 15)

    def into_muscle(places):  # round a ball that lies in their way
        away = places - [28.0, 7.5, 6.0]
        far = np.linalg.norm(away, axis=1, keepdims=True)
        return np.where(far < 4.0, [28.0, 7.5, 6.0] + 4.0 * away / np.maximum(far, 1e-9), places)

    inside, departures = bend_inside(fibres, into_muscle)
    bent = departures > 0.0
    assert 0 < bent.sum() < 50
    assert np.array_equal(inside[~bent], fibres[~bent])
    assert np.array_equal(inside[:, [0, -1]], fibres[:, [0, -1]])
    assert np.linalg.norm(inside - [28.0, 7.5, 6.0], axis=2).min() >= 4.0 - 1e-9
    assert departures.max() <= 4.0
    assert (np.linalg.norm(np.diff(inside[bent], axis=1), axis=2).sum(axis=1) < 24.0).all()  # 20 straight

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from shapes import convex, grid

from vtkmuscle.core.fibres.between_areas import (
    AT_ONCE,
    EndSurface,
    bend_inside,
    departures,
    even_positions,
    filled_share,
    matched_ends,
    straight_fibres,
)
from vtkmuscle.core.mesh.sampling import PatchSamples, sobol


def rectangle(corner, along, across, n=8):
    """Return a flat area of 2 n^2 triangles."""
    places, triangles = grid(n, n)
    points = np.asarray(corner) + places[:, :1] / n * along + places[:, 1:2] / n * across
    return EndSurface(PatchSamples(points, triangles, np.arange(len(points))))


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


def test_fibres_between_plates_fill_the_section_across_them(plates):
    block = convex(np.vstack([plate.samples.points for plate in plates]))
    # Fibres of 20 mm rise by 12 mm. Beyond the planes across their middle's ends are two prisms of the block.
    sections = (40 * 15 * 12 - 2 * (0.5 * 20 * 9.6 * 15)) / 20
    share = filled_share(straight_fibres(*plates, 100, 3), *plates, *block)
    assert share == pytest.approx(40 * 15 * 0.6 / sections, rel=0.02)


def test_fibres_may_begin_on_several_pieces():
    sides = np.array([10.0, 0, 0]), np.array([0, 10.0, 0])
    one, two = (rectangle((x, 0, 0), *sides).samples for x in (0.0, 30.0))
    first = len(one.points)
    points, triangles = np.vstack([one.points, two.points]), np.vstack([one.faces, two.faces + first])
    both = EndSurface(PatchSamples(points, triangles, np.arange(2 * first)))
    fibres = straight_fibres(both, rectangle((15.0, 0, 40.0), *sides), 100, 1)
    left = fibres[:, 0, 0] < 20.0
    assert abs(left.sum() - 50) <= 2
    assert fibres[left, 1, 0].max() < fibres[~left, 1, 0].min() + 1.0


def wide_over_narrow(takes):
    """Return plates of 60 and 40 mm by 15 mm, 12 mm from each other and shifted by 16 mm."""
    across = np.array([0, 15.0, 0])
    plates = rectangle((-10.0, 0, 0), [60.0, 0, 0], across), rectangle((16.0, 0, 12.0), [40.0, 0, 0], across)
    return [plate._replace(takes=take) for plate, take in zip(plates, takes, strict=True)]


@pytest.mark.parametrize("turned", [False, True])
def test_what_fibres_of_one_cross_section_do_not_reach_stays_bare(turned):
    plates = wide_over_narrow([(1.0, 1.0)] * 2)[:: -1 if turned else 1]
    fibres = straight_fibres(*plates, 300, 1)[:, :: -1 if turned else 1]
    ways = fibres[:, 1] - fibres[:, 0]
    angles = np.degrees(np.arccos(ways @ [0.8, 0, 0.6] / np.linalg.norm(ways, axis=1)))
    assert np.percentile(angles, 95) < 6.0  # of equal shares of both: 23
    # Of even fibres from 0 to 40 mm, and from 16 to 56.
    assert np.abs(np.percentile(fibres[:, 0, 0], [2, 98]) - [0.8, 39.2]).max() < 2.5
    assert np.abs(np.percentile(fibres[:, 1, 0], [2, 98]) - [16.8, 55.2]).max() < 1.2


@pytest.mark.parametrize("takes", [[(0.0, np.inf)] * 2, [(1.0, 1.0), (1.0, 2.0)]])
def test_where_tendons_are_between_or_fibres_may_end_on_both_faces_all_is_covered(takes):
    fibres = straight_fibres(*wide_over_narrow(takes), 300, 1)
    assert np.abs(np.percentile(fibres[:, 0, 0], [2, 98]) - [-10.0, 50.0]).max() < 2.5


def test_loose_points_are_shared():
    point = EndSurface(PatchSamples(np.zeros((1, 3)), np.empty((0, 3), np.int64), np.zeros(1, np.int64)))
    fibres = straight_fibres(point, rectangle((-5.0, -5, 30), [10, 0, 0], [0, 10, 0]), 9, 4)
    assert np.array_equal(fibres[:, 0], np.zeros((9, 3)))
    assert filled_share(fibres, point, point, *convex(np.vstack([fibres[0], fibres[1] + [0, 9, 0]]))) == 0.0


def test_fibres_that_leave_are_bent_inside_and_others_stay(plates):
    fibres = straight_fibres(*plates, 50, 15)

    def into_muscle(places):  # round a ball that lies in their way
        away = places - [28.0, 7.5, 6.0]
        far = np.linalg.norm(away, axis=1, keepdims=True)
        return np.where(far < 4.0, [28.0, 7.5, 6.0] + 4.0 * away / np.maximum(far, 1e-9), places)

    outside, inside = departures(fibres, into_muscle), fibres.copy()
    bent = outside > 0.0
    inside[bent] = bend_inside(fibres[bent], into_muscle)
    assert 0 < bent.sum() < 50
    assert np.array_equal(inside[~bent], fibres[~bent])
    assert np.array_equal(inside[:, [0, -1]], fibres[:, [0, -1]])
    assert np.linalg.norm(inside - [28.0, 7.5, 6.0], axis=2).min() >= 4.0 - 1e-9
    assert outside.max() <= 4.0
    assert (np.linalg.norm(np.diff(inside[bent], axis=1), axis=2).sum(axis=1) < 24.0).all()  # 20 straight


def test_bent_fibres_are_as_long_whatever_the_number_of_segments():
    def out(places):  # of a ball
        return places * np.maximum(20.0 / np.linalg.norm(places, axis=1)[:, None], 1.0)

    lines = [np.linspace([-30.0, 10.0, 0.0], [30.0, 10.0, 0.0], n + 1)[None] for n in (15, 60)]
    few, many = (np.linalg.norm(np.diff(bend_inside(line, out), axis=1), axis=2).sum() for line in lines)
    assert few == pytest.approx(many, rel=5e-3)


def plate(count, *, first=0, sides=(30.0, 10.0), lift=0.0):
    """Return positions of even density on a rectangle."""
    return np.column_stack([sobol(count, 2, first=first) * sides, np.full(count, lift)])


@pytest.mark.parametrize("count", [1, 2, 7, 50, 333])
def test_places_stand_for_equal_shares_and_keep_apart(count):
    both = even_positions([plate(32 * count), plate(32 * count, sides=(5.0, 60.0), lift=20.0)], count)
    for places, sides in zip(both, ((30.0, 10.0), (5.0, 60.0)), strict=True):
        assert places.shape == (count, 3)
        everywhere = plate(64 * 1024, first=64 * 1024, sides=sides, lift=places[0, 2])
        sizes = np.bincount(cKDTree(places).query(everywhere)[1], minlength=count) / (64 * 1024 / count)
        assert sizes.std() < 0.3
        assert 0.4 < sizes.min() <= sizes.max() < 1.8
        if count > 1:
            assert cKDTree(places).query(places, 2)[0][:, 1].min() > 0.3 * np.sqrt(300.0 / count)


def total(starts, ends, goes_with):
    return ((starts - ends[goes_with]) ** 2).sum()


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 60), flat=st.booleans())
def test_the_sum_of_squares_is_the_least(seed, n, flat):
    starts, ends = np.random.default_rng(seed).normal(size=(2, n, 3)) * [10.0, 3.0, 0.0 if flat else 1.0]
    goes_with = matched_ends(starts, ends + np.array([0.0, 0.0, 40.0]))
    best = linear_sum_assignment(cdist(starts, ends, "sqeuclidean"))[1]
    assert sorted(goes_with) == list(range(n))
    assert total(starts, ends, goes_with) <= total(starts, ends, best) * (1 + 1e-9) + 1e-9


def test_many_places_are_matched_nearly_as_well_and_neighbours_do_not_cross():
    count = 2 * AT_ONCE + 2  # halved twice
    bent = plate(16 * count, sides=(12.0, 25.0), lift=30.0)
    bent[:, 2] += 0.02 * bent[:, 1] ** 2
    starts, ends = even_positions([plate(16 * count), bent], count)
    goes_with = matched_ends(starts, ends)
    assert np.array_equal(np.sort(goes_with), np.arange(count))
    centred = ends - ends.mean(axis=0)
    best = linear_sum_assignment(-starts @ centred.T)[1]
    least = total(starts - starts.mean(axis=0), centred, best)
    assert total(starts - starts.mean(axis=0), centred, goes_with) < 1.01 * least + 1e-3 * count
    one, other = cKDTree(starts).query_pairs(1.2 * np.sqrt(300.0 / count), output_type="ndarray").T
    along = ((starts[one] - starts[other]) * (ends[goes_with[one]] - ends[goes_with[other]])).sum(axis=1)
    assert along.min() > -1e-6

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.fibres.between_areas import AT_ONCE, even_positions, matched_ends
from vtkmuscle.core.mesh.sampling import sobol


def plate(count, *, first=0, sides=(30.0, 10.0), lift=0.0):
    """Return positions of even density on a rectangle."""
    u = sobol(count, 2, first=first)
    return np.column_stack([u * sides, np.full(count, lift)])


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


def test_places_move_with_the_areas(rng):
    # Not quite regular: rounding would decide which of two equal axes is the longer one.
    areas = [plate(2048) * [1.0, 1.0, 0.0], plate(2048, sides=(12.0, 25.0), lift=30.0)]
    areas = [area + rng.normal(scale=0.05, size=area.shape) for area in areas]
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    here = even_positions(areas, 77)
    there = even_positions([area @ turn.T + [5.0, -9.0, 30.0] for area in areas], 77)
    for one, two in zip(here, there, strict=True):
        assert np.allclose(one @ turn.T + [5.0, -9.0, 30.0], two, atol=1e-9)


def total(starts, ends, goes_with):
    return ((starts - ends[goes_with]) ** 2).sum()


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 60), flat=st.booleans())
def test_the_sum_of_squares_is_the_least(seed, n, flat):
    rng = np.random.default_rng(seed)
    starts, ends = rng.normal(size=(2, n, 3)) * [10.0, 3.0, 0.0 if flat else 1.0]
    goes_with = matched_ends(starts, ends + np.array([0.0, 0.0, 40.0]))
    best = linear_sum_assignment(cdist(starts, ends, "sqeuclidean"))[1]
    assert sorted(goes_with) == list(range(n))
    assert total(starts, ends, goes_with) <= total(starts, ends, best) * (1 + 1e-9) + 1e-9


def test_places_that_are_one_point_or_a_line_are_matched():
    point, line = np.zeros((5, 3)), np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    for starts, ends in ((point, line), (line, point), (point, point), (line, line[::-1])):
        assert sorted(matched_ends(starts, ends)) == list(range(5))
    assert np.array_equal(line[::-1][matched_ends(line, line[::-1])], line)


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

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import igl

from vtkmuscle.core.morphing.correspondence import (
    LoopStack,
    cornered_loop,
    loop_lengths,
    section_map,
    split_chain,
    starting_points,
)
from vtkmuscle.core.morphing.correspondence import mean_value_weights as mean_value_coordinates

Q0 = np.zeros(2)


def ellipse(a=20.0, b=8.0, *, centre=(25.0, 15.0), turn=0.0, n=90, first=0):
    angles = 2 * np.pi * (np.arange(n) + first) / n
    points = np.column_stack([a * np.cos(angles), b * np.sin(angles)])
    c, s = np.cos(turn), np.sin(turn)
    return points @ np.array([[c, s], [-s, c]]) + centre


@settings(max_examples=80)
@given(seed=st.integers(0, 10**6), n=st.integers(4, 12))
def test_the_split_has_the_least_error_of_all_splits(seed, n):
    rng = np.random.default_rng(seed)
    lengths = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 1, n) ** 3)])
    width, depth = rng.uniform(0.1, 10, 2)
    splits, error = split_chain(lengths, width, depth)
    scaled = lengths * 2 * (width + depth) / lengths[-1]
    sides = np.array([width, depth, width, depth])

    def cost(corners):
        return ((np.diff(scaled[[0, *corners, n]]) - sides) ** 2).sum()

    assert splits[0] == 0
    assert splits[4] == n
    assert (np.diff(splits) >= 1).all()
    assert error == pytest.approx(cost(splits[1:4]), rel=1e-9)
    assert error <= min(cost(c) for c in combinations(range(1, n), 3)) * (1 + 1e-9) + 1e-12


def test_without_continuity_every_loop_starts_nearest_to_the_corner():
    starts = starting_points(LoopStack([ellipse(), ellipse(turn=1.0)], np.array([0.0, 5.0])), 0.0, Q0)
    assert np.array_equal(starts, np.zeros((2, 2)))
    loop = ellipse(first=20)
    start = cornered_loop(loop, Q0, 3.0, 2.0)[0]
    assert np.linalg.norm(start) == pytest.approx(polygon_distance(loop, Q0), rel=1e-12)


def test_as_printed_a_section_starts_at_its_own_vertex_nearest_to_the_corner_and_has_no_other_vertices():
    loop = ellipse(first=20)
    section = section_map(loop, Q0, np.array([3.0, 2.0]), as_printed=True)
    assert np.array_equal(section.ring, np.roll(loop, -np.linalg.norm(loop, axis=1).argmin(), axis=0))
    assert np.array_equal(section.rectangle[0], Q0)


def polygon_distance(loop, point):
    """Return the distance of a point from a closed loop."""
    step = np.roll(loop, -1, axis=0) - loop
    share = np.clip(((point - loop) * step).sum(axis=1) / (step**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(loop + share[:, None] * step - point, axis=1).min()


@pytest.mark.parametrize("sides", [(3.0, 2.0), (40.0, 1.0), (1.0, 1.0)])
@pytest.mark.parametrize("n", [3, 4, 7, 90, 5000])
def test_a_loop_has_vertices_where_the_sides_of_the_rectangle_end(n, sides):
    angle = 2 * np.pi * np.arange(n) / n
    loop = np.column_stack([20 + 15 * np.cos(angle), 12 + 4 * np.sin(angle)])
    chain = cornered_loop(loop, Q0, *sides)
    assert n <= len(chain) <= n + 4
    lengths = loop_lengths(chain)
    assert (np.diff(lengths) > 0).all()
    assert lengths[-1] == pytest.approx(loop_lengths(loop)[-1], rel=1e-5)
    splits, error = split_chain(lengths, *sides)
    assert error < 1e-20 * sum(sides) ** 2
    assert np.allclose(
        lengths[splits] / lengths[-1] * 2 * sum(sides),
        np.cumsum([0.0, sides[0], sides[1], sides[0], sides[1]]),
    )


def crescent(lean, n=200):
    """Return a bent strip whose two ends are about equally near to the corner, which leans to one of them."""
    u = np.linspace(-1.2, 1.2, n // 2)
    arc = np.column_stack([np.sin(u), np.cos(u)])
    points = np.vstack([22 * arc, 16 * arc[::-1]])[::-1]
    c, s = np.cos(lean - np.pi / 4), np.sin(lean - np.pi / 4)
    return points @ np.array([[c, s], [-s, c]]) + (18, 18)


@pytest.mark.parametrize("n_levels", [16, 400])
def test_a_section_that_leans_to_the_other_side_does_not_make_the_start_jump(n_levels):
    loops = [crescent(lean) for lean in np.linspace(-0.3, 0.2, n_levels)]
    levels = np.linspace(0, 100, n_levels)
    jumps = {}
    for continuity in (0.0, 20.0):
        targets = starting_points(LoopStack(loops, levels), continuity, Q0)
        starts = np.array(
            [cornered_loop(loop, target, 3.0, 2.0)[0] for loop, target in zip(loops, targets, strict=True)]
        )
        jumps[continuity] = np.linalg.norm(np.diff(starts, axis=0), axis=1).max()
    assert jumps[0.0] > 20.0
    assert jumps[20.0] < 4.0


SQUARE = np.array([(0.0, 0), (2, 0), (2, 1), (0, 1)])
CONCAVE = np.array([(0.0, 0), (4, 0), (4, 3), (2, 0.5), (0, 3)])


def star(rng, n):
    """Return a simple polygon, star-shaped about the origin and mostly concave."""
    angles = np.sort(rng.random(n) + np.arange(n)) * 2 * np.pi / n
    radii = rng.uniform(0.2, 1.0, n)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), n=st.integers(3, 40))
def test_sum_to_one_and_reproduce_linear_functions(seed, n):
    rng = np.random.default_rng(seed)
    polygon = star(rng, n)
    inside = polygon[rng.integers(n, size=20)] * rng.uniform(0, 0.999, (20, 1))
    edges, shares = rng.integers(n, size=20), rng.random((20, 1))
    on_edges = polygon[edges] * shares + polygon[(edges + 1) % n] * (1 - shares)
    near = on_edges + rng.normal(size=(20, 2)) * 10.0 ** rng.integers(-18, -3, (20, 1))
    points = np.vstack([inside, on_edges, near, polygon])
    weights = mean_value_coordinates(polygon, points)
    # Outside of a concave polygon the sum of the unnormalised weights may vanish; inside it cannot.
    good = np.abs(weights).max(axis=1) < 1e3
    assert good[:40].all()
    assert np.abs(weights.sum(axis=1) - 1)[good].max() < 1e-10
    assert np.abs(weights @ polygon - points)[good].max() < 1e-10


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), n=st.integers(3, 30))
def test_agree_with_libigl(seed, n):
    rng = np.random.default_rng(seed)
    polygon = star(rng, n)
    points = polygon[rng.integers(n, size=10)] * rng.uniform(0.05, 0.9, (10, 1))
    assert np.allclose(mean_value_coordinates(polygon, points), igl.mvc(points, polygon), atol=1e-7)


@pytest.mark.parametrize("polygon", [SQUARE, CONCAVE, CONCAVE[::-1].copy()])
def test_vertices_and_edges_are_exact(polygon):
    assert np.array_equal(mean_value_coordinates(polygon, polygon), np.eye(len(polygon)))
    middles = (polygon + np.roll(polygon, -1, axis=0)) / 2
    expected = (np.eye(len(polygon)) + np.roll(np.eye(len(polygon)), 1, axis=1)) / 2
    assert np.allclose(mean_value_coordinates(polygon, middles), expected, atol=1e-15)


def test_repeated_vertices_and_vertices_on_edges_do_no_harm():
    polygon = np.array([(0.0, 0), (1, 0), (1, 0), (2, 0), (2, 1), (0, 1), (0, 1)])
    points = np.array([(0.3, 0.2), (1.0, 0.0), (1.5, 0.0), (0.0, 1.0), (0.0, 0.5), (1.0, 1e-300)])
    weights = mean_value_coordinates(polygon, points)
    assert np.isfinite(weights).all()
    assert np.allclose(weights @ polygon, points, atol=1e-14)

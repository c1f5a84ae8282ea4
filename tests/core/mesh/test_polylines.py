from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from vtkmuscle.core.mesh import polylines


def random_lines(seed, sizes=(2, 7, 1, 16, 3)):
    rng, offsets = np.random.default_rng(seed), np.append(0, np.cumsum(sizes))
    return rng.normal(size=(offsets[-1], 3)) * 10, offsets.astype(np.int64)


def smoothed_by_the_formula(line, k, iterations):
    for _ in range(iterations):
        line = np.vstack([line[:1], (line[:-2] + k * line[1:-1] + line[2:]) / (k + 2), line[-1:]])
    return line


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), k=st.floats(0, 50), iterations=st.integers(0, 6))
def test_smoothing_is_the_papers_formula_on_each_line(seed, k, iterations):
    points, offsets = random_lines(seed)
    result = polylines.smooth_polylines(points, offsets, k, iterations)
    for first, last in pairwise(offsets):
        line = points[first:last]
        expected = smoothed_by_the_formula(line, k, iterations) if len(line) > 2 else line
        assert_allclose(result[first:last], expected, atol=1e-11)
        assert_array_equal(result[[first, last - 1]], line[[0, -1]])
    assert_array_equal(*(polylines.smooth_polylines(points, offsets, *weight) for weight in ((), (4.0,))))


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 40))
def test_evenly_spaced_points_are_on_the_line_and_equally_far_along_it(seed, count):
    points, offsets = random_lines(seed)
    lines = polylines.evenly_spaced(points, offsets, count)
    for spaced, (first, last) in zip(lines, pairwise(offsets), strict=True):
        line = points[first:last]
        assert len(spaced) == count
        assert_array_equal(spaced[[0, -1]], line[[0, -1]])
        arcs = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
        targets = np.linspace(0, arcs[-1], count)
        expected = np.column_stack([np.interp(targets, arcs, line[:, i]) for i in range(3)])
        assert_allclose(spaced, expected, atol=1e-10)


def test_resampling_clamps_arcs_to_the_line_and_passes_repeated_points():
    line = np.array([[0.0, 0, 0], [0, 0, 0], [4, 0, 0], [4, 0, 0], [4, 2, 0]])
    arcs = np.array([-1.0, 0, 1, 4, 5, 6, 9])
    expected = [[0, 0, 0], [0, 0, 0], [1, 0, 0], [4, 0, 0], [4, 1, 0], [4, 2, 0], [4, 2, 0]]
    assert_allclose(polylines.points_at_arcs(line, np.array([0, 5]), arcs[None])[0], expected, atol=1e-14)


def test_end_directions_pass_over_repeated_points():
    points = np.array(
        [[0.0, 0, 0], [0, 0, 0], [2, 0, 0], [2, 3, 0], [2, 3, 0], [7, 7, 7], [7, 7, 7], [1, 1, 1]]
    )
    starts, ends = polylines.end_directions(points, np.array([0, 5, 7, 8]))
    # Corners of 90 degrees: the segments' own directions.
    assert_allclose(starts, [[1, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert_allclose(ends, [[0, 1, 0], [0, 0, 0], [0, 0, 0]])


def test_end_directions_are_tangents_of_a_curve_not_its_chords():
    angle = np.linspace(0.0, 0.5, 6)  # chords are 2.9 degrees off
    circle = 30 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    starts, ends = polylines.end_directions(np.vstack([circle, [[0, 0, 0], [0, 0, 9]]]), np.array([0, 6, 8]))
    truth = np.array([[0, 1, 0], [-np.sin(0.5), np.cos(0.5), 0]])
    assert np.degrees(np.arccos([starts[0] @ truth[0], ends[0] @ truth[1]])).max() < 0.2
    assert_array_equal(starts[1], [0, 0, 1])
    assert_array_equal(ends[1], [0, 0, 1])


def test_segments_are_those_within_lines_and_none_from_line_to_line():
    points = np.arange(21.0).reshape(7, 3)
    a, b = polylines.segments(points, np.array([0, 2, 3, 7]))
    np.testing.assert_array_equal(a, points[[0, 3, 4, 5]])
    np.testing.assert_array_equal(b, points[[1, 4, 5, 6]])


def test_the_nearest_arc_is_on_a_segment_or_beyond_the_curves_ends():
    corner = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]])
    # The first is nearer to the prolonged first.
    positions = np.array([[13.0, 2, 0], [-3, 1, 0], [11, 12, 0]])
    arcs, segments = polylines.nearest_arcs(np.tile(corner, (3, 1, 1)), positions)
    assert (arcs.tolist(), segments.tolist()) == ([12.0, -3.0, 22.0], [1, 0, 1])


def test_distances_are_the_least_over_all_of_the_segment():
    points, a, b = np.random.default_rng(0).normal(size=(3, 50, 3))
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    along = [
        np.linalg.norm(p - (1 - shares) * s - shares * e, axis=1).min()
        for p, s, e in zip(points, a, b, strict=True)
    ]
    np.testing.assert_allclose(polylines.segment_distances(points, a, b), along, atol=1e-6)
    np.testing.assert_allclose(polylines.segment_distances(points, a, a), np.linalg.norm(points - a, axis=1))

"""Errors of straight segments and of few fibres, against arcs and against samples of a known spread."""

from itertools import pairwise

import numpy as np
import pytest

from vtkmuscle.core.fibres.measures import root_mean_square, sampling_errors, segment_errors


def arc(radius, angle, segments):
    turn = np.linspace(0.0, angle, segments + 1)
    return radius * np.column_stack([np.cos(turn), np.sin(turn), 0.1 * turn])


@pytest.mark.parametrize("segments", [8, 15, 16])
def test_segment_errors_bound_what_chords_miss_of_an_arc(segments):
    lines = arc(30.0, 1.5, segments), arc(50.0, 0.4, segments), [[0, 0, 0], [1, 0, 0]]
    points, offsets = np.vstack(lines), np.concatenate([[0], np.cumsum([len(line) for line in lines])])
    lengths = np.sqrt(1.01) * np.array([45.0, 20.0])
    chords = [np.linalg.norm(np.diff(points[a:b], axis=0), axis=1).sum() for a, b in pairwise(offsets[:3])]
    missed = lengths - chords
    errors = segment_errors(points, offsets)
    assert (missed > 0.0).all()
    assert (missed <= errors[:2]).all()
    assert (errors[:2] <= 4.0 * missed).all()
    assert errors[2] == 0.0


def test_sampling_errors_are_the_spread_of_means(rng):
    samples = rng.normal(scale=3.0, size=(4000, 16))
    means = samples.mean(axis=1)
    assert np.sqrt(np.mean(sampling_errors(samples) ** 2)) == pytest.approx(means.std(), rel=0.05)
    assert np.isnan(sampling_errors(np.ones((5, 1)))).all()


def test_a_root_mean_square_leaves_out_nan():
    assert root_mean_square(np.array([3.0, np.nan, -4.0])) == pytest.approx(np.sqrt(12.5))
    assert root_mean_square(np.array([np.nan])) is None

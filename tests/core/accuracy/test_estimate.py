"""Parts of an error, how they combine, and what two resolutions say of what is left."""

from itertools import pairwise

import numpy as np
import pytest

from vtkmuscle.core.estimate import (
    Estimate,
    convergence_error,
    expanded_of_bounds,
    expanded_of_samples,
    root_of_squares,
    segment_errors,
)


def test_total_of_independent_causes_covers_their_sum_in_95_percent_of_the_cases(rng):
    standard = np.array([1.0, 3.0, 0.5])
    errors = (rng.normal(size=(20000, 3)) * standard).sum(axis=1)
    total = root_of_squares(*(2.0 * standard))
    assert np.mean(np.abs(errors) <= total) == pytest.approx(0.9545, abs=0.006)


def test_bounds_combined_with_other_causes_cover_95_percent(rng):
    errors = rng.uniform(-1.0, 1.0, 20000) + rng.normal(size=20000)
    total = root_of_squares(expanded_of_bounds(1.0), 2.0)
    assert np.mean(np.abs(errors) <= total) == pytest.approx(0.955, abs=0.01)


@pytest.mark.parametrize("count", [3, 8, 30])
def test_few_samples_cover_the_next_one_and_the_mean(rng, count):
    samples = rng.normal(5.0, 2.0, size=(count, 20000))
    assert np.mean(np.abs(samples.mean(axis=0) - 5.0) <= expanded_of_samples(samples, of_mean=True)) == (
        pytest.approx(0.95, abs=0.01)
    )
    assert np.mean(np.abs(rng.normal(0.0, 2.0, 20000)) <= expanded_of_samples(samples)) > 0.93


def test_report_of_an_estimate_adds_up():
    parts = {"a": np.array([3.0, 1.0]), "b": np.array([4.0, 2.0])}
    estimate = Estimate(np.array([10.0, 20.0]), "mm", parts)
    told = estimate.report()
    assert (told["value"], told["unit"]) == (15.0, "mm")
    assert told["total"] == pytest.approx(np.hypot(*told["parts"].values()))
    assert Estimate(np.array([1.0]), "mm").report()["total"] == 0.0


@pytest.mark.parametrize("order", [1.0, 2.0])
def test_three_times_the_error_is_stated_where_convergence_is_of_the_order_assumed(order):
    coarse, fine = 7.0 + 0.8 * np.array([1.0, 0.5]) ** order
    assert convergence_error(coarse, fine, order=order) == pytest.approx(3.0 * (coarse - 7.0))


def lines_of(*lines):
    return np.vstack(lines), np.concatenate([[0], np.cumsum([len(line) for line in lines])])


def arc(radius, angle, segments):
    turn = np.linspace(0.0, angle, segments + 1)
    return radius * np.column_stack([np.cos(turn), np.sin(turn), 0.1 * turn])


@pytest.mark.parametrize("segments", [8, 15, 16])
def test_segment_errors_cover_what_chords_miss_of_an_arc(segments):
    points, offsets = lines_of(arc(30.0, 1.5, segments), arc(50.0, 0.4, segments), [[0, 0, 0], [1, 0, 0]])
    known = np.sqrt(1.01) * np.array([45.0, 20.0, 0.0])
    missed = known[:2] - [
        np.linalg.norm(np.diff(points[a:b], axis=0), axis=1).sum() for a, b in pairwise(offsets[:3])
    ]
    stated = segment_errors(points, offsets)
    assert (missed > 0.0).all()
    assert (missed <= stated[:2]).all()
    assert (stated[:2] <= 4.0 * missed).all()
    assert stated[2] == 0.0

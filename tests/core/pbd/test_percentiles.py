"""Percentiles against numpy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.pbd.percentiles import percentiles

PERCENTS = [0.0, 5.0, 50.0, 95.0, 99.9, 100.0]


@settings(deadline=None)
@given(
    st.lists(st.floats(-1e300, 1e300) | st.sampled_from([0.0, 1.0, 1e-300, 1.0 + 1e-15]), min_size=1),
    st.floats(0.0, 100.0),
)
def test_any_numbers(values, percent):
    expected = np.percentile(values, percent)
    scale = np.abs(values).max()
    assert percentiles(np.array(values), [percent])[0] == pytest.approx(
        expected, rel=1e-12, abs=1e-12 * scale
    )


@pytest.mark.parametrize("power", [1.0, 30.0])
def test_many_numbers(power):
    values = np.random.default_rng(1).lognormal(size=30000) ** power
    assert percentiles(values, PERCENTS) == pytest.approx(np.percentile(values, PERCENTS), rel=1e-12)


def test_of_a_function_of_them():
    values = np.random.default_rng(1).uniform(size=7)
    expected = np.percentile(np.sqrt(values), PERCENTS)
    assert percentiles(values, PERCENTS, of=np.sqrt) == pytest.approx(expected, rel=1e-12)


def test_numbers_that_are_not_finite_do_no_harm():
    assert percentiles(np.array([np.inf, 1.0, 2.0]), [50.0]) == [2.0]
    assert np.isnan(percentiles(np.array([np.nan] * 3), [50.0])[0])

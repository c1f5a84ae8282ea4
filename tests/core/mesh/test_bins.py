"""Counting sort, a stable sort and a look-up, against those of numpy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.mesh.bins import count_up_to, sorted_into_bins, stable_order


@settings(deadline=None, max_examples=40)
@given(bins=st.lists(st.integers(0, 7), max_size=60))
def test_numbers_are_bin_by_bin_and_ascending_within_each(bins):
    bins = np.array(bins, dtype=np.int64)
    order, starts = sorted_into_bins(bins, 8)
    np.testing.assert_array_equal(order, np.argsort(bins, kind="stable"))
    np.testing.assert_array_equal(np.diff(starts), np.bincount(bins, minlength=8))
    assert starts[0] == 0


numbers = st.lists(st.integers(-3, 3).map(float), min_size=1, max_size=60).map(np.array)


@settings(deadline=None, max_examples=40)
@given(values=numbers)
def test_equal_values_stay_in_their_order(values):
    np.testing.assert_array_equal(stable_order(values), np.argsort(values, kind="stable"))


@settings(deadline=None, max_examples=40)
@given(values=numbers, value=st.sampled_from([-4.0, -1.0, 0.5, 2.0, 9.0]))
def test_values_up_to_one_are_counted(values, value):
    assert count_up_to(np.sort(values), value) == (values <= value).sum()

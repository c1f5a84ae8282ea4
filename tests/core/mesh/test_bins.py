"""Counting sort."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.mesh.bins import sorted_into_bins


@settings(deadline=None, max_examples=40)
@given(bins=st.lists(st.integers(0, 7), max_size=60))
def test_numbers_are_bin_by_bin_and_ascending_within_each(bins):
    bins = np.array(bins, dtype=np.int64)
    order, starts = sorted_into_bins(bins, 8)
    np.testing.assert_array_equal(order, np.argsort(bins, kind="stable"))
    np.testing.assert_array_equal(np.diff(starts), np.bincount(bins, minlength=8))
    assert starts[0] == 0

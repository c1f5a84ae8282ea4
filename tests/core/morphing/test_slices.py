import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.morphing.slices import shared_levels


@settings(deadline=None, max_examples=50)
@given(heights=st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), wide=st.booleans())
def test_heights_share_a_level_within_the_tolerance(heights, wide):
    heights, tolerance = np.array(heights), 10.0 if wide else 0.0
    levels, slice_of = shared_levels(heights, tolerance)
    assert (np.diff(levels) > 0).all()
    assert np.array_equal(np.unique(slice_of), np.arange(len(levels)))
    assert np.abs(levels[slice_of] - heights).max() <= tolerance / 2 * (1 + 1e-9)
    for level in range(len(levels)):
        assert np.ptp(heights[slice_of == level]) <= tolerance * (1 + 1e-9)
    if tolerance == 0.0:
        assert np.array_equal(levels, np.unique(heights))

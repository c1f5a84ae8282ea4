"""Filters that look for the ends of a muscle pass over via rings."""

import numpy as np
import pytest

from vtkmuscle import filters
from vtkmuscle.data.arrays import point_array, points_of
from vtkmuscle.pipelines import decompose

turn = 2.0 * np.pi * np.arange(8) / 8
#: Round the belly of the spindle, and within it: a ring that an attachment's patch could be made from.
RINGS = {
    name: np.column_stack([radius * np.cos(turn), radius * np.sin(turn) - 32.0, np.full(8, 10.0)])
    for name, radius in (("round", 18.0), ("within", 8.0))
}


def with_ring(attachments, ring):
    areas = filters.attachments_of(attachments, "test")
    return filters.attachments_from([filters.AttachmentArea("via", "proximal", ring, closed=True), *areas])


@pytest.mark.parametrize("ring", RINGS.values(), ids=RINGS)
def test_a_via_ring_fixes_no_point(spindle, ring):
    muscle, areas = spindle.muscles["spindle"], spindle.attachments["spindle"]
    fixed = [filters.FixedPointDetector()(muscle, spindle.bones, a) for a in (areas, with_ring(areas, ring))]
    without, beside = (point_array(muscle, "FixedTo", "test") for muscle in fixed)
    assert (without >= 0).any()
    np.testing.assert_array_equal(beside, without)


@pytest.mark.parametrize("ring", RINGS.values(), ids=RINGS)
@pytest.mark.parametrize("method", ["plane", "harmonic"])
def test_fibres_are_those_without_the_ring(spindle, method, ring):
    muscle, areas = spindle.muscles["spindle"], spindle.attachments["spindle"]
    without, beside = (
        decompose(muscle, a, method=method, n_fibres=8, resolution=6).update().output
        for a in (areas, with_ring(areas, ring))
    )
    np.testing.assert_array_equal(points_of(beside), points_of(without))


def test_a_via_ring_is_no_end(spindle):
    ring = filters.AttachmentArea("via", "proximal", RINGS["round"], closed=True)
    origin, _ = filters.attachments_of(spindle.attachments["spindle"], "test")
    with pytest.raises(ValueError, match="no area with the role 'insertion'"):
        decompose(spindle.muscles["spindle"], filters.attachments_from([origin, ring])).update()

import numpy as np
from numpy.testing import assert_allclose

from examples import PHANTOM, fibres, moving_bones
from vtkmuscle.core.motion.blending import blend_fibres
from vtkmuscle.data.arrays import cell_array, field_array, points_of, polylines_of
from vtkmuscle.filters.linear_blend_fibres import LinearBlendFibres

NAMES = {"origin": "proximal", "insertion": "distal"}


def test_fibres_are_blended_between_the_named_bones():
    lines = polylines_of(fibres(), "")
    transforms = [PHANTOM.motion.at(4.0).get(name, np.eye(4)) for name in NAMES.values()]
    moved = LinearBlendFibres(a=-0.042, **NAMES)(fibres(), moving_bones())
    assert_allclose(
        points_of(moved), blend_fibres(lines.points, lines.offsets, *transforms, -0.042), atol=1e-9
    )
    assert_allclose(cell_array(moved, "RestLength", ""), 140, rtol=1e-9)
    assert_allclose(field_array(moved, "BlendA"), -0.042)
    swapped = LinearBlendFibres(origin="distal", insertion="proximal")(fibres(), moving_bones())
    assert np.abs(points_of(swapped) - points_of(moved)).max() > 1.0

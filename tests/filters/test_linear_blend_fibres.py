import numpy as np
import pytest
from numpy.testing import assert_allclose

from examples import PHANTOM, fibres, moving_bones
from vtkmuscle.core.bones.bone import bone_of, depth_in
from vtkmuscle.core.fibres.linear_blend import blend_fibres
from vtkmuscle.data.arrays import (
    blocks_of,
    cell_array,
    checked_surface,
    field_array,
    multiblock_from,
    points_of,
    polylines_of,
    set_field_array,
    surface_from,
)
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.linear_blend_fibres import LinearBlendFibres
from vtkmuscle.phantoms.meshing import box

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


def test_without_a_motion_fibres_stay_where_they_are():
    moved = LinearBlendFibres(a=0.7, **NAMES)(fibres(), moving_bones(0.0))
    assert_allclose(points_of(moved), points_of(fibres()), atol=1e-9)


def test_times_are_those_of_the_bones():
    bones = BoneMotion(motion=PHANTOM.motion)
    bones.connect(0, PHANTOM.bones)
    blend = LinearBlendFibres(**NAMES)
    blend.connect(0, fibres())
    blend.connect(1, bones)
    late = points_of(blend.update(time=PHANTOM.motion.times[-1]).output)
    early = points_of(blend.update(time=PHANTOM.motion.times[0]).output)
    assert_allclose(early, points_of(fibres()), atol=1e-9)
    assert np.abs(late - early).max() > 10


def test_with_fit_the_fibres_are_no_deeper_in_the_bones():
    bones = moving_bones(90.0)
    posed = [(bone_of(*checked_surface(bone, name)), np.eye(4)) for name, bone in blocks_of(bones)]
    fitted = LinearBlendFibres(fit=True, **NAMES)(fibres(), bones)
    plain = LinearBlendFibres(**NAMES)(fibres(), bones)
    assert depth_in(posed, points_of(fitted)).sum() <= depth_in(posed, points_of(plain)).sum()
    assert -1 <= field_array(fitted, "BlendA")[0] <= 1


def test_a_bone_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="insertion is 'tibia', but the bones are 'proximal', 'distal'"):
        LinearBlendFibres(insertion="tibia")(fibres(), moving_bones())


def test_a_fit_that_ends_at_its_bound_says_so():
    # A wall in the way of the moving end alone: the more fibres follow the still one, the better.
    points, triangles = box((-60, -200, -200), (60, 300, 30), 60.0)
    wall = surface_from(points, triangles)
    still, moving = moving_bones(0.0), moving_bones(40.0)
    blocks = {"proximal": still.GetBlock(0), "distal": moving.GetBlock(1), "wall": wall}
    set_field_array(wall, "Transform", np.eye(4).reshape(16))
    bones = multiblock_from(blocks)
    with pytest.warns(UserWarning, match=r"the fit of a ends at its bound, .*largest_a"):
        fitted = LinearBlendFibres(fit=True, largest_a=0.4, **NAMES)(fibres(), bones)
    assert abs(field_array(fitted, "BlendA")[0]) == 0.4

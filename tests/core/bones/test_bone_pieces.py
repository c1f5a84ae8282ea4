"""Bones of several closed pieces, wherever these lie."""

import numpy as np
import pytest
from shapes import box, distance_to_box, sphere, union

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.phantoms.meshing import box as meshed_box

PLATE = (0.0, 0.0, 0.0), (20.0, 20.0, 0.6)
FAR_PLATE = (100.0, 0.0, 0.0), (120.0, 20.0, 0.6)


def samples(rng, low, high, count=2000):
    return rng.uniform(low, high, (count, 3))


@pytest.mark.parametrize("far_first", [True, False], ids=["before", "after"])
def test_a_piece_far_away_changes_nothing(rng, far_first):
    pieces = [box(*FAR_PLATE), box(*PLATE)] if far_first else [box(*PLATE), box(*FAR_PLATE)]
    bone = Bone(*union(*pieces), cell=1.0)
    points = samples(rng, (-2.0, -2.0, -2.0), (22.0, 22.0, 3.0))
    exact = distance_to_box(points, *PLATE)
    np.testing.assert_allclose(bone.solids.exact(points)[0], exact, atol=1e-9)
    np.testing.assert_allclose(bone.field(points)[0], exact, atol=0.87)


@pytest.mark.parametrize("offset", [0.0, 1e4, 1e6])
def test_a_bone_far_from_the_origin_is_measured_as_one_near_it(rng, offset):
    points, triangles = sphere(10.0, 500)
    at = samples(rng, -13.0, 13.0, 500)
    here, there = Bone(points, triangles), Bone(points + offset, triangles)
    np.testing.assert_allclose(there.solids.exact(at + offset)[0], here.solids.exact(at)[0], atol=1e-8)
    np.testing.assert_allclose(there.field(at + offset)[0], here.field(at)[0], atol=1e-4)


def test_points_of_no_triangle_change_nothing(rng):
    points, triangles = sphere(10.0, 500)
    at = samples(rng, -13.0, 13.0, 500)
    more = Bone(np.vstack([np.full(3, 1e5), points]), triangles + 1)
    np.testing.assert_array_equal(more.field(at)[0], Bone(points, triangles).field(at)[0])


def test_a_bone_of_one_piece_is_its_piece():
    """Crumbs, hollows and the last of many small pieces are parts of the largest."""
    many = [meshed_box((4.0 * i, 0, 0), (4.0 * i + 2.0, 2, 2), 2.0) for i in range(5, 65)]
    few = meshed_box((50, 50, 50), (51, 51, 51), 1.0), meshed_box((3, 3, 3), (7, 7, 97), 2.0)
    for others in ([], few, many):
        bone = Bone(*union(meshed_box((0, 0, 0), (10, 10, 100), 2.0), *others))
        assert bone.pieces == (bone,)


def test_two_rods_are_two_pieces_with_directions_of_their_own():
    bone = Bone(*union(meshed_box((0, 0, 0), (10, 10, 100), 5.0), meshed_box((20, 0, 0), (30, 10, 90), 5.0)))
    first, second = bone.pieces
    at = np.array([[15.5, 5.0, 50.0]])
    np.testing.assert_allclose(first.solids.exact(at)[1], [[1.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(second.solids.exact(at)[1], [[-1.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(first.solids.exact(at)[0], 5.5)
    assert first.cell == second.cell == bone.cell
    assert len(first.triangles) + len(second.triangles) == len(bone.triangles)

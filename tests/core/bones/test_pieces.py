"""A bone of several pieces: which are pieces of their own, and that they are all of it."""

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.phantoms.meshing import box


def joined(*surfaces):
    """Return surfaces as one."""
    first = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    triangles = [faces + start for (_, faces), start in zip(surfaces, first, strict=False)]
    return np.vstack([points for points, _ in surfaces]), np.vstack(triangles)


def test_a_bone_of_one_piece_is_its_piece():
    bone = Bone(*box((0, 0, 0), (10, 10, 100), 5.0))
    assert bone.pieces == (bone,)


def test_two_rods_are_two_pieces_with_directions_of_their_own():
    bone = Bone(*joined(box((0, 0, 0), (10, 10, 100), 5.0), box((20, 0, 0), (30, 10, 90), 5.0)))
    first, second = bone.pieces
    at = np.array([[15.5, 5.0, 50.0]])
    np.testing.assert_allclose(first.exact(at)[1], [[1.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(second.exact(at)[1], [[-1.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(first.exact(at)[0], 5.5)
    assert first.cell == second.cell == bone.cell
    assert len(first.triangles) + len(second.triangles) == len(bone.triangles)


def test_crumbs_and_hollows_stay_with_the_largest_piece():
    crumb = box((50, 50, 50), (51, 51, 51), 1.0)
    hollow = box((3, 3, 3), (7, 7, 97), 2.0)
    bone = Bone(*joined(box((0, 0, 0), (10, 10, 100), 2.0), crumb, hollow))
    assert bone.pieces == (bone,)

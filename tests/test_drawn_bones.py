"""Bones as pictures have them: coarser, in place, and seen from outside alone where they are solid."""

import numpy as np
import pytest
import pyvista as pv
from tiny_scene import ellipsoid

from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.motion.rigid import rotation_about
from vtkmuscle.data.arrays import checked_surface, multiblock_from, points_of, surface_from, triangles_of
from vtkmuscle.plotting import views
from vtkmuscle.plotting.views import DrawnBones, clustered


@pytest.fixture
def ball():
    return ellipsoid((30, 30, 30), (0, 0, 0), 30)


def test_a_fine_bone_is_drawn_coarser_and_stays_within_a_fraction_of_a_triangle():
    fine = ellipsoid((30, 40, 100), (5, 0, 0), 160)
    points, triangles = points_of(fine), triangles_of(fine, "bone")
    kept, faces = clustered(points, triangles, pv.wrap(fine).area, 5000)
    coarse, normals = points[kept], vertex_normals(points, triangles)[kept]
    assert 2500 < len(faces) < 8000
    assert len(np.unique(kept)) == len(kept)
    assert faces.max() < len(coarse)
    edges = np.linalg.norm(coarse[faces[:, 0]] - coarse[faces[:, 1]], axis=1)
    middles = coarse[faces].mean(axis=1)
    assert np.abs(solids_of(*checked_surface(fine, "test")).distances(middles)).max() < 0.2 * edges.mean()
    outward = (coarse - [5, 0, 0]) / np.array([30, 40, 100]) ** 2
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert (normals * outward).sum(axis=1).min() > 0.99


def test_bones_that_are_coarse_are_drawn_as_they_are(ball):
    stray = surface_from(np.vstack([np.full(3, 1e5), points_of(ball)]), 1 + triangles_of(ball, "ball"))
    (drawn,) = DrawnBones(multiblock_from({"ball": stray})).by_name.values()
    np.testing.assert_array_equal(drawn.points, points_of(ball))
    np.testing.assert_array_equal(drawn.triangles, triangles_of(ball, "ball"))


def test_all_bones_together_have_no_more_triangles_than_a_picture_shows(ball, monkeypatch):
    monkeypatch.setattr(views, "TRIANGLES", 1500)
    drawn = DrawnBones(multiblock_from({"one": ball, "other": ellipsoid((9, 9, 40), (50, 0, 0), 40)})).by_name
    assert 750 < sum(len(bone.triangles) for bone in drawn.values()) < 2 * 1500


@pytest.mark.parametrize(
    ("change", "solid"),
    [
        (lambda faces: faces, True),
        (lambda faces: faces[1:], False),
        (lambda faces: faces[:, ::-1], False),
        (lambda faces: np.vstack([faces[:1, ::-1], faces[1:]]), False),
        (lambda faces: np.roll(faces, 1, axis=1), True),
    ],
    ids=["whole", "a triangle is missing", "inside out", "a triangle is turned", "other first corners"],
)
def test_only_what_is_closed_and_faces_outward_is_solid(ball, change, solid):
    surface = surface_from(points_of(ball), np.ascontiguousarray(change(triangles_of(ball, "ball"))))
    assert DrawnBones(multiblock_from({"ball": surface})).by_name["ball"].solid is solid


def test_points_are_spread_over_bones_evenly_and_move_with_them(ball):
    bones = DrawnBones(multiblock_from({"still": ball, "moved": ellipsoid((30, 30, 30), (200, 0, 0), 30)}))
    still, moved = np.split(bones.spread({"moved": rotation_about((0, 10, 0), (0, 0, 1), 90.0)}), 2)
    for points, centre in ((still, (0, 0, 0)), (moved, (10, 210, 0))):
        np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 30.0, atol=0.5)
        assert np.abs((points - centre).mean(axis=0)).max() < 1.0

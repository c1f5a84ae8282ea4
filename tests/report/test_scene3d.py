"""The scene of a page: small, and where the result has it."""

import itertools

import numpy as np
import pytest
from packed_arrays import array_of, moving_of, unpacked
from tiny_scene import ellipsoid

from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import checked_surface, points_of
from vtkmuscle.report import data as scene3d
from vtkmuscle.report.data import Pack


@pytest.fixture
def packed(run_folder):
    pack = Pack()
    return scene3d.scene_of(run_folder[1], pack), unpacked(pack.text())


def test_muscles_and_fibres_are_where_the_result_has_them(run_folder, packed):
    result, (scene, data) = run_folder[1], packed
    for one in scene["muscles"]:
        surface = one["surface"]
        frames, half = moving_of(data, surface["points"]), surface["points"]["step"]
        for where in (surface["points"]["high"], one["fibres"]["length"]):
            assert where["at"] % 4 == 0, "a page's arrays of 32 bits begin at a multiple of four bytes"
        np.testing.assert_allclose(frames[0], points_of(result.rest_muscle(one["name"])), atol=half)
        for place, position in enumerate(scene["shown"]):
            frame = result.frames[position]
            np.testing.assert_allclose(
                frames[place + 1], points_of(result.muscle(one["name"], frame=frame)), atol=half
            )
            fibres = points_of(result.fibres(one["name"], frame=frame))
            shown = moving_of(data, one["fibres"]["points"])[place]
            np.testing.assert_allclose(shown, fibres, atol=one["fibres"]["points"]["step"])
        lengths = array_of(data, one["fibres"]["length"]).reshape(len(result.frames), -1)
        np.testing.assert_allclose(lengths, result.fibre_lengths[one["name"]], rtol=1e-6)


def test_bones_move_as_the_result_says(run_folder, packed):
    result, (scene, data) = run_folder[1], packed
    for bone in scene["bones"]:
        rest, rows = moving_of(data, bone["points"])[0], bone["transforms"]
        for place, position in enumerate(scene["shown"]):
            transform = np.eye(4)
            if rows is not None:
                transform[:3] = np.reshape(rows[12 * place : 12 * place + 12], (3, 4))
            moved = points_of(result.bones(frame=result.frames[position])[bone["name"]])
            np.testing.assert_allclose(
                apply_transform(transform, rest), moved, atol=2 * bone["points"]["step"] + 1e-4
            )


def test_a_fine_muscle_keeps_some_of_its_points_and_they_move_as_they_do():
    fine = ellipsoid((8, 8, 40), (0, 0, 0), 100)
    points = points_of(fine)
    kept, triangles = scene3d._thinned(*checked_surface(fine, "muscle"), 1000)
    assert 800 < len(triangles) <= 1000
    assert len(np.unique(kept)) == len(kept)
    assert triangles.max() < len(kept)
    middles = points[kept][triangles].mean(axis=1)
    assert np.abs(solids_of(*checked_surface(fine, "test")).distances(middles)).max() < 0.5


@pytest.mark.parametrize(("count", "most"), [(1, 1), (2, 2), (120, 120), (1000, 120)])
def test_of_many_frames_as_many_are_shown_as_a_page_bears(count, most):
    shown = scene3d.shown_of(count)
    assert len(shown) == most
    assert shown[0] == 0
    assert shown[-1] == count - 1
    assert all(a < b for a, b in itertools.pairwise(shown))


def test_of_many_fibres_some_are_drawn(run_folder, monkeypatch):
    monkeypatch.setattr(scene3d, "POINTS", 2 * 5 * 6 * 3)
    pack = Pack()
    for one in scene3d.scene_of(run_folder[1], pack)["muscles"]:
        fibres = one["fibres"]
        assert fibres["count"] == 3
        assert fibres["all"] == 6
        assert array_of(unpacked(pack.text()), fibres["sizes"]).sum() == fibres["points"]["points"]

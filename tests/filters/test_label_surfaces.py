"""LabelSurfaces against the surfaces of which the labels were made."""

from dataclasses import replace

import numpy as np
import pytest
from phantoms import label_map, spindle_over_hinge

from vtkmuscle.core.mesh.surface import signed_volume, survey
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array, field_string
from vtkmuscle.data.label_images import Label, label_field, label_image, label_surface
from vtkmuscle.filters import LabelSurfaces

BALL = np.linalg.norm(np.indices((30, 30, 30)) - 14.5, axis=0) < 10.2


def surface_of(voxels, frame=None):
    frame = np.eye(4) if frame is None else frame
    return LabelSurfaces()(label_image(voxels.astype(np.uint8), frame, {1: "ball"})).GetBlock(0)


def test_a_surface_is_where_the_image_is_and_faces_outward():
    """An askew, left-handed image of long voxels takes the ball with it."""
    turn, frame = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, -1.0]]), np.eye(4)
    frame[:3, :3] = turn * [1.0, 1.0, 2.0]
    frame[:3, 3] = (100.0, -200.0, 300.0)
    points, triangles = checked_surface(surface_of(BALL, frame), "ball")
    assert signed_volume(points, triangles) == pytest.approx(BALL.sum() * 2.0, rel=1e-3)
    back = (points - frame[:3, 3]) @ np.linalg.inv(frame[:3, :3]).T
    assert back.mean(axis=0) == pytest.approx([14.5] * 3, abs=0.1)
    assert np.linalg.norm(back - 14.5, axis=1) == pytest.approx(10.2, abs=0.6)


def test_what_was_left_out_filled_and_cut_is_said():
    voxels = BALL.copy()
    voxels[14:16, 14:16, 14:16] = False
    voxels[:3, :3, :3] = True
    surface = surface_of(voxels[:, :, 8:])
    assert field_array(surface, "Filled")[0] == 8
    assert field_array(surface, "Pieces")[0] == 1  # the cube was cut off with the border
    assert field_array(surface, "Cut")[0] == BALL[:, :, 8].sum()
    surface = surface_of(voxels)
    assert field_array(surface, "Pieces")[0] == 2
    assert field_array(surface, "LeftOut")[0] == pytest.approx(27 / (BALL.sum() - 8 + 27))
    assert field_array(surface, "Cut")[0] == 0


@pytest.mark.parametrize("edge", [0.5, 3.0, 20.0])
@pytest.mark.parametrize("smoothing", [0.0, 0.7, 4.0])
@pytest.mark.parametrize("shape", ["speck", "two specks", "sheet", "hair", "sponge"])
def test_what_is_thin_or_rough_is_closed_and_manifold_too(shape, smoothing, edge):
    voxels = np.zeros((24, 24, 24), dtype=bool)
    voxels[2, 2, 2] = True
    voxels[3, 3, 3] = shape == "two specks"
    voxels[2] |= shape == "sheet"
    voxels[:, 2, 2] |= shape == "hair"
    if shape == "sponge":
        voxels[1:14, 1:14, 1:14] = np.random.default_rng(5).random((13, 13, 13)) < 0.5
    image = label_image(voxels.astype(np.uint8), np.eye(4), {})
    surface = LabelSurfaces(smoothing=smoothing, edge=edge)(image).GetBlock(0)
    if field_string(surface, "Refused"):
        assert "speck" in shape  # of one or two voxels
        assert surface.GetNumberOfPoints() == 0
        return
    report = survey(*checked_surface(surface, shape))
    assert (report.closed, report.manifold, report.oriented, report.n_components) == (True, True, True, 1)
    assert report.n_degenerate_triangles == 0
    assert field_array(surface, "LabelVolume")[0] == pytest.approx(report.volume, rel=0.01)


def test_a_label_without_a_surface_is_refused_with_the_reason(monkeypatch):
    ball = label_field(np.pad(BALL, 1), np.eye(4), smoothing=0.7)
    half = replace(ball, values=ball.values[: len(ball.values) // 2])  # open where it was cut
    with pytest.raises(ValueError, match=r"not closed and manifold at \d+ edges; smooth or remove the label"):
        label_surface(half, 3.0)
    monkeypatch.setattr(Label, "field", lambda *_: half)
    surface = surface_of(BALL)
    assert surface.GetNumberOfPoints() == 0
    assert "not closed and manifold" in field_string(surface, "Refused")
    assert field_array(surface, "LabelVolume")[0] == BALL.sum()


def test_labels_are_chosen_by_name():
    chosen = LabelSurfaces(labels="spindle, distal")(label_map(spindle_over_hinge(), spacing=4.0))
    assert [name for name, _ in blocks_of(chosen)] == ["spindle", "distal"]


def test_a_label_of_ten_metres_is_refused_before_it_is_made():
    surface = surface_of(BALL, np.diag([1.0, 500.0, 1.0, 1.0]))
    assert surface.GetNumberOfPoints() == 0
    assert field_string(surface, "Refused").endswith("m long; check the voxel size")

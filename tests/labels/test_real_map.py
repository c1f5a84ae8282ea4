"""A real map of a pelvis, and a real hip: what comes of them in one command."""

import pytest
from commands import vtkmuscle_

import vtkmuscle
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.data.arrays import blocks_of, checked_surface
from vtkmuscle.filters import LabelSurfaces
from vtkmuscle.labels.reading import read_labels

pytestmark = [pytest.mark.realdata, pytest.mark.slow]


@pytest.fixture
def label_map(label_data):
    pytest.importorskip("SimpleITK")
    return label_data / "totalsegmentator_pelvis_3mm.nii.gz"


def test_all_labels_are_closed_and_manifold(label_map):
    (image,) = read_labels(label_map)
    surfaces = dict(blocks_of(LabelSurfaces()(image)))
    assert {"femur_left", "gluteus_medius_right", "vertebrae_L5"} <= set(surfaces)
    for name, surface in surfaces.items():
        report = survey(*checked_surface(surface, name))
        assert (report.closed, report.manifold, report.oriented, report.n_components) == (True, True, True, 1)


def test_a_real_map_becomes_a_scene(label_map, tmp_path):
    done = vtkmuscle_("from-labels", label_map, "--out", tmp_path)
    scene = vtkmuscle.Scene.load(tmp_path / "scene.toml")
    assert {"gluteus_minimus_left", "gluteus_minimus_right", "iliopsoas_left"} <= set(scene.muscles)
    # Heads of 24 and 25 mm lie on either side, at one height.
    left, right = (scene.motion.centre_of(f"femur_{side}") for side in ("left", "right"))
    assert abs(left[0] - right[0]) == pytest.approx(165.0, abs=3.0)
    assert left[2] == pytest.approx(right[2], abs=4.0)
    # Both glutei maximi are cut by the border, which is why they have no insertion.
    for name in ("gluteus_maximus_left", "gluteus_maximus_right"):
        assert f"left out: {name}: the muscle extends" in done.output
    assert "muscles.gluteus_maximus_left.surface: closed at the border" in done.output
    assert ("spleen: ignored" in done.output, scene.name) == (True, tmp_path.name)


def test_a_real_hip_is_drawn_up_from_its_meshes(lhdl_hip, tmp_path):
    files = [*(lhdl_hip / "bones").glob("*.vtp"), *(lhdl_hip / "muscles").glob("*.vtp")]
    vtkmuscle_("init", *files, "--out", tmp_path)
    scene = vtkmuscle.Scene.load(tmp_path / "scene.toml")
    assert len(scene.muscles) == 4
    # As published with the data set.
    assert scene.motion.centre_of("femur_right") == pytest.approx([143.478, 243.439, -432.670], abs=0.5)

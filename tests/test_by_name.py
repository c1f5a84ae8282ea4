"""Scenes and results as mappings, settings of a run, and cells of notebooks."""

import pickle
import re
import tomllib
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
import pyvista as pv

import vtkmuscle
from vtkmuscle import InputError, Muscle, Scene, phantoms
from vtkmuscle.plotting import can_render


@pytest.fixture(scope="module")
def scene():
    return Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)


@pytest.fixture(scope="module")
def result(scene):
    return scene.run(frames="2:6", muscles="spindle", quality="preview", n_fibres=5)


def test_a_scene_and_a_result_are_read_by_names(scene, result):
    assert list(scene) == ["spindle", "proximal", "distal"]
    assert len(scene) == 3
    assert "distal" in scene
    assert "muscle" not in scene
    assert dict(scene.items())["spindle"].n_cells == scene["spindle"].n_cells
    assert list(result) == list(result.keys()) == ["spindle"]
    assert [muscle.verdict for muscle in result.values()] == ["ok"]
    assert "thigh" not in result
    for kind in (Scene, vtkmuscle.Result):
        with pytest.raises(TypeError, match=rf"takes no path; write {kind.__name__}.load\('here'\)"):
            kind("here")


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("bones", None, r"Scene.bones is None, but bones must be a mapping of names to vtkPolyData"),
        ("bones", {"shin": "shin.stl"}, r"Scene.bones\['shin'\] is 'shin.stl', but bones must be"),
        ("muscles", {"soleus": pv.Sphere()}, r"Scene.muscles\['soleus'\] is PolyData .* names to Muscle"),
        ("motion", "motion.csv", r"Scene.motion is 'motion.csv', but must be a RigidMotion, such as of"),
    ],
)
def test_content_of_another_kind_is_refused(scene, field, value, told):
    with pytest.raises(TypeError, match=told):
        replace(scene, **{field: value})
    with pytest.raises(TypeError, match="Muscle takes attachment areas, but got 'estimate'; AttachmentEst"):
        Muscle(pv.Sphere(), "estimate")  # as in a scene.toml


def test_settings_of_a_run_are_those_of_the_scene(scene, result):
    assert result.lengths["spindle"].shape == (4, 5)
    assert scene.muscles["spindle"].fibres["n_fibres"] == 8  # the scene itself stays
    same = scene.with_settings(quality="preview", n_fibres=5).run(frames="2:6")
    assert np.array_equal(same.lengths["spindle"], result.lengths["spindle"])


def test_a_result_goes_to_another_process(result):
    """A data set of many blocks could not be pickled."""
    other = pickle.loads(pickle.dumps(result))
    assert np.array_equal(other.muscle("spindle", frame=3).points, result.muscle("spindle", frame=3).points)
    assert np.array_equal(other.bones(frame=3)[1].points, result.bones(frame=3)[1].points)


def test_a_time_is_that_of_the_nearest_frame_within_half_a_step(result):
    assert result.times == [4.0, 6.0, 8.0, 10.0]
    at_six = result.muscle("spindle", frame=3).points
    for time in (5.1, 6.0, 6.9):
        assert np.array_equal(result.muscle("spindle", time=time).points, at_six)
    assert np.array_equal(result.muscle("spindle", frame=-3).points, at_six)
    for time in (2.9, 11.1, np.nan):
        with pytest.raises(InputError, match="there are 4, 6, 8, 10"):
            result.muscle("spindle", time=time)


def test_a_muscle_has_length_volume_and_picture(scene, result):
    muscle = result["spindle"]
    assert np.array_equal(muscle.length, result.lengths["spindle"].mean(axis=1))
    assert muscle.volume == pytest.approx(scene["spindle"].volume, rel=1e-6)


def test_names_of_other_packages_are_answered_by_names_that_are_there(scene, result):
    every = {"vtkmuscle": vtkmuscle, "Scene": scene, "Result": result, "MuscleResult": result["spindle"]}
    every["MomentArmTable"] = result.moment_arms()
    tables = tomllib.loads((files("vtkmuscle.core") / "words.toml").read_text())
    for owner, name, hint in ((of, *pair) for of in every for pair in tables[of].items()):
        with pytest.raises(AttributeError, match=re.escape(f"write {hint}")):
            getattr(every[owner], name)
        word = re.match(r"(vtkmuscle\.|len\(|list\()?(\w*)", hint)[2]
        assert not word or hasattr(every[owner], word) or hasattr(vtkmuscle, word), (owner, name)


def test_cells_of_notebooks_show_tables_and_pictures(scene, result):
    if can_render() is None:
        assert "data:image/png;base64" in scene._repr_html_()
        assert "data:image/png;base64" in result._repr_html_()
        assert "data:image/png;base64" in result["spindle"]._repr_html_()
    assert "<td>spindle</td><td>ok</td>" in result._repr_html_()
    cell = result.length_table()._repr_html_()
    assert len(re.findall("<tr>", cell)) == 21  # names, and 20 rows at most
    assert "Table: 20 rows" in cell


@pytest.mark.optional
def test_an_xarray_has_the_numbers_of_the_tables(scene, result):
    pytest.importorskip("xarray")
    data = result.to_xarray().sel(muscle="spindle")
    assert np.array_equal(data["time"], result.times)
    assert np.array_equal(data["distal_angle"], result.times)
    assert np.array_equal(data["length_mm"].transpose("frame", "fibre"), result.lengths["spindle"])
    assert np.array_equal(
        data["fibre_length_mm"].transpose("frame", "fibre"), result.fibre_lengths["spindle"]
    )
    arms = data["moment_arm_mm"].sel(coordinate="distal_angle").transpose("frame", "fibre")
    assert np.array_equal(arms, result["spindle"].moment_arms["distal_angle"].arms)
    assert np.array_equal(arms["frame"], result.frames)
    assert np.isnan(scene.run(frames="0:2", deformer="pbd").to_xarray()["length_mm"]).all()

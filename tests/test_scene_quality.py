"""The deformer and the preset of a scene: keys, explicit settings, and options of the command line."""

import json
from dataclasses import replace

import numpy as np
import pytest
from commands import refused, vtkmuscle_

from vtkmuscle import Result, Scene, SceneError
from vtkmuscle.filters.taut_paths import PATH_PRESETS
from vtkmuscle.run import muscle_pipeline


def test_a_preset_is_below_the_scenes_own_settings_and_survives_a_round_trip(scene_file, tmp_path):
    scene_file.write_text('quality = "accurate"\n' + scene_file.read_text() + "[paths]\nlevers = false\n")
    scene = Scene.load(scene_file)
    pipeline = muscle_pipeline(scene, "spindle")
    assert (pipeline.deformer.iterations, pipeline.taut_paths.levers) == (3, False)
    assert pipeline.taut_paths.resolution == PATH_PRESETS["accurate"]["resolution"]
    again = Scene.load(scene.save(tmp_path / "again"))
    assert (again.quality, again.paths) == ("accurate", {"levers": False})
    assert Scene.load(replace(scene, quality=None).save(tmp_path / "none")).quality is None


def test_an_unknown_preset_is_refused_with_the_nearest(scene_file):
    scene_file.write_text('quality = "balance"\n' + scene_file.read_text())
    with pytest.raises(SceneError, match=r"quality: must be .*, not 'balance'; did you mean 'balanced'\?"):
        Scene.load(scene_file)


def with_deformer(scene_file, deformer, setting="iterations = 3", more=""):
    text = scene_file.read_text().replace("iterations = 3", setting)
    scene_file.write_text(f'deformer = "{deformer}"\n{more}{text}')
    return scene_file


@pytest.mark.parametrize(
    ("deformer", "setting", "more", "told"),
    [
        ("volume", "", "", r"deformer: must be .*, not 'volume'; .*paths, pbd, none"),
        ("paths", "velocity_kept = 1.0", "", r"solver.velocity_kept: deformer 'paths' has no such setting"),
        ("none", "iterations = 3", "", r"solver.iterations: deformer 'none' has no such setting; remove it"),
        ("paths", "", 'quality = "published"\n', r"quality: 'published' is a preset of deformer 'pbd'"),
        (
            "none",
            "",
            'muscle_contact = "on"\n',
            r"muscle_contact: 'on' needs deformed .*, but deformer is 'none'",
        ),
    ],
)
def test_settings_of_another_deformer_are_refused(scene_file, deformer, setting, more, told):
    with pytest.raises(SceneError, match=told):
        Scene.load(with_deformer(scene_file, deformer, setting, more))


def test_another_deformer_drops_settings_and_a_setting_at_fault_is_not_told_of_the_file(scene_file):
    scene = Scene.load(scene_file)
    assert scene.with_settings(deformer="none").solver == {}
    assert scene.with_settings(deformer="pbd").solver == {"iterations": 3}
    with pytest.raises(SceneError, match=r"^scene: quality: 'published' is a preset of deformer 'pbd'"):
        scene.with_settings(quality="published")


def ran(scene_file, out, *options):
    """Return the report of a run of two frames."""
    vtkmuscle_("run", scene_file, "--out", out, "--frames", "0:2", "--no-figures", *options)
    return json.loads((out / "report.json").read_text())


def test_the_option_of_the_quality_takes_the_keys_place(scene_file, tmp_path):
    report = ran(scene_file, tmp_path / "out", "--quality", "accurate")
    settings = report["muscles"]["spindle"]["parameters"]
    assert settings["solver"]["iterations"] == 3
    assert settings["paths"]["resolution"] == PATH_PRESETS["accurate"]["resolution"]
    assert "not 'best'" in refused("run", scene_file, "--out", tmp_path / "other", "--quality", "best")


def test_the_option_of_the_deformer_takes_the_keys_place_and_gives_the_same_paths(scene_file, tmp_path):
    with_deformer(scene_file, "paths", setting="")
    outs = tmp_path / "paths", tmp_path / "none"
    for out in outs:
        report = ran(scene_file, out, "--deformer", out.name)
        assert report["deformer"] == out.name
    deformed, pulled = (Result.load(out).lengths["spindle"] for out in outs)
    np.testing.assert_array_equal(pulled, deformed)
    assert not (outs[1] / "spindle.pvd").exists()
    said = refused("run", scene_file, "--out", tmp_path / "other", "--deformer", "pbx")
    assert "did you mean 'pbd'" in said

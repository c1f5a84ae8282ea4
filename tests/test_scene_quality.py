"""The preset of a scene: its key, its place below explicit settings, and the command line's option."""

import json
from dataclasses import replace

import pytest
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

from vtkmuscle import Scene, SceneError
from vtkmuscle.cli import app
from vtkmuscle.filters.deformer.settings import PRESETS


@pytest.fixture
def scene_file(tmp_path):
    return write_tiny_scene(tmp_path / "scene")


def test_a_preset_is_below_the_scenes_own_settings_and_survives_a_round_trip(scene_file, tmp_path):
    scene_file.write_text('quality = "accurate"\n' + scene_file.read_text())
    scene = Scene.load(scene_file)
    assert scene.solver_of("spindle") == {"quality": "accurate", "iterations": 3}
    assert Scene.load(scene.save(tmp_path / "again")).quality == "accurate"
    assert Scene.load(replace(scene, quality=None).save(tmp_path / "none")).quality is None


def test_an_unknown_preset_is_refused_with_the_nearest(scene_file):
    scene_file.write_text('quality = "balance"\n' + scene_file.read_text())
    with pytest.raises(SceneError, match=r"quality: 'balance' is not allowed; did you mean 'balanced'\?"):
        Scene.load(scene_file)


def test_voxels_without_the_published_quality_are_refused(scene_file):
    text = scene_file.read_text()
    scene_file.write_text(text.replace("iterations = 3", 'iterations = 3\ncollision = "voxel"'))
    with pytest.raises(SceneError, match="solver: collision is 'voxel', which goes with quality 'published'"):
        Scene.load(scene_file)
    scene_file.write_text('quality = "published"\n' + scene_file.read_text())
    assert Scene.load(scene_file).solver_of("spindle")["collision"] == "voxel"


def test_the_option_takes_the_keys_place_and_tells_what_stays(scene_file, tmp_path):
    arguments = ["run", scene_file, "--out", tmp_path / "out", "--frames", "0:2", "--no-figures"]
    arguments = [*map(str, arguments), "--quality", "accurate"]
    run = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert run.exit_code == 0
    assert "solver.iterations = 3" in run.output
    report = json.loads((tmp_path / "out/report.json").read_text())
    settings = report["muscles"]["spindle"]["parameters"]["solver"]
    assert settings["iterations"] == 3
    assert settings["taut_resolution"] == PRESETS["accurate"]["taut_resolution"]
    refused = CliRunner().invoke(app, [*arguments[:-1], "best"], catch_exceptions=False)
    assert refused.exit_code == 2
    assert "'best' is not allowed" in refused.output

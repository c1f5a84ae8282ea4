"""The files of a run say what they are, and a series can be exported as one file."""

import numpy as np
import pytest
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

import vtkmuscle
from vtkmuscle.cli import app
from vtkmuscle.data.arrays import blocks_of, field_array, field_string, points_of
from vtkmuscle.filters import provenance_of
from vtkmuscle.io import read_series


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Run the tiny scene once, by the command line."""
    folder = tmp_path_factory.mktemp("formats")
    scene = write_tiny_scene(folder / "scene")
    call(["run", str(scene), "--out", str(folder / "out"), "-q", "--no-figures"])
    return folder / "out"


def call(arguments, status=0):
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == status, done.output
    return done.output


def test_files_say_what_they_are(results):
    for name in ("spindle", "spindle_fibres", "bones"):
        frame = read_series(results / f"{name}.pvd").frame(1)
        frame = blocks_of(frame)[1][1] if frame.IsA("vtkMultiBlockDataSet") else frame
        assert field_string(frame, "Units") == "mm"
        assert field_string(frame, "Scene") == "tiny"
        assert field_string(frame, "Version") == vtkmuscle.__version__
    muscle = read_series(results / "spindle.pvd").frame(1)
    steps = {step["filter"]: step["parameters"] for step in provenance_of(muscle)}
    assert {"FixedPointDetector", "BoneMotion", "SliceMorpher", "TautPaths", "PathDeformer"} <= set(steps)
    assert steps["PathDeformer"]["iterations"] == 3
    assert field_array(muscle, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("name", ["spindle", "spindle_fibres"])
def test_a_series_is_exported_as_one_file(results, tmp_path, name):
    call(["export", str(results / f"{name}.pvd"), str(tmp_path / "one.vtkhdf")])
    many, one = read_series(results / f"{name}.pvd"), read_series(tmp_path / "one.vtkhdf")
    assert one.times == many.times == (0.0, 5.0, 10.0, 15.0, 20.0)
    for i in range(5):
        assert np.array_equal(points_of(one.frame(i)), points_of(many.frame(i)))


def test_exported_bones_are_one_mesh_that_says_which_is_which(results, tmp_path):
    call(["export", str(results / "bones.pvd"), str(tmp_path / "bones.vtkhdf")])
    bones = read_series(tmp_path / "bones.vtkhdf").frame(4)
    parts = [points_of(block) for _, block in blocks_of(read_series(results / "bones.pvd").frame(4))]
    assert np.array_equal(points_of(bones), np.vstack(parts))
    assert field_string(bones, "BoneNames") == "upper, lower"
    assert field_string(bones, "Scene") == "tiny"


def test_what_cannot_be_exported_is_said(results, tmp_path):
    assert "there is no such file" in call(["export", "no.pvd", str(tmp_path / "a.vtkhdf")], 2)
    said = call(["export", str(results), str(tmp_path / "page.gltf")], 2)
    assert "no format of an export; end its name in .osim" in said

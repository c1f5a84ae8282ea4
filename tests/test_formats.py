"""The files of a run say what they are."""

import pytest
from faults import files_in
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner

import vtkmuscle
from vtkmuscle.cli import app
from vtkmuscle.data.arrays import field_array, field_string
from vtkmuscle.filters import provenance_of
from vtkmuscle.io import read_polydata


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
        frame = read_polydata(files_in(results / f"{name}.pvd")[-1])
        assert field_string(frame, "Units") == "mm"
        assert field_string(frame, "Scene") == "tiny"
        assert field_string(frame, "Version") == vtkmuscle.__version__
    muscle = read_polydata(files_in(results / "spindle.pvd")[1])
    steps = {step["filter"]: step["parameters"] for step in provenance_of(muscle)}
    assert {"FixedPointDetector", "BoneMotion", "SliceMorpher", "TautPaths", "PathDeformer"} <= set(steps)
    assert steps["PathDeformer"]["iterations"] == 3
    assert field_array(muscle, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-9)


def test_what_cannot_be_exported_is_said(results, tmp_path):
    said = call(["export", str(results), str(tmp_path / "page.gltf")], 2)
    assert "unknown format of an export; end its name in .osim" in said

"""What a run writes in each format is the same, says what it is, and can be exported."""

import json

import numpy as np
import pytest
from tiny_scene import write_tiny_scene
from typer.testing import CliRunner
from vtkmodules.vtkIOGeometry import vtkGLTFReader

import vtkmuscle
from vtkmuscle.cli import app
from vtkmuscle.core.errors import InputError
from vtkmuscle.data.arrays import blocks_of, field_array, field_string, points_of
from vtkmuscle.filters import provenance_of
from vtkmuscle.io import read_series
from vtkmuscle.plotting import can_render, export_scene
from vtkmuscle.run import RunOptions
from vtkmuscle.run.store import ResultFolder


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Run the tiny scene once per format, by the command line."""
    folder = tmp_path_factory.mktemp("formats")
    scene = write_tiny_scene(folder / "scene")
    for series in ("pvd", "vtkhdf"):
        call(["run", str(scene), "--out", str(folder / series), "--format", series, "-q", "--no-figures"])
    return folder


def call(arguments, status=0):
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == status, done.output
    return done.output


def test_both_formats_hold_the_same(runs):
    assert not [path for path in (runs / "vtkhdf").rglob("*.vtp") if "finished" not in path.parts]
    assert sorted(path.name for path in (runs / "vtkhdf").iterdir()) == [
        "architecture.csv",
        "bones.vtkhdf",
        "fibre_lengths.csv",
        "finished",
        "lengths.csv",
        "report.html",
        "report.json",
        "spindle.vtkhdf",
        "spindle_fibres.csv",
        "spindle_fibres.vtkhdf",
    ]
    for name in ("spindle", "spindle_fibres"):
        many, one = read_series(runs / f"pvd/{name}.pvd"), read_series(runs / f"vtkhdf/{name}.vtkhdf")
        assert one.times == many.times == (0.0, 5.0, 10.0, 15.0, 20.0)
        for i in range(5):
            assert np.array_equal(points_of(one.frame(i)), points_of(many.frame(i)))
    bones = read_series(runs / "vtkhdf/bones.vtkhdf").frame(4)
    parts = [points_of(block) for _, block in blocks_of(read_series(runs / "pvd/bones.pvd").frame(4))]
    assert np.array_equal(points_of(bones), np.vstack(parts))
    assert field_string(bones, "BoneNames") == "upper, lower"


@pytest.mark.parametrize("series", ["pvd", "vtkhdf"])
def test_files_say_what_they_are(runs, series):
    for name in ("spindle", "spindle_fibres", "bones"):
        frame = read_series(runs / series / f"{name}.{series}").frame(1)
        frame = blocks_of(frame)[1][1] if frame.IsA("vtkMultiBlockDataSet") else frame
        assert field_string(frame, "Units") == "mm"
        assert field_string(frame, "Scene") == "tiny"
        assert field_string(frame, "Version") == vtkmuscle.__version__
    muscle = read_series(runs / series / f"spindle.{series}").frame(1)
    steps = {step["filter"]: step["parameters"] for step in provenance_of(muscle)}
    assert {"FixedPointDetector", "BoneMotion", "SliceMorpher", "PBDDeformer"} <= set(steps)
    assert steps["PBDDeformer"]["iterations"] == 3
    assert field_array(muscle, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-9)


def test_another_format_replaces_the_first(tmp_path):
    scene = write_tiny_scene(tmp_path / "scene")
    for series in ("vtkhdf", "pvd"):
        call(["run", str(scene), "-o", str(tmp_path / "out"), "--format", series, "-q", "--no-figures"])
    assert not list((tmp_path / "out").glob("*.vtkhdf"))
    assert read_series(tmp_path / "out/spindle.pvd").times[-1] == 20.0


def test_gathering_leaves_files_alone_that_are_not_of_the_series(tmp_path):
    scene = write_tiny_scene(tmp_path / "scene")
    mine = tmp_path / "out/spindle/notes.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    call(["run", str(scene), "-o", str(tmp_path / "out"), "--format", "vtkhdf", "-q", "--no-figures"])
    assert mine.read_text() == "mine"
    assert [path.name for path in mine.parent.iterdir()] == ["notes.txt"]


def test_an_unknown_format_is_refused():
    with pytest.raises(ValueError, match="series is 'vtu', but must be one of 'pvd', 'vtkhdf'"):
        RunOptions(series="vtu")


# ---------------------------------------------------------------- export


@pytest.mark.parametrize("series", ["pvd", "vtkhdf"])
def test_a_pose_is_read_back(runs, series):
    pose = ResultFolder(runs / series).pose(11.0)
    assert pose.time == 10.0
    assert np.array_equal(
        points_of(pose.muscles[0]), points_of(read_series(runs / "pvd/spindle.pvd").frame(2))
    )
    assert [fibres.GetNumberOfLines() for fibres in pose.fibres] == [6]
    assert ResultFolder(runs / series).pose().time == 20.0
    with pytest.raises(InputError, match="no time 400; give one from 0 to 20"):
        ResultFolder(runs / series).pose(400.0)
    with pytest.raises(FileNotFoundError, match="give the folder of a run's results"):
        ResultFolder(runs).pose()


@pytest.mark.parametrize("series", ["pvd", "vtkhdf"])
def test_a_pose_is_exported_for_the_web(runs, tmp_path, series):
    reason = can_render()
    if reason is not None:
        pytest.skip(reason)
    out = tmp_path / "pose.gltf"
    call(["export", str(runs / series), str(out), "--time", "10"])
    described = json.loads(out.read_text())
    alphas = [material["pbrMetallicRoughness"]["baseColorFactor"][3] for material in described["materials"]]
    assert min(alphas) < 1.0 == max(alphas)
    reader = vtkGLTFReader()
    reader.SetFileName(str(out))
    reader.Update()
    pose = ResultFolder(runs / series).pose(10.0)
    box = np.zeros(6)
    reader.GetOutput().GetBounds(box)
    parts = [*(block for _, block in blocks_of(pose.bones)), *pose.muscles]
    points = np.vstack([points_of(part) for part in parts])
    assert np.allclose(box[0::2], points.min(axis=0), atol=1e-3)
    assert np.allclose(box[1::2], points.max(axis=0), atol=1e-3)
    assert [path.name for path in tmp_path.iterdir()] == [out.name]


def test_a_series_is_exported_as_one_file(runs, tmp_path):
    call(["export", str(runs / "pvd/bones.pvd"), str(tmp_path / "bones.vtkhdf")])
    found, known = read_series(tmp_path / "bones.vtkhdf"), read_series(runs / "vtkhdf/bones.vtkhdf")
    assert found.times == known.times
    assert np.array_equal(points_of(found.frame(3)), points_of(known.frame(3)))


def test_what_cannot_be_exported_is_said(runs, tmp_path):
    with pytest.raises(ValueError, match=r"to a \.gltf file"):
        export_scene(tmp_path / "a.html", ResultFolder(runs / "pvd").pose().bones, [])
    assert "there is no such file" in call(["export", str(tmp_path), str(tmp_path / "a.gltf")], 2)


def test_several_muscles_are_exported_together(runs, tmp_path):
    reason = can_render()
    if reason is not None:
        pytest.skip(reason)
    pose = ResultFolder(runs / "pvd").pose(0.0)
    export_scene(tmp_path / "one.gltf", pose.bones, pose.muscles)
    export_scene(tmp_path / "two.gltf", pose.bones, pose.muscles * 2, fibres=pose.fibres * 2)
    meshes = [len(json.loads((tmp_path / name).read_text())["meshes"]) for name in ("one.gltf", "two.gltf")]
    assert meshes[1] == meshes[0] + 2

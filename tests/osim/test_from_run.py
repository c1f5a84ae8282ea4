"""Muscles of a run in OpenSim: lengths of fibres, and what groups and paths cost."""

import importlib.util

import numpy as np
import pytest
from two_joint_scene import save_strap, scene_with
from typer.testing import CliRunner

from vtkmuscle import Scene, SceneError
from vtkmuscle.cli import app
from vtkmuscle.core.errors import InputError
from vtkmuscle.opensim import read_osim, write_mujoco, write_opensim
from vtkmuscle.opensim.muscle_paths import PointPath, moment_arm

GRID = {"grid": {"upper": [-10, 30, 10], "lower": [0, 40, 10]}}


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A scene of a strap over two joints, run by its paths: its file and the result."""
    folder = tmp_path_factory.mktemp("strap")
    save_strap(folder, n_fibres=10)
    path = scene_with(folder, tmp_path_factory.mktemp("joints"), motion=GRID, deformer="none")
    return path, Scene.load(path).run(figures=False)


def values_of(result):
    return {name: one.natural for name, one in result.motion.coordinates.items()}


def rms(off):
    return float(np.sqrt((off**2).mean()))


def test_functions_have_the_lengths_of_the_run(ran, tmp_path):
    path, result = ran
    (found,) = write_opensim(path, tmp_path / "strap.osim", result=result)
    model = read_osim(tmp_path / "strap.osim")
    lengths = 1000.0 * model.muscle("strap").path.lengths(model.tree, values_of(result))
    mean = result.lengths["strap"].mean(axis=1)
    np.testing.assert_allclose(found.length_errors, lengths - mean, atol=1e-6)
    assert rms(found.length_errors) < 0.4
    for name, off in found.arm_errors.items():
        arms = 1000.0 * moment_arm(found.out.path, model.tree, values_of(result), name)
        np.testing.assert_allclose(off, arms - result.moment_arms()["strap"][name].mean, atol=1e-3)
        assert rms(off) < 1.0
    rows = (tmp_path / "strap_errors.csv").read_text().splitlines()
    assert rows[0] == "muscle,of,rms_mm,largest_mm,mean_mm"
    assert [row.split(",")[:2] for row in rows[1:]] == [
        ["strap", "length"],
        ["strap", "upper"],
        ["strap", "lower"],
    ]
    assert set(found.out.path.names) == {"upper", "lower"}
    assert len(found.fibres) == 10


def test_more_groups_stand_for_the_fibres_better(ran, tmp_path):
    path, result = ran
    force = {"strap": {"max_isometric_force": 500.0}}
    one = write_opensim(path, tmp_path / "one.osim", result=result, parameters=force)
    four = write_opensim(path, tmp_path / "four.osim", result=result, groups=4, parameters=force)
    assert sorted(fibre for group in four for fibre in group.fibres) == list(range(10))
    assert max(group.group_error for group in four) < one[0].group_error
    assert sum(group.out.parameters["max_isometric_force"] for group in four) == pytest.approx(500.0)
    assert list(read_osim(tmp_path / "four.osim").muscles) == [f"strap_{i}" for i in range(1, len(four) + 1)]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"parameters": {"srap": {}}}, "no muscle 'srap'; its muscles are strap"),
        ({"replace": {"strap": "theirs"}}, "no model to replace muscles in"),
    ],
)
def test_what_would_change_nothing_in_a_model_is_refused(ran, tmp_path, given, words):
    path, result = ran
    with pytest.raises(InputError, match=words):
        write_opensim(path, tmp_path / "one.osim", result=result, **given)
    assert not (tmp_path / "one.osim").exists()


def test_points_and_cylinders_have_lengths_and_moment_arms(ran, tmp_path):
    path, result = ran
    (found,) = write_opensim(path, tmp_path / "points.osim", result=result, form="points")
    assert isinstance(found.out.path, PointPath)
    assert {point.body for point in found.out.path.points} == {"proximal", "middle", "distal"}
    assert rms(found.length_errors) < 0.7
    assert all(rms(off) < 2.0 for off in found.arm_errors.values())
    # No constant is left: the tendon's length is that of the path.
    assert abs(found.length_errors.mean()) < 0.3


@pytest.mark.skipif(importlib.util.find_spec("opensim") is None, reason="the extra opensim is not installed")
@pytest.mark.parametrize("form", ["functions", "points"])
def test_opensim_gives_what_vtkmuscle_gave(ran, tmp_path, form):
    import opensim

    opensim.Logger.setLevelString("error")
    path, result = ran
    (found,) = write_opensim(path, tmp_path / "strap.osim", result=result, form=form)
    ours = read_osim(tmp_path / "strap.osim")
    model = opensim.Model(str(tmp_path / "strap.osim"))
    state = model.initSystem()
    values = values_of(result)
    arms = result.moment_arms()["strap"]
    for i in range(0, len(result.frames), 4):
        for name, column in values.items():
            model.updCoordinateSet().get(name).setValue(state, float(column[i]))
        model.realizePosition(state)
        now = {name: column[i : i + 1] for name, column in values.items()}
        theirs = model.getMuscles().get("strap").getPath()
        assert theirs.getLength(state) == pytest.approx(found.out.path.lengths(ours.tree, now)[0], abs=1e-5)
        for name in values:
            arm = theirs.computeMomentArm(state, model.getCoordinateSet().get(name))
            assert arm == pytest.approx(moment_arm(found.out.path, ours.tree, now, name)[0], abs=1e-4)
            if form == "functions" and i in arms[name].frames:
                # Two ways to take slopes of the same lengths, a polynomial and local cubics.
                mean = arms[name].mean[list(arms[name].frames).index(i)]
                assert 1000.0 * arm == pytest.approx(mean, abs=4.0)


def test_mujoco_gives_the_length_of_the_path(ran, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    path, result = ran
    (found,) = write_mujoco(path, tmp_path / "strap.xml", result=result)
    assert not any(point.moves for point in found.out.path.points)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "strap.xml"))
    data = mujoco.MjData(model)
    write_opensim(path, tmp_path / "strap.osim", result=result)
    tree = read_osim(tmp_path / "strap.osim").tree
    values = values_of(result)
    lengths = found.out.path.lengths(tree, values)
    for i in range(0, len(lengths), 5):
        for name, column in values.items():
            data.qpos[model.joint(name).qposadr[0]] = column[i]
        mujoco.mj_forward(model, data)
        assert data.ten_length[0] == pytest.approx(lengths[i], abs=1e-9)


def test_a_scene_without_joints_is_not_exported(tmp_path):
    path = save_strap(tmp_path / "strap")
    with pytest.raises(SceneError, match="no joints"):
        write_opensim(path, tmp_path / "strap.osim")


def test_the_command_line_says_what_paths_cost(ran, tmp_path):
    path, _ = ran
    said = CliRunner().invoke(app, ["export", str(path), str(tmp_path / "strap.osim"), "--groups", "2"])
    assert said.exit_code == 0, said.output
    assert "strap_1: " in said.output
    assert "fibres as a polynomial of" in said.output
    assert "errors in mm: length" in said.output
    assert "tendon_slack_length" in said.output
    assert read_osim(tmp_path / "strap.osim").muscles

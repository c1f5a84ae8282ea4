"""Joints in a scene: pins, balls and custom ones, models of OpenSim, files, grids and mirrors."""

from dataclasses import replace

import numpy as np
import osim_texts as texts
import pytest
from phantoms import strap_over_two_joints
from phantoms.two_joint_strap import AXIS
from two_joint_scene import CENTRE, JOINTS, OPENSIM, save_strap, scene_with

from vtkmuscle import Scene, SceneError
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.run.result_data import time_label
from vtkmuscle.scene.reading import read_motion


@pytest.fixture(scope="module")
def strap_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("strap")
    save_strap(folder)
    return folder


def test_a_grid_of_two_pins_is_the_phantoms_motion(strap_folder, tmp_path):
    grid = {"upper": [0, 50, 10], "lower": [0, 60, 20]}
    motion = read_motion(scene_with(strap_folder, tmp_path, motion={"grid": grid}))
    upper, lower = (motion.coordinates[name].values for name in ("upper", "lower"))
    assert len(motion.times) == 24
    assert np.abs(np.diff(np.column_stack([upper / 10, lower / 20]), axis=0)).sum(
        axis=1
    ).max() == pytest.approx(1)
    phantom = strap_over_two_joints(coordinates=np.column_stack([upper, lower])).motion
    for bone in ("middle", "distal"):
        np.testing.assert_allclose(motion.transforms[bone], phantom.transforms[bone], atol=1e-9)
    assert set(motion.transforms) == {"middle", "distal"}
    assert motion.coordinates["upper"].positive == "flexion"
    assert motion.coordinates["lower"].unit == "deg"


def test_between_frames_the_joints_stay_together(strap_folder, tmp_path):
    motion = read_motion(scene_with(strap_folder, tmp_path, motion={"grid": {"lower": [0, 60, 20]}}))
    assert time_label(motion) == "lower [degrees]", "60 degrees are not 60 after radians"
    assert motion.times.tolist() == [0, 20, 40, 60]
    between = motion.at(30.0)["distal"]
    np.testing.assert_allclose(between, rotation_about(CENTRE, AXIS, -30.0), atol=1e-9)


def test_a_file_moves_the_joints(strap_folder, tmp_path):
    path = scene_with(
        strap_folder, tmp_path, motion={"file": "walk.mot", "every": 2, "coordinates": ["lower"]}
    )
    rows = "\n".join(f"{0.1 * i:.1f} {5 * i} {2 * i} 7" for i in range(5))
    (path.parent / "walk.mot").write_text(f"w\ninDegrees=yes\nendheader\ntime upper lower other\n{rows}\n")
    motion = read_motion(path)
    np.testing.assert_allclose(motion.times, [0.0, 0.2, 0.4])
    assert motion.coordinates["lower"].values.tolist() == pytest.approx([0, 4, 8])
    assert list(motion.coordinates) == ["lower"]
    np.testing.assert_allclose(
        motion.transforms["middle"][2], rotation_about((0, 0, 0), AXIS, 20.0), atol=1e-9
    )


def test_a_motion_beyond_a_range_is_warned_of(strap_folder, tmp_path):
    path = scene_with(strap_folder, tmp_path, motion={"grid": {"upper": [0, 70, 10]}})
    with pytest.warns(UserWarning, match="'upper' goes from 0 to 70, but its range is -40 to 60"):
        read_motion(path)


def test_a_custom_joint_slides_and_a_follower_follows(strap_folder, tmp_path):
    follower = {"parent": "middle", "child": "distal", "type": "custom", "centre": CENTRE}
    slide, turn = {"follows": "upper", "polynomial": [0.5, 1.0]}, {"x": [0, 10, 90], "y": [0, 10, 90]}
    follower["coordinates"] = {"slide": slide, "turn": {"rest": 10.0}}
    follower["rotations"] = [{"axis": [0, 0, 1], "coordinate": "turn", "spline": turn}]
    follower["translations"] = [{"axis": [0, 2, 0], "coordinate": "slide"}]
    motion = {"grid": {"upper": [0, 20, 20], "turn": [10, 30, 20]}}
    joints = {"hip": JOINTS["hip"], "knee": follower}
    motion = read_motion(scene_with(strap_folder, tmp_path, joints=joints, motion=motion))
    assert set(motion.coordinates) == {"upper", "turn"}
    middle, distal = motion.transforms["middle"], motion.transforms["distal"]
    for i, (upper, turn) in enumerate([(0, 10), (0, 30), (20, 30), (20, 10)]):
        # At rest the follower is at 1 mm, so the bone has gone on by half of upper.
        shift = np.eye(4)
        shift[1, 3] = 0.5 * upper
        expected = middle[i] @ shift @ rotation_about(CENTRE, (0, 0, 1), turn - 10.0)
        np.testing.assert_allclose(distal[i], expected, atol=1e-9)


def test_a_ball_turns_about_moved_axes(strap_folder, tmp_path):
    ball = {**JOINTS["hip"], "type": "ball", "coordinates": ["a", "b", "c"]}
    del ball["axis"]
    path = scene_with(
        strap_folder, tmp_path, joints={"hip": ball}, motion={"grid": {"a": [0, 30, 30], "c": [0, 40, 40]}}
    )
    motion = read_motion(path)
    expected = rotation_about((0, 0, 0), (1, 0, 0), 30) @ rotation_about((0, 0, 0), (0, 0, 1), 40)
    np.testing.assert_allclose(motion.transforms["middle"][2], expected, atol=1e-12)
    assert "distal" not in motion.transforms


def test_a_model_of_opensim_moves_the_bones(strap_folder, tmp_path):
    model = OPENSIM | {"model": "leg.osim", "rest": {"knee_angle": 10.0}}
    path = scene_with(
        strap_folder, tmp_path, joints=None, opensim=model, motion={"grid": {"knee_angle": [10, 40, 15]}}
    )
    (path.parent / "leg.osim").write_text(texts.model_4())
    motion = read_motion(path)
    np.testing.assert_allclose(motion.transforms["distal"][0], np.eye(4), atol=1e-9)
    assert "middle" not in motion.transforms
    from vtkmuscle.opensim import read_osim

    poses = read_osim(path.parent / "leg.osim").tree.poses({"knee_angle": np.radians([10.0, 40.0])})
    in_femur = np.linalg.inv(poses["femur"]) @ poses["tibia"]
    expected = in_femur[1] @ np.linalg.inv(in_femur[0])
    expected[:3, 3] *= 1000.0
    np.testing.assert_allclose(motion.transforms["distal"][2], expected, atol=1e-9)


@pytest.mark.filterwarnings("ignore:.*its range is -10 to 90")
def test_the_walk_of_the_real_hip_is_its_table(lhdl_hip, strap_folder, tmp_path):
    # hip_flexion_rest_0_90.csv was made by OpenSim from the same model and motion.
    rest = {"hip_flexion_r": 1.576011, "hip_adduction_r": -4.726925, "hip_rotation_r": -5.289883}
    bodies = {"proximal": "pelvis", "middle": "femur_r", "distal": "ground"}
    model = {"model": str(lhdl_hip / "reference" / "LHDL_hip_r.osim"), "bodies": bodies, "rest": rest}
    model |= {"frame": "pelvis", "fixed": "pelvis"}
    file = str(lhdl_hip / "motions" / "hip_flexion_rest_0_90.mot")
    path = scene_with(strap_folder, tmp_path, joints=None, opensim=model, motion={"file": file})
    motion = read_motion(path)
    from vtkmuscle.io import read_motion_table

    table = read_motion_table(lhdl_hip / "motions" / "hip_flexion_rest_0_90.csv", "femur_r")
    np.testing.assert_allclose(motion.transforms["middle"], table.transforms["femur_r"], atol=2e-3)


def test_the_left_side_is_the_right_one_in_a_mirror(strap_folder, tmp_path):
    motion = {"grid": {"upper": [0, 20, 20], "lower": [0, 30, 30]}}
    right = Scene.load(scene_with(strap_folder, tmp_path / "right", motion=motion))
    left = Scene.load(scene_with(strap_folder, tmp_path / "left", motion=motion, mirror="y"))
    signs = np.array([1.0, -1.0, 1.0])
    for name, bone in right.bones.items():
        np.testing.assert_array_equal(points_of(left.bones[name]), points_of(bone) * signs)
    surfaces = [scene.muscles["strap"].surface for scene in (right, left)]
    right_volume, left_volume = (signed_volume(points_of(each), triangles_of(each, "")) for each in surfaces)
    assert left_volume == pytest.approx(right_volume)
    areas = (scene.muscles["strap"].attachments for scene in (right, left))
    for area, mirrored in zip(*areas, strict=True):
        assert (mirrored.role, mirrored.bone) == (area.role, area.bone)
        np.testing.assert_array_equal(mirrored.landmarks, area.landmarks * signs)
    points = points_of(right.bones["distal"])[:5]
    for time in np.arange(0.0, right.motion.times[-1], 0.5):
        moved = apply_transform(right.motion.at(time)["distal"], points)
        there = apply_transform(left.motion.at(time)["distal"], points * signs)
        np.testing.assert_allclose(there, moved * signs, atol=1e-9)
    arms = [replace(s, deformer="none").run(figures=False).moment_arms()["strap"] for s in (right, left)]
    for name in ("upper", "lower"):  # the template is not mirrored: other fibres
        np.testing.assert_allclose(arms[1][name].mean, arms[0][name].mean, rtol=0.1)


@pytest.mark.parametrize("coordinates", [["upper", "lower"], ["lower"]])
def test_a_saved_scene_moves_alike_and_has_joints_that_tell_its_motion(coordinates, strap_folder, tmp_path):
    motion = {"grid": {"upper": [0, 20, 10], "lower": [0, 30, 15]}, "coordinates": coordinates}
    scene = Scene.load(scene_with(strap_folder, tmp_path, motion=motion))
    again = Scene.load(scene.save(tmp_path / "again"))
    for time in (0.0, 2.5, 7.3):
        for bone, there in scene.motion.at(time).items():
            np.testing.assert_allclose(again.motion.at(time)[bone], there, atol=1e-12)
    assert again.joints == (scene.joints if len(coordinates) == 2 else {})
    assert (again.motion.coordinates["lower"].twists is not None) == bool(again.joints)
    scene.files[""].unlink()
    assert Scene.load(scene.save(tmp_path / "alone")).joints == {}


def _with(joint, **changes):
    made = JOINTS[joint] | changes
    return JOINTS | {joint: {key: value for key, value in made.items() if value is not None}}


GRID = {"motion": {"grid": {"upper": [0, 20, 10]}}}
FOLLOWER = {"lower": {"follows": "uper", "polynomial": [1, 0]}}


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"joints": _with("knee", parent="midle"), **GRID}, "joints.knee.parent", "there is no bone"),
        ({"joints": _with("knee", child="middle"), **GRID}, "joints", "is the child of 'hip', too"),
        ({"joints": _with("knee", type="hinge"), **GRID}, "joints.knee.type", "not 'hinge'"),
        ({"joints": _with("knee", centre=None), **GRID}, "joints.knee.centre", "missing"),
        ({"joints": _with("knee", axis=None), **GRID}, "joints.knee.axis", "missing"),
        ({"joints": _with("knee", axis=[0, 0, 0]), **GRID}, "joints.knee.axis", "no length"),
        ({"joints": _with("knee", type="weld", axis=None), **GRID}, "joints.knee.coordinates", "not a key"),
        ({"joints": _with("knee", coordinates=["a", "b"]), **GRID}, "joints.knee.coordinates", "a pin has 1"),
        ({"joints": _with("knee", coordinates=["upper"]), **GRID}, "joints", "two coordinates 'upper'"),
        ({"joints": _with("knee", rotations=[]), **GRID}, "joints.knee.rotations", "not a key"),
        (
            {"joints": _with("knee", coordinates=FOLLOWER), **GRID},
            "joints.knee.coordinates.lower.follows",
            "there is no other coordinate",
        ),
        (
            {"joints": _with("knee", coordinates={"lower": {"polynomial": [1, 0]}}), **GRID},
            "joints.knee.coordinates.lower",
            "follows no other",
        ),
        ({"motion": {"grid": {"uper": [0, 20, 10]}}}, "motion.grid.uper", "did you mean 'upper'"),
        ({"motion": {"grid": {"upper": [0, 20, -1]}}}, "motion.grid.upper", "does not ascend"),
        ({"motion": {"grid": {"upper": [0, 10, 20]}}}, "motion.grid.upper", "does not ascend by steps"),
        ({"motion": {"grid": {"upper": [0, 60, 0.1], "lower": [0, 60, 0.1]}}}, "motion.grid", "361201 poses"),
        ({"motion": {**GRID["motion"], "file": "walk.mot"}}, "motion.grid", "cannot be combined with"),
        ({"motion": {**GRID["motion"], "bone": "middle"}}, "motion.bone", "cannot be combined with"),
        ({"motion": {"file": "walk.mot"}}, "motion.file", "no such file"),
        ({**GRID, "joints": None}, "motion.grid", "the scene has no joints"),
        ({"motion": {"hinge": {}}}, "motion.hinge.bone", "missing"),
        ({"motion": {**GRID["motion"], "coordinates": ["elbow"]}}, "motion", "no coordinate 'elbow'"),
        ({**GRID, "opensim": {"model": "leg.osim"}}, "opensim", "cannot be combined with"),
        ({**GRID, "joints": None, "opensim": {"model": "leg.osim"}}, "opensim.model", "no such file"),
        ({**GRID, "mirror": "w"}, "mirror", "not 'w'"),
    ],
)  # fmt: skip
def test_what_cannot_be_of_joints_is_named_by_its_key(strap_folder, tmp_path, changes, key, words):
    path = scene_with(strap_folder, tmp_path, **changes)
    with pytest.raises(SceneError, match=words) as caught:
        read_motion(path)
    assert key in [fault.key for fault in caught.value.faults]

"""Muscles of a run in OpenSim and MuJoCo: lengths, moment arms, groups, properties, meshes, masses."""

import re
from dataclasses import replace
from itertools import count

import numpy as np
import osim_texts as texts
import pytest
from commands import refused, vtkmuscle_
from shapes import ball
from tiny_scene import HINGE, write_tiny_scene
from two_joint_scene import save_strap, scene_with

from vtkmuscle import InputError, Result, Scene, SceneError, hinge
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.core.paths.poses import KeptPoses
from vtkmuscle.data import arrays
from vtkmuscle.io import read_surface
from vtkmuscle.opensim import export, from_run, read_osim
from vtkmuscle.opensim.export_parts import SPECIFIC_TENSION, completed_properties
from vtkmuscle.opensim.from_run import GEOMETRY_ONLY
from vtkmuscle.opensim.muscle_paths import PointPath, moment_arm
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.joints import pin_joint_of

GRID = {"upper": [-10, 30, 10], "lower": [0, 30, 30]}
ARCHITECTURE = {
    "fascicle_length_mm": {"mean": 80.0},
    "fascicle_pennation_origin_deg": {"mean": 10.0},
    "fascicle_pennation_insertion_deg": {"mean": 20.0},
    "pcsa_without_tendon_mm2": 1500.0,
}


@pytest.fixture
def results(ran, monkeypatch):
    """The folder of the results; no scene is run again."""
    run = "vtkmuscle.opensim.from_run.run_scene"
    monkeypatch.setattr(run, lambda *_args, **_options: pytest.fail("it was run"))
    return ran[0].parent / "results"


def values_of(result):
    return {name: column.natural for name, column in result.motion.coordinates.items()}


def rms(off):
    return float(np.sqrt((off**2).mean()))


def test_a_path_that_is_far_from_the_run_is_a_warning(tmp_path):
    """An error of 15 % of the moment arms, of a grid of eight poses, was a number among others."""
    save_strap(tmp_path / "strap", n_fibres=10)
    grid = {"grid": {"upper": [-30, 60, 90], "lower": [-60, 90, 50]}}
    result = Scene.load(scene_with(tmp_path / "strap", tmp_path, motion=grid, deformer="none")).run()
    with pytest.warns(UserWarning, match="moment arms of 'strap' as written are wrong by .* more poses"):
        (muscle,) = export(result, tmp_path / "strap.xml", kind=GEOMETRY_ONLY)
    arms = result.moment_arms()["strap"]
    assert max(rms(muscle.errors[name]) for name in arms) > 0.1 * max(rms(arms[name].mean) for name in arms)


def test_functions_have_the_lengths_of_the_run(ran, tmp_path):
    result = ran[1]
    (muscle,) = export(result, tmp_path / "strap.osim")
    model = read_osim(tmp_path / "strap.osim")
    lengths = 1000.0 * model.muscle("strap").path.lengths(model.tree, values_of(result))
    mean = result.lengths["strap"].mean(axis=1)
    np.testing.assert_allclose(muscle.errors["length"], lengths - mean, atol=1e-6)
    assert rms(muscle.errors["length"]) < 0.4
    for name, off in list(muscle.errors.items())[1:]:
        arms = 1000.0 * moment_arm(muscle.out.path, model.tree, values_of(result), name)
        np.testing.assert_allclose(off, arms - result.moment_arms()["strap"][name].mean, atol=1e-3)
        assert rms(off) < 1.0
    head, *rows = (tmp_path / "strap_errors.csv").read_text().splitlines()
    assert head == "muscle,of,rms_mm,largest_mm,mean_mm"
    assert [row.split(",")[1] for row in rows] == ["length", "upper", "lower"]
    assert set(muscle.out.path.names) == {"upper", "lower"}


def test_more_groups_stand_for_the_fibres_better(ran, tmp_path):
    result = ran[1]
    force = {"strap": {"max_isometric_force": 500.0}}
    (whole,) = export(result, tmp_path / "whole.osim", parameters=force)
    groups = export(result, tmp_path / "groups.osim", groups=4, parameters=force)
    assert sorted(fibre for group in groups for fibre in group.fibres) == list(range(10))
    assert max(group.group_error for group in groups) < whole.group_error
    assert sum(group.out.parameters["max_isometric_force"] for group in groups) == pytest.approx(500.0)
    assert [*read_osim(tmp_path / "groups.osim").muscles] == [f"strap_{i + 1}" for i in range(len(groups))]


def test_points_and_cylinders_have_lengths_and_moment_arms(ran, tmp_path):
    (muscle,) = export(ran[1], tmp_path / "points.osim", form="points")
    assert isinstance(muscle.out.path, PointPath)
    assert {point.body for point in muscle.out.path.points} == {"proximal", "middle", "distal"}
    assert rms(muscle.errors["length"]) < 0.7
    assert all(rms(off) < 2.0 for off in muscle.errors.values())
    assert abs(muscle.errors["length"].mean()) < 0.3  # the tendon's length is that of the path


def test_mujoco_has_the_path_and_the_properties(ran, results, tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    (muscle,) = export(results, tmp_path / "strap.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "strap.xml"))
    data = mujoco.MjData(model)
    export(results, tmp_path / "strap.osim")
    values = values_of(ran[1])
    lengths = muscle.out.path.lengths(read_osim(tmp_path / "strap.osim").tree, values)
    for i in range(0, len(lengths), 5):
        for name, column in values.items():
            data.qpos[model.joint(name).qposadr[0]] = column[i]
        mujoco.mj_forward(model, data)
        assert data.ten_length[0] == pytest.approx(lengths[i], abs=1e-9)
    assert (model.nu, model.nmesh) == (1, 4)
    low, high = model.actuator_lengthrange[0]
    first, last, force = model.actuator_gainprm[0][:3]
    along = (high - low) / (last - first)  # as MuJoCo has it
    properties = muscle.out.parameters
    cosine = np.cos(properties["pennation_angle_at_optimal"])
    assert along == pytest.approx(properties["optimal_fiber_length"] * cosine)
    assert low - first * along == pytest.approx(properties["tendon_slack_length"])
    assert force == pytest.approx(properties["max_isometric_force"] * cosine)
    errors = {file.name for file in tmp_path.glob("*errors.csv")}  # each model has its own
    assert errors == {"strap_errors.csv", "strap_xml_errors.csv"}


def test_properties_are_those_of_the_architecture():
    plain = completed_properties({}, ARCHITECTURE, "m", length=0.3)
    assert plain == pytest.approx(
        {
            "max_isometric_force": SPECIFIC_TENSION * 15.0,
            "optimal_fiber_length": 0.08,
            "pennation_angle_at_optimal": np.radians(15.0),
            "tendon_slack_length": 0.3 - 0.08 * np.cos(np.radians(15.0)),
        }
    )
    # Sarcomeres make another length optimal; tendon and thickness stay.
    stretched = ARCHITECTURE | {"fascicle_length_normalised_mm": 60.0}
    normalised = completed_properties({}, stretched, "m", length=0.3)
    assert normalised["optimal_fiber_length"] == pytest.approx(0.06)
    assert normalised["tendon_slack_length"] == pytest.approx(plain["tendon_slack_length"])
    thickness = 0.08 * np.sin(np.radians(15.0))
    assert 0.06 * np.sin(normalised["pennation_angle_at_optimal"]) == pytest.approx(thickness)


def test_fixed_properties_stay_and_the_tendon_fits():
    fixed = {"optimal_fiber_length": 0.1, "max_isometric_force": 700.0, "pennation_angle_at_optimal": 0.0}
    properties = completed_properties(fixed, ARCHITECTURE, "m", length=0.3)
    assert properties == pytest.approx(fixed | {"tendon_slack_length": 0.2})
    with pytest.raises(ValueError, match=r"'m' has a path of 70 mm and fibres of 80 mm at rest.*geometry"):
        completed_properties({}, ARCHITECTURE, "m", length=0.07)
    for length in (0.9995, 1.0005):  # of a muscle without tendon
        bare = completed_properties(fixed, ARCHITECTURE, "m", length=0.1 * length)
        assert bare["tendon_slack_length"] == pytest.approx(0.001 * length)


def test_results_are_exported_without_another_run(ran, results, tmp_path):
    path, result = ran
    (muscle,) = export(results, tmp_path / "strap.osim")
    properties = read_osim(tmp_path / "strap.osim").muscle("strap").parameters
    architecture = result.report["muscles"]["strap"]["architecture"]
    fascicle = architecture["fascicle_length_mm"]["mean"] / 1000
    assert properties["optimal_fiber_length"] == pytest.approx(fascicle)
    force = SPECIFIC_TENSION * architecture["pcsa_without_tendon_mm2"] / 100.0
    assert properties["max_isometric_force"] == pytest.approx(force)
    (points,) = export(results, tmp_path / "points.osim", form="points")
    assert points.out.parameters == muscle.out.parameters
    rest = result.track("strap").rest_lengths.mean() / 1000.0
    assert properties["tendon_slack_length"] == pytest.approx(0.01 * rest)  # there is no tendon
    scene = path.read_text()
    path.write_text(scene + "\n# changed\n")
    with pytest.raises(ValueError, match="has changed"):
        export(results, tmp_path / "strap.osim")
    replace(Scene.load(path), files={}).run(tmp_path / "made", frames=0, figures=False, report=False)
    with pytest.raises(ValueError, match=r"^scene\.toml: .* has changed or is missing; export a scene"):
        export(tmp_path / "made", tmp_path / "b.osim")
    path.write_text(scene)


def test_meshes_lie_on_their_bodies(ran, results, tmp_path):
    export(results, tmp_path / "strap.osim", masses={"middle": 3.0})
    scene, model = Scene.load(ran[0]), read_osim(tmp_path / "strap.osim")
    bones = [(bone, f"strap_{bone}.stl") for bone in scene.bones]
    assert sorted(model.meshes) == sorted([*bones, ("proximal", "strap_strap_at_rest.stl")])
    for body, file in model.meshes:
        pose = model.tree.poses({})[body][0]
        surface = read_surface(tmp_path / "Geometry" / file)
        bounds = np.array(surface.GetBounds()).reshape(3, 2).T @ pose[:3, :3].T + pose[:3, 3]
        name = file.removeprefix("strap_").removesuffix(".stl").removesuffix("_at_rest")
        original = scene.bones[name] if name in scene.bones else scene.muscles[name].surface
        np.testing.assert_allclose(1000.0 * bounds, np.reshape(original.GetBounds(), (3, 2)).T, atol=1e-2)
    text = (tmp_path / "strap.osim").read_text()
    assert text.count("<mass>0.0</mass>") == len(model.tree.bodies) - 2
    assert text.count("<mass>3.0</mass>") == text.count('<Model name="left_strap">') == 1
    files = [tmp_path / f"st{sign}rap.osim" for sign in "-_"]
    assert not set.intersection(*({*read_osim(file).meshes} for file in files if export(results, file)))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"parameters": {"srap": {}}}, "no muscle 'srap'; its muscles are strap"),
        ({"replace": {"strap": "theirs"}}, "no model to replace muscles in"),
        ({"specific_tension": -5.0}, "specific_tension: -5 N/cm.2 is not a finite number > 0"),
        ({"into": "leg.osim"}, r"has no coordinate 'upper'; use the model's names .* hip_x, "),
    ],
)
def test_an_export_that_makes_no_sense_is_refused(results, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "leg.osim").write_text(texts.model_4(forces=texts.muscle("")))
    with pytest.raises(InputError, match=words):
        export(results, tmp_path / "out.osim", **options)
    assert not (tmp_path / "out.osim").exists()


def test_another_source_or_option_is_refused(ran, tmp_path):
    with pytest.raises(TypeError, match=r"takes a Result, its folder or a scene.toml, not .*Scene\("):
        export(Scene.load(ran[0]), tmp_path / "strap.osim")
    with pytest.raises(TypeError, match="there is no option 'group'; did you mean 'groups'"):
        export(ran[1], tmp_path / "strap.osim", group=2)
    turned = replace(Scene.load(ran[0]), motion=hinge("distal", (0, 0, 0), (1, 0, 0), [0, 5]))
    with pytest.raises(InputError, match="the motion is not that of the results"):
        export(replace(turned, deformer="none").run(frames="0:2"), tmp_path / "strap.osim")


def test_further_poses_have_the_settings_of_the_results(ran, tmp_path, monkeypatch):
    """The paths in further poses were of the scene's quality, not of the exported result's."""
    still = scene_with(ran[0].parent, tmp_path, motion={"grid": {"upper": [-10, 30, 10]}})
    result = Scene.load(still).run(deformer="none", quality="preview", n_paths=30)
    seen, run = [], from_run.run_scene
    monkeypatch.setattr(from_run, "run_scene", lambda scene, *rest: seen.append(scene) or run(scene, *rest))
    export(result, tmp_path / "still.osim", kind=GEOMETRY_ONLY)
    assert [(scene.quality, scene.paths) for scene in seen] == [("preview", {"n_paths": 30})]


def test_a_crossed_coordinate_that_stands_still_is_moved_by_the_export(ran, tmp_path):
    still = scene_with(ran[0].parent, tmp_path, motion={"grid": {"upper": [-10, 30, 10]}})
    assert Scene.load(Scene.load(still).save(tmp_path / "saved")).muscles["strap"].crosses == (
        "upper",
        "lower",
    )
    export(still, tmp_path / "still.osim", kind=GEOMETRY_ONLY)
    export(ran[1], tmp_path / "moved.osim", kind=GEOMETRY_ONLY)
    here, there = (read_osim(tmp_path / f"{name}.osim") for name in ("still", "moved"))
    assert here.tree.coordinate("lower").range == pytest.approx(np.radians([-20.0, 20.0]))
    poses = {"upper": np.radians([-5.0, 10.0, 25.0]), "lower": np.radians([8.0, -8.0, 15.0])}
    for name in poses:
        own, theirs = (moment_arm(m.muscle("strap").path, m.tree, poses, name) for m in (here, there))
        np.testing.assert_allclose(own, theirs, atol=2e-3)


def test_a_pose_in_which_paths_do_not_rest_is_left_out(ran, tmp_path, monkeypatch):
    at, calls = KeptPoses.at, count()

    def shaky(*given, **options):
        return replace(at(*given, **options), settled=next(calls) != 20)

    monkeypatch.setattr(KeptPoses, "at", shaky)
    grid = {"grid": {"upper": [-10, 30, 5], "lower": [0, 40, 10]}}
    result = Scene.load(scene_with(ran[0].parent, tmp_path, motion=grid, deformer="none")).run()
    assert np.isnan(result.lengths["strap"]).all(axis=1).sum() == 1
    (muscle,) = export(result, tmp_path / "strap.osim", kind=GEOMETRY_ONLY)
    assert all(len(off) == 44 and np.isfinite(off).all() for off in muscle.errors.values())
    assert rms(muscle.errors["length"]) < 0.4


def test_a_muscle_that_crosses_no_coordinate_is_not_exported(tmp_path):
    save_strap(tmp_path / "strap", n_fibres=4)
    grid = {"grid": {"upper": [-10, 10, 10], "lower": [-10, 10, 10]}}
    path = scene_with(tmp_path / "strap", tmp_path, motion=grid, deformer="none")
    path.write_text(path.read_text().replace("[muscles.strap]", "[muscles.strap]\ncrosses = []", 1))
    with pytest.raises(InputError, match=r"crosses a coordinate .*; a run has the reasons"):
        export(path, tmp_path / "strap.osim")


def test_a_muscle_that_failed_is_not_exported(ran, results, tmp_path):
    result = Result.load(results)
    result.report["muscles"]["strap"]["verdict"]["verdict"] = "failed"
    with pytest.raises(InputError, match="no muscle with paths crosses a coordinate and did not fail"):
        export(result, tmp_path / "strap.osim")
    assert not (tmp_path / "strap.osim").exists()


def test_a_scene_without_joints_is_not_exported(tmp_path):
    with pytest.raises(SceneError, match="no joints"):
        export(save_strap(tmp_path / "strap"), tmp_path / "strap.osim")


@pytest.mark.parametrize("centre", [(3.0, -2.0, 5.0), (0.0, 0.0, 7.0), (0.002, 0.0, 0.0)])
def test_a_turn_about_one_axis_is_exported_as_a_pin_joint(centre):
    """A table of transforms of six decimals, of which 15 degrees are the rest pose, and the equal hinge."""
    turned = [rotation_about(centre, (0, 0, 1), q).round(6) for q in (-15, 5, 25)]
    degrees = Coordinate(np.array([0.0, 20.0, 40.0]), "deg", "flexion")
    motion = RigidMotion(np.arange(3.0), {"distal": np.array(turned)}, None, {"bend": degrees})
    bones = {name: arrays.surface_from(*ball(radius=20.0)) for name in ("proximal", "distal")}
    joints, values = pin_joint_of(SceneData("turn", bones, {}, motion))
    assert joints.tree.coordinate("bend").rest == pytest.approx(np.radians(15))
    now = joints.tree.poses(values)
    np.testing.assert_allclose(np.linalg.inv(now["proximal"]) @ now["distal"], turned, atol=2e-6)
    steeper = replace(motion, coordinates={"bend": replace(degrees, values=1.01 * degrees.values)})
    assert pin_joint_of(SceneData("steeper", bones, {}, steeper)) is None
    turned[1][0, 3] += 0.1
    slid = replace(motion, transforms={"distal": np.array(turned)})
    assert pin_joint_of(SceneData("slid", bones, {}, slid)) is None


def test_a_hinge_is_exported_with_the_range_of_the_run(tmp_path):
    path = write_tiny_scene(tmp_path / "scene")
    head, rest = path.read_text().split("[motion]")
    path.write_text(head + HINGE + "\n[muscles" + rest.split("[muscles", 1)[1])
    result = Scene.load(path).run(tmp_path / "out", figures=False)
    (written,) = export(tmp_path / "out", tmp_path / "tiny.osim", kind="PathActuator")
    assert np.abs(written.errors["length"]).max() < 0.1
    (coordinate,) = read_osim(tmp_path / "tiny.osim").tree.coordinates
    values = result.motion.coordinates[coordinate.name].values
    assert coordinate.range == pytest.approx(tuple(np.radians([values.min(), values.max()])))
    assert "<clamped>true</clamped>" in (tmp_path / "tiny.osim").read_text()
    export(tmp_path / "out", tmp_path / "tiny.xml", kind="PathActuator")
    (joint,) = re.findall(r"<joint [^>]*>", (tmp_path / "tiny.xml").read_text())
    (limits,) = re.findall(r'range="([^"]*)"', joint)
    assert [float(limit) for limit in limits.split()] == pytest.approx(coordinate.range)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motion": {"grid": GRID}, "mirror": "x"}, "mirrored scenes are not exported"),
        ({"motion": {"grid": GRID, "coordinates": ["upper"]}}, "crosses 'lower', and has no moment arms"),
        ({"motion": {"file": "../strap_errors.csv"}}, "would replace an input"),
        ({"motion": {"grid": {"upper": [9, 9, 1]}}}, r"\(1 poses\) does not move 'lower', .* more poses"),
    ],
)
def test_a_scene_that_cannot_be_exported_says_why(ran, tmp_path, changes, words):
    file, poses = scene_with(ran[0].parent, tmp_path, **changes), "0,-10,0\n1,0,10\n2,9,20\n3,20,0\n4,30,30\n"
    (tmp_path / "strap_errors.csv").write_text(f"time,upper,lower\n{poses}")
    with pytest.raises(ValueError, match=words):
        export(file, tmp_path / "strap.osim", sense=False, overwrite=True)


def test_the_command_line_prints_errors_and_properties(results, tmp_path):
    words = vtkmuscle_("export", results, tmp_path / "strap.osim", "--groups", "2").output
    printed = "strap_1: ", "fibres as a polynomial of", "errors in mm: length", "tendon_slack_length"
    for part in (*printed, "2 of 2 muscles evaluated.", "No body of the model has a mass"):
        assert part in words
    vtkmuscle_("export", results, tmp_path / "a.osim", "--geometry-only")
    muscle = read_osim(tmp_path / "a.osim").muscle("strap")
    assert (muscle.kind, muscle.parameters) == ("PathActuator", {})


@pytest.mark.parametrize(
    ("mass", "words"), [("middle=-3", "no mass"), ("middle", "no pair"), ("nobody=3", "no body")]
)
def test_an_invalid_mass_is_refused(results, tmp_path, mass, words):
    assert words in refused("export", results, tmp_path / "a.osim", "--mass", mass)


def test_exports_and_checks_replace_their_own_files_only(ran, tmp_path):
    """A user's model, mesh or table stays, and a check does not replace its own model."""
    results, model = ran[0].parent / "results", tmp_path / "model.osim"
    for _ in range(2):
        vtkmuscle_("export", results, model)
    before = model.read_bytes()
    (tmp_path / "Geometry" / "model_middle.stl").write_text("mine")
    call = "export", results, model, "--groups", "2"
    assert "middle.stl: the file exists" in refused(*call)
    assert (model.read_bytes(), (tmp_path / "Geometry" / "model_middle.stl").read_text()) == (before, "mine")
    vtkmuscle_(*call, "--overwrite")
    assert model.read_bytes() != before
    before = model.read_bytes()
    for arguments in (("check", model, "--out", model), ("export", results, model, "--into", model)):
        assert "would replace an input" in refused(*arguments, "--overwrite")
        assert model.read_bytes() == before
    words = refused("check", model, "--out", tmp_path / "no.csv")
    assert "check is an HTML page; end the name in .html" in words
    (tmp_path / "hand.xml").write_text("<mujoco/>")
    into = "--into", tmp_path / "hand.xml"
    assert "'mujoco', not a model of OpenSim" in refused("export", results, tmp_path / "new.osim", *into)
    (tmp_path / "page.csv").write_text("mine")
    refused("check", model, "--out", tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()

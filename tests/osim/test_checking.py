"""Muscles of models that jump, and moment arms that change sign: known answers."""

import contextlib
import importlib.util
import json

import numpy as np
import pytest
from commands import refused, vtkmuscle_

from vtkmuscle.joints.functions import IDENTITY, PiecewiseLinear, Polynomial
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim import MuscleOut, check_model, export, osim_of, read_osim
from vtkmuscle.opensim.muscle_paths import Cylinder, FunctionPath, PathPoint, PointPath, moment_arm

TREE = KinematicTree(
    "thigh",
    [Joint("knee", "thigh", "shank", [JointAxis((0, 0, 1), IDENTITY, "flexion")])],
    [JointCoordinate("flexion", range=(-0.5, 1.5))],
)
START, END = PathPoint("thigh", (0.05, 0.3, 0.0)), PathPoint("shank", (0.05, -0.1, 0.0))


def checked(tmp_path, *points):
    path = PointPath([START, *points, END])
    (tmp_path / "leg.osim").write_text(osim_of(TREE, [MuscleOut("m", path)]))
    return path, {one.what: one for one in check_model(tmp_path / "leg.osim").findings}


def test_a_smooth_muscle_has_no_findings(tmp_path):
    assert checked(tmp_path, PathPoint("thigh", (0.05, 0.15, 0.0)))[1] == {}


def test_a_jump_is_found_where_a_point_comes(tmp_path):
    path, found = checked(tmp_path, PathPoint("thigh", (0.08, 0.1, 0.0), only_in=("flexion", 0.3, 2.0)))
    jump = found.pop("length jumps")
    assert np.radians(jump.pose["flexion"]) == pytest.approx(0.3, abs=1e-4)
    at = path.lengths(TREE, {"flexion": np.array([0.2999, 0.3001])})
    assert jump.size == pytest.approx(float(np.diff(at)[0]), abs=1e-4)
    assert jump.sweeps == 1.0


def test_a_moment_arm_jumps_where_a_point_begins_to_move(tmp_path):
    slides = PiecewiseLinear(np.array([-0.5, 0.3, 1.5]), np.array([0.06, 0.06, 0.2]))
    via = PathPoint("thigh", (0, 0, 0), (slides, Polynomial([0.05]), Polynomial([0.0])), ("flexion",) * 3)
    path, found = checked(tmp_path, via)
    assert "length jumps" not in found
    jump = found["moment arm jumps"]
    assert np.radians(jump.pose["flexion"]) == pytest.approx(0.3, abs=1e-3)
    arms = moment_arm(path, TREE, {"flexion": np.array([0.299, 0.301])}, "flexion")
    assert jump.size == pytest.approx(abs(float(np.diff(arms)[0])), rel=0.02)
    assert jump.size > 0.005


def test_a_moment_arm_that_changes_sign_is_found_there(tmp_path):
    through = PointPath([PathPoint("thigh", (0, 0.3, 0)), PathPoint("shank", (0, -0.1, 0))])
    (tmp_path / "leg.osim").write_text(osim_of(TREE, [MuscleOut("m", through)]))
    (one,) = check_model(tmp_path / "leg.osim").findings
    assert one.what == "moment arm changes sign"
    assert np.radians(one.pose["flexion"]) == pytest.approx(0.0, abs=0.05)  # the line goes through the axis
    assert one.arms[0] * one.arms[-1] < 0.0


def test_functions_of_followers_are_swept_by_their_leaders(tmp_path):
    """The check ended with a KeyError, or called a muscle evaluated that was not swept."""
    joint = Joint("knee", "thigh", "shank", [JointAxis((0, 0, 1), IDENTITY, q) for q in ("flexion", "beta")])
    own = [*TREE.coordinates, JointCoordinate("beta", range=(-0.5, 1.5))]
    tree = KinematicTree("thigh", [joint], own, [Coupling("beta", "flexion", Polynomial([0.5, 0.0]))])
    path = FunctionPath(("beta",), 2, np.array([0.3, 0.0, 0.05]))
    (tmp_path / "leg.osim").write_text(osim_of(tree, [MuscleOut("m", path)]))
    (one,) = check_model(tmp_path / "leg.osim").findings
    assert (one.coordinate, one.what) == ("flexion", "moment arm changes sign")


@pytest.mark.parametrize(("across", "kinds"), [(0.5, []), (0.1, ["moment arm changes sign"])])
def test_arms_by_a_slide_change_lengths_as_far_as_those_by_an_angle(tmp_path, across, kinds):
    """Arms of 0.04 and 0.2, which have no unit, had the limits of millimetres."""
    slide = Joint("slide", "thigh", "shank", [], [JointAxis((0, 1, 0), IDENTITY, "slide")])
    tree = KinematicTree("thigh", [slide], [JointCoordinate("slide", "m", range=(-0.02, 0.02))])
    path = PointPath([PathPoint("thigh", (across, 0, 0)), PathPoint("shank", (0, 0, 0))])
    (tmp_path / "leg.osim").write_text(osim_of(tree, [MuscleOut("m", path)]))
    assert [each.what for each in check_model(tmp_path / "leg.osim").findings] == kinds


@pytest.mark.parametrize("scale", [1.0, 0.05])  # a person, and a small animal
def test_the_sides_of_a_model_are_compared(tmp_path, scale):
    axis = (0, 0, 1)
    joints = [Joint(s, "hip", f"leg_{s}", [JointAxis(axis, IDENTITY, f"flexion_{s}")]) for s in "rl"]
    tree = KinematicTree("hip", joints, [JointCoordinate(f"flexion_{s}", range=(-0.5, 1.5)) for s in "rl"])

    def differences(ahead):
        ends = [PathPoint(f"leg_{s}", (scale * x, -0.1 * scale, 0)) for s, x in (("r", 0.05), ("l", ahead))]
        paths = [PointPath([PathPoint("hip", (0.05 * scale, 0.3 * scale, 0)), end]) for end in ends]
        muscles = [MuscleOut(f"m_{s}", path) for s, path in zip("rl", paths, strict=True)]
        (tmp_path / "legs.osim").write_text(osim_of(tree, muscles))
        at, sides = np.linspace(-0.49, 1.49, 90), zip("rl", paths, strict=True)
        right, left = (moment_arm(path, tree, {f"flexion_{s}": at}, f"flexion_{s}") for s, path in sides)
        findings = check_model(tmp_path / "legs.osim").findings
        return [one for one in findings if "sides" in one.what], np.abs(right - left).max()

    assert differences(0.05)[0] == []
    (one,), largest = differences(0.07)
    assert (one.muscle, one.coordinate) == ("m_r", "flexion_r")
    assert one.size == pytest.approx(largest, rel=0.01)


def test_a_model_is_repaired_with_the_paths_of_a_scene(ran, tmp_path):
    results = ran[0].parent / "results"
    export(results, tmp_path / "good.osim")
    tree = read_osim(tmp_path / "good.osim").tree
    via = PathPoint("middle", (0.05, -0.1, 0.05), only_in=("upper", 0.2, 2.0))
    path = PointPath([PathPoint("proximal", (0, 0.1, 0)), via, PathPoint("distal", (0, -0.1, 0))])
    properties = {"max_isometric_force": 700.0, "optimal_fiber_length": 0.07, "tendon_slack_length": 0.2}
    (tmp_path / "bad.osim").write_text(osim_of(tree, [MuscleOut("theirs", path, properties)]))
    said = vtkmuscle_("check", tmp_path / "bad.osim", "--out", tmp_path / "bad.html")
    assert "theirs: length jumps by" in said.output
    assert "theirs,upper,length jumps," in (tmp_path / "bad.csv").read_text()
    assert "<svg" in (tmp_path / "bad.html").read_text()
    repair = "--repair", tmp_path / "new.osim", "--scene", results
    call = "check", tmp_path / "bad.osim", "--out", tmp_path / "new.html", *repair
    said = vtkmuscle_(*call, "--replace", "strap=theirs")
    new = read_osim(tmp_path / "new.osim").muscle("theirs")
    assert {name: new.parameters[name] for name in properties} == pytest.approx(properties)
    assert not [one for one in check_model(tmp_path / "new.osim").findings if one.what == "length jumps"]
    refused(*call)  # replaces what?
    (tmp_path / "large.osim").write_text(osim_of(tree.scaled(1.1)))
    with pytest.raises(ValueError, match=r"'strap' has lengths up to .* mm off on these bodies"):
        export(results, tmp_path / "new.osim", into=tmp_path / "large.osim", form="points")


def test_a_stopped_check_keeps_the_coordinates_that_are_swept(tmp_path, monkeypatch):
    joints = [*TREE.joints, Joint("ankle", "shank", "foot", [JointAxis((0, 0, 1), IDENTITY, "plantar")])]
    tree = KinematicTree("thigh", joints, [*TREE.coordinates, JointCoordinate("plantar", range=(-0.5, 1.5))])
    bodies = [("thigh", 0.3), ("shank", -0.1)], [("shank", 0.3), ("foot", -0.1)]
    paths = [PointPath([PathPoint(body, (0, at, 0)) for body, at in ends]) for ends in bodies]
    model = tmp_path / "leg.osim"
    model.write_text(osim_of(tree, [MuscleOut(*each) for each in zip("ab", paths, strict=True)]))
    parts = []
    assert {each.coordinate for each in check_model(model, progress=parts.append).findings} == set(tree.free)
    assert parts[0] == 0.5
    assert parts[-1] == 1.0

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check_model(model, progress=stop)
    kept = check_model(model, progress=stop, partial=True)
    assert {each.coordinate for each in kept.findings} == {"flexion"}
    assert kept.evaluated == {"a"}
    assert "stopped, coordinates not swept: plantar" in repr(kept)
    monkeypatch.setattr("vtkmuscle.cli.running.progress_bars", lambda **_: contextlib.nullcontext(stop))
    vtkmuscle_("check", model, "--out", tmp_path / "leg.html", status=130)
    assert "a,flexion,moment arm changes sign" in (tmp_path / "leg.csv").read_text()


@pytest.mark.slow
def test_iliacus_and_psoas_of_gait2392_jump(opensim_data):
    found = check_model(opensim_data / "gait2392_thelen2003muscle.osim")
    assert not found.not_checked
    jumping = {(one.muscle, one.coordinate) for one in found.findings if one.what == "length jumps"}
    known = {f"{muscle}_{side}" for muscle in ("iliacus", "psoas") for side in "rl"}
    assert jumping == {(muscle, f"hip_flexion_{muscle[-1]}") for muscle in known}
    sizes = found.table().where(what="length jumps")["size_mm"]
    assert ((sizes > 15.0) & (sizes < 30.0)).all()


def test_muscles_that_wind_are_opensims_or_named(opensim_data):
    found = check_model(opensim_data / "arm26.osim")
    winding = {"TRIlong", "TRIlat", "TRImed", "BIClong", "BRA"}
    if importlib.util.find_spec("opensim") is None:
        assert set(found.not_checked) == winding
    else:
        assert set(found.by_opensim) == winding
        assert "TRIlong" in {one.muscle for one in found.findings if one.what == "length jumps"}


def test_what_is_not_evaluated_is_said(tmp_path):
    """A ligament counts apart, a plugin's force is left out; a locked coordinate or without a range stays."""
    more = [JointAxis(axis, IDENTITY, name) for axis, name in (((1, 0, 0), "adduction"), ((0, 1, 0), "turn"))]
    joint = Joint("knee", "thigh", "shank", [*TREE.joints[0].rotations, *more])
    more = [JointCoordinate("adduction"), JointCoordinate("turn", range=(-1.0, 1.0))]
    tree = KinematicTree("thigh", [joint], [*TREE.coordinates, *more])
    still = PointPath([START, PathPoint("thigh", (0, 0, 0))])
    text = osim_of(tree, [MuscleOut("m", PointPath([START, END])), MuscleOut("still", still)])
    passive = text[text.index("<Millard") : text.index("</Millard2012EquilibriumMuscle>")] + "</Ligament>"
    passive = passive.replace('Millard2012EquilibriumMuscle name="m"', 'Ligament name="l"')
    text = text.replace("<Millard", f'<MyPlugin name="p"/>{passive}<Millard', 1)
    named = '<Coordinate name="turn">'
    assert named in text
    (tmp_path / "leg.osim").write_text(text.replace(named, f"{named}<locked>true</locked>"))
    words = repr(check_model(tmp_path / "leg.osim"))
    assert words.startswith("1 of 2 muscles and 1 of 1 ligaments evaluated")
    alone = osim_of(tree, [MuscleOut("still", still)])  # and a ligament, which is evaluated
    (tmp_path / "no.osim").write_text(alone.replace("<Millard", f"{passive}<Millard", 1))
    call = "check", tmp_path / "no.osim", "--out", tmp_path / "no.html", "--fail-above", 5
    assert "no muscle of" in vtkmuscle_(*call, status=1).stderr
    assert "(no coordinate is swept): still; coordinates locked or without" in words
    assert "a range, not swept: adduction, turn" in words
    assert "left out: ForceSet: line" in words
    assert "MyPlugin 'p'" in words
    (tmp_path / "bones.osim").write_text(osim_of(tree, []))
    with pytest.raises(ValueError, match=r"bones\.osim: the model has no muscles or ligaments"):
        check_model(tmp_path / "bones.osim")


def test_a_wrapped_ligament_beside_a_plugins_force_is_opensims(tmp_path):
    pytest.importorskip("opensim")
    roll = Cylinder("thigh", np.zeros(3), np.array([0, 0, 1.0]), 0.03, 0)
    text = osim_of(TREE, [MuscleOut("m", PointPath([START, END], cylinders=[roll]))])
    text = text.replace("Millard2012EquilibriumMuscle", "Ligament")
    (tmp_path / "leg.osim").write_text(text.replace("<Ligament", "<MyPlugin/><Ligament", 1))
    found = check_model(tmp_path / "leg.osim")
    assert (found.by_opensim, found.not_checked) == (("m",), ())
    done = vtkmuscle_("check", tmp_path / "leg.osim", "--out", tmp_path / "page.html", "--json")
    assert json.loads(done.stdout)["by_opensim"] == ["m"]


def test_fibres_that_leave_their_range_are_found_where_they_are_longest(tmp_path):
    """A rigid tendon: the fibre's length is the path's without the tendon, by its pennation."""
    path, angles = PointPath([START, END]), np.linspace(-0.5, 1.5, 91)
    lengths = path.lengths(TREE, {"flexion": angles})
    slack = 0.9 * lengths.min()
    optimal = (lengths.max() - slack) / 1.7
    hill = {"max_isometric_force": 1.0, "optimal_fiber_length": optimal, "tendon_slack_length": slack}
    (tmp_path / "leg.osim").write_text(osim_of(TREE, [MuscleOut("m", path, hill)]))
    found = {each.what: each for each in check_model(tmp_path / "leg.osim").findings}
    above = found["fibre above 1.6 of optimal"]
    assert above.size == pytest.approx(0.1 * optimal)
    assert np.radians(above.pose["flexion"]) == pytest.approx(angles[lengths.argmax()])
    below = 0.5 * optimal - (lengths.min() - slack)
    assert found["fibre below 0.5 of optimal"].size == pytest.approx(below)


def test_a_check_is_read_by_programs(tmp_path):
    """JSON, and an exit code for jumps above a size."""
    checked(tmp_path, PathPoint("thigh", (0.08, 0.1, 0.0), only_in=("flexion", 0.3, 2.0)))
    call = "check", tmp_path / "leg.osim", "--out", tmp_path / "page.html", "--json", "--fail-above"
    found = json.loads(vtkmuscle_(*call, "1", status=1).stdout)
    assert (found["muscles"], found["findings"][0]["what"]) == (["m"], "length jumps")
    assert found["findings"][0]["pose"]["flexion"] == pytest.approx(np.degrees(0.3), abs=0.01)
    vtkmuscle_(*call, "500")

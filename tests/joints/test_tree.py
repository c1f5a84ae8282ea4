"""Kinematic trees: poses, couplings, and what is no tree."""

import numpy as np
import pytest

from vtkmuscle.core.motion.rigid import frame_at, rotation_about
from vtkmuscle.joints.functions import IDENTITY, Polynomial
from vtkmuscle.joints.tree import Coupling, Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath, moment_arm


def leg():
    turns = {name: JointAxis((0, 0, 1), IDENTITY, name) for name in ("flexion", "knee", "slide")}
    at_hip = {"parent_frame": frame_at((10.0, -20.0, 30.0)), "child_frame": frame_at((0.0, 5.0, 0.0))}
    at_knee = frame_at((0.0, -400.0, 0.0))
    adduction, ahead = JointAxis((1, 0, 0), IDENTITY, "adduction"), JointAxis((1, 0, 0), Polynomial([40.0]))
    hip = Joint("hip", "pelvis", "femur", [turns["flexion"], adduction], **at_hip)
    knee = Joint("knee", "femur", "tibia", [turns["knee"]], parent_frame=at_knee)
    patella = Joint("patella", "femur", "patella", [turns["slide"]], [ahead], parent_frame=at_knee)
    names = [JointCoordinate(name) for name in ("flexion", "adduction", "knee", "slide")]
    following = Coupling("slide", "knee", Polynomial([0.6, 0.1]))
    return KinematicTree("pelvis", [knee, patella, hip], names, [following])


def test_poses_are_products_of_turns_about_moved_axes():
    flexion, adduction = np.array([0.3, -0.8]), np.array([0.1, 0.4])
    poses = leg().poses({"flexion": flexion, "adduction": adduction})
    for i in range(2):
        first = rotation_about((0, 0, 0), (0, 0, 1), np.degrees(flexion[i]))
        second = rotation_about((0, 0, 0), (1, 0, 0), np.degrees(adduction[i]))
        expected = frame_at((10, -20, 30)) @ first @ second @ frame_at((0, -5, 0))
        np.testing.assert_allclose(poses["femur"][i], expected, atol=1e-12)


def test_a_coupled_coordinate_follows_whatever_it_is_given():
    full = leg().completed({"knee": [0.0, 1.0], "slide": [5.0, 5.0]})
    np.testing.assert_allclose(full["slide"], [0.1, 0.7])
    assert leg().free == ("flexion", "adduction", "knee")


def test_crossed_coordinates_are_those_between_bodies():
    tree = leg()
    assert tree.crossed(["pelvis", "tibia"]) == ("flexion", "adduction", "knee")
    assert tree.crossed(["femur", "tibia"]) == ("knee",)
    assert tree.crossed(["femur", "patella"]) == ("knee",)
    assert tree.crossed(["femur"]) == ()


def test_moment_arm_about_a_pin_is_the_distance_of_the_line():
    path = PointPath([PathPoint("femur", (30.0, -300.0, 0.0)), PathPoint("tibia", (30.0, -100.0, 0.0))])
    np.testing.assert_allclose(moment_arm(path, leg(), {"knee": [0.0]}, "knee"), [30.0], atol=1e-6)


def test_a_conditional_point_counts_in_its_range_alone():
    ends = [PathPoint("femur", (0.0, -300.0, 0.0)), PathPoint("tibia", (0.0, -100.0, 0.0))]
    via = PathPoint("femur", (-50.0, -400.0, 0.0), only_in=("knee", 0.5, 2.0))
    values = {"knee": [0.0, 1.0]}
    plain = PointPath(ends).lengths(leg(), values)
    led = PointPath([ends[0], via, ends[1]]).lengths(leg(), values)
    assert led[0] == plain[0]
    assert led[1] > plain[1] + 1.0
    # At the edge the arm is that of the points that count, not that of the jump.
    assert abs(moment_arm(PointPath([ends[0], via, ends[1]]), leg(), {"knee": [0.5]}, "knee")[0]) < 100.0


def test_a_path_that_winds_round_surfaces_has_no_length_here():
    path = PointPath([PathPoint("femur"), PathPoint("tibia")], wraps=["condyles"])
    with pytest.raises(ValueError, match="condyles"):
        path.lengths(leg(), {})


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ([("a", "g", "x"), ("b", "g", "x")], "is the child of 'a', too"),
        ([("a", "nobody", "x")], "there is no such body"),
        ([("a", "y", "x"), ("b", "x", "y")], "the joints form a loop"),
        ([("a", "x", "g")], "is the root"),
    ],
)
def test_what_is_no_tree_is_told(joints, words):
    with pytest.raises(ValueError, match=words):
        KinematicTree("g", [Joint(*names) for names in joints], [])


def test_couplings_in_a_ring_are_refused():
    ring = [Coupling("a", "b", IDENTITY), Coupling("b", "a", IDENTITY)]
    with pytest.raises(ValueError, match="ring"):
        KinematicTree("g", [], [JointCoordinate("a"), JointCoordinate("b")], ring)


def test_unknown_coordinates_and_values_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="did you mean 'knee'"):
        leg().completed({"kne": [0.0]})
    with pytest.raises(ValueError, match="not finite"):
        leg().completed({"knee": [np.nan]})
    with pytest.raises(ValueError, match="shapes"):
        leg().completed({"knee": [0.0, 1.0], "flexion": [0.0]})

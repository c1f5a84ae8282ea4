"""The frames of a sweep are told from those of the way to its start, and coordinates are checked."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vtkmuscle.core.moment_arms.levers import frames_of_sweep
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge


def motion_of(angles, values=None):
    """Return a motion by flexion, adduction and rotation (n, 3) [degrees], whose coordinate is flexion."""
    angles = np.asarray(angles, dtype=float)
    tables = np.tile(np.eye(4), (len(angles), 1, 1))
    tables[:, :3, :3] = Rotation.from_euler("ZXY", angles, degrees=True).as_matrix()
    coordinate = Coordinate(angles[:, 0] if values is None else values)
    return RigidMotion(np.arange(float(len(angles))), {"femur": tables}, None, {"flexion": coordinate})


LEAD_IN = np.linspace(1.0, 0.0, 6)[:-1, None] * [1.6, -4.7, -5.3]
DOWN_AND_UP = np.array([[a, 0.0, 0.0] for a in [*np.arange(0.0, -10.0, -2.0), *np.arange(-10.0, 91.0, 2.0)]])


def test_the_way_from_rest_to_the_start_of_a_sweep_is_left_out():
    kept = frames_of_sweep(motion_of(np.vstack([LEAD_IN, DOWN_AND_UP])), "flexion")
    assert kept[len(LEAD_IN) :].all()
    assert not kept[: len(LEAD_IN) - 1].any()  # the last one is nearly there


def test_a_way_on_which_the_coordinate_stands_still_is_left_out():
    lead = np.array([[0.0, 10.0, 0.0], [0.0, 5.0, 0.0]])
    kept = frames_of_sweep(motion_of(np.vstack([lead, DOWN_AND_UP])), "flexion")
    assert kept.tolist() == [False] * 2 + [True] * len(DOWN_AND_UP)


def test_of_two_frames_between_which_the_coordinate_stands_still_one_is_left_out():
    assert frames_of_sweep(motion_of([[90.0, 0.0, 0.0], [90.0, 8.0, 0.0]]), "flexion").sum() == 1


@pytest.mark.parametrize("up", [np.arange(0.0, 91.0, 10.0), np.array([0.0, 1.0, 30.0, 33.0, 90.0])])
def test_up_and_down_on_one_way_is_one_sweep(up):
    angles = np.concatenate([up, up[-2::-1] + 0.3])
    assert frames_of_sweep(motion_of(angles[:, None] * [1.0, 0.2, -0.1]), "flexion").all()


def test_a_hinge_has_its_angle_as_coordinate():
    motion = hinge("tibia", (1, 2, 3), (0, 0, 2), [0, 10, 20])
    (name,) = motion.coordinates
    assert (name, motion.coordinates[name].unit) == ("tibia_angle", "deg")
    assert motion.coordinates[name].positive == "right-handed about (0, 0, 2)"
    assert motion.coordinates[name].values.tolist() == [0, 10, 20]
    assert list(hinge("tibia", (0, 0, 0), (0, 0, 1), [0, 10], coordinate="knee").coordinates) == ["knee"]


def test_a_part_of_a_motion_has_that_part_of_its_coordinates():
    part = hinge("tibia", (1, 2, 3), (0, 0, 2), [0, 10, 20, 30], coordinate="knee").part([0, 3])
    assert part.times.tolist() == [0, 30]
    assert part.coordinates["knee"].values.tolist() == [0, 30]
    np.testing.assert_array_equal(part.centre, [1, 2, 3])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0, np.nan],), "non-empty list of finite numbers"),
        (([],), "non-empty list of finite numbers"),
        (([0.0], "degrees"), "the unit of a coordinate is 'degrees', but must be one of 'deg', 'rad', 'mm'"),
    ],
)
def test_coordinates_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Coordinate(*arguments)


def test_a_coordinate_has_a_value_for_each_time():
    with pytest.raises(ValueError, match="coordinate 'flexion': 2 values, but there are 3 times"):
        motion_of(np.zeros((3, 3)), [1.0, 2.0])


def test_translations_are_in_millimetres_and_angles_in_radians():
    np.testing.assert_allclose(Coordinate([0.0, 2.0], "cm").natural, [0.0, 20.0])
    np.testing.assert_allclose(Coordinate([0.0, 180.0]).natural, [0.0, np.pi])
    assert not Coordinate([3.0, 3.0 + 1e-12]).changes

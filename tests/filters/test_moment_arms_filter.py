"""MomentArms: lengths over time become moment arms, measured once, and only where they are determined."""

import numpy as np
import pytest
from filter_case import Timed
from shapes import lines_of

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, hinge, rotation_about
from vtkmuscle.data.arrays import add_arrays, cell_array, field_array, field_string, points_of, polylines_of
from vtkmuscle.filters import MomentArms

#: Two points that turn about the x axis with the bone, and where their fibres begin [mm].
STARTS = np.array([[0.0, -80.0, 30.0], [5.0, -80.0, 40.0]])
ENDS = np.array([[0.0, 40.0, 20.0], [5.0, 50.0, 10.0]])


def ends_at(angle):
    return apply_transform(rotation_about((0, 0, 0), (1, 0, 0), angle), ENDS)


def lines_at(angle):
    return lines_of(np.stack([STARTS, ends_at(angle)], axis=1))


def known_arms(angle):
    """Return the lever of each straight fibre's pull about the x axis, positive right-handed."""
    ends = ends_at(angle)
    pull = STARTS - ends
    pull /= np.linalg.norm(pull, axis=1)[:, None]
    return np.cross(ends, pull)[:, 0]


ANGLES = np.arange(0.0, 91.0, 5.0)
KNEE = hinge("b", (0, 0, 0), (1, 0, 0), ANGLES, coordinate="knee")


def arms_of(source, **parameters):
    return MomentArms(fibres=source, **parameters)


@pytest.mark.gap(
    "error of moment arms by differences over 5 degrees, at the ends of a sweep", "0.17 mm", "0.1 mm"
)
@pytest.mark.parametrize(("step", "bound"), [(2.5, 0.1), (5.0, 0.2)])
def test_moment_arms_are_the_levers_of_the_pull_at_every_angle(step, bound):
    """Virtual work: -dl/dq is the lever of a straight fibre about the axis, sign and all.

    By differences over steps h the error is h^2 / 6 of the third derivative, twice that at the ends.
    """
    found = arms_of(Timed(lines_at, np.arange(0.0, 91.0, step)))
    for angle in (0.0, 20.0, 56.5, 90.0):
        result = found.update(time=angle).output
        np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(angle), atol=bound)
        assert field_string(result, "Coordinate") == "time"
        assert field_array(result, "CoordinateValue")[0] == angle


def test_a_motion_says_what_the_coordinate_is():
    motion = RigidMotion(
        np.arange(len(ANGLES)),
        {},
        None,
        {"knee": Coordinate(-ANGLES, "deg"), "still": Coordinate(0 * ANGLES)},
    )
    result = arms_of(Timed(lambda t: lines_at(5.0 * t), range(len(ANGLES))), motion=motion).update(time=4.0)
    np.testing.assert_allclose(cell_array(result.output, "MomentArm", ""), -known_arms(20.0), atol=0.1)
    assert field_string(result.output, "Coordinate") == "knee"
    assert field_array(result.output, "CoordinateValue")[0] == pytest.approx(-20.0)
    radians = arms_of(Timed(lambda t: lines_at(np.degrees(t)), np.radians(ANGLES)), unit="rad")
    result = radians.update(time=np.radians(20.0)).output
    np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(20.0), atol=0.1)


def test_of_two_coordinates_each_has_its_arrays_where_it_is_determined():
    """One after the other: first the angle, then a length."""
    angles = np.concatenate([np.arange(0.0, 41.0, 4.0), np.full(10, 40.0)])
    shifts = np.concatenate([np.zeros(11), np.arange(1.0, 11.0)])
    motion = RigidMotion(
        np.arange(21.0), {}, None, {"turn": Coordinate(angles), "slide": Coordinate(shifts, "mm")}
    )

    def lines(time):
        points = np.array(lines_at(np.interp(time, motion.times, angles)).GetPoints().GetData())
        points[::2, 1] -= np.interp(time, motion.times, shifts)
        return lines_of(points.reshape(2, 2, 3))

    found = arms_of(Timed(lines, motion.times), motion=motion)
    early = found.update(time=3.0).output.GetCellData()
    assert early.HasArray("MomentArm_turn")
    assert not early.HasArray("MomentArm_slide")
    late = found.update(time=19.0).output
    assert not late.GetCellData().HasArray("MomentArm_turn")
    arms = cell_array(late, "MomentArm_slide", "")
    assert ((arms < -0.8) & (arms > -1.0)).all()  # it lengthens by nearly as much as it is drawn out
    alone = arms_of(Timed(lines, motion.times), motion=motion, coordinate="slide").update(time=19.0).output
    np.testing.assert_array_equal(cell_array(alone, "MomentArm", ""), arms)


@pytest.mark.parametrize(
    ("parameters", "times", "message"),
    [
        ({}, [1.0], "MomentArms: no coordinate of the motion changes .'time'."),
        ({"motion": KNEE, "coordinate": "hip"}, ANGLES, "no coordinate 'hip'"),
        ({"coordinate": "knee"}, ANGLES, "no coordinate 'knee'; it has: 'time'"),
        ({"motion": RigidMotion(ANGLES, {})}, ANGLES, "no coordinate of the motion changes .none"),
    ],
)
def test_what_cannot_be_is_refused_in_words(parameters, times, message):
    with pytest.raises(ValueError, match=message):
        arms_of(Timed(lines_at, times), **parameters).update()


def test_fibres_must_be_the_same_and_have_a_time():
    one = lines_of([[[0.0, 0, 0], [1, 0, 0]]])
    with pytest.raises(ValueError, match="at time 10 there are 1, at first 2"):
        arms_of(Timed(lambda time: one if time == 10.0 else lines_at(time), ANGLES)).update()


# ---------------------------------------------------------------------------- fibres with paths


def paths_at(angle):
    """Return the straight fibres, as paths that pull at the bone of their ends."""
    data = lines_at(angle)
    lengths = polylines_of(data, "paths").lengths
    cells = {"Length": lengths, "RestLength": lengths, "Bow": 0.0 * lengths, "Lever_knee": known_arms(angle)}
    return add_arrays(data, points={"RestPosition": points_of(lines_at(0.0))}, cells=cells)


def test_of_paths_they_are_levers_in_the_one_pose_that_is_asked_for():
    source = Timed(paths_at, ANGLES)
    for time in (0.0, 20.0, 22.5, 90.0):
        source.asked.clear()
        result = arms_of(source, motion=KNEE).update(time=time).output
        np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(time), atol=1e-9)
        assert set(source.asked) <= {time}, "no other pose is needed"
        assert field_array(result, "CoordinateValue")[0] == pytest.approx(time)


def test_of_paths_there_are_none_in_a_pose_that_has_no_levers():
    source = Timed(paths_at, ANGLES)
    source.make = lambda time: paths_at(time) if time > 10.0 else without_levers(time)
    found = arms_of(source, motion=KNEE)
    assert not found.update(time=0.0).output.GetCellData().HasArray("MomentArm")
    result = found.update(time=15.0).output
    np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(15.0), atol=1e-9)


def without_levers(time):
    data = paths_at(time)
    data.GetCellData().RemoveArray("Lever_knee")
    return data

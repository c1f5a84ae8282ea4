"""MomentArms: lengths over time become moment arms, measured once, and only where they are determined."""

import numpy as np
import pytest
from shapes import lines_of
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge, rotation_about
from vtkmuscle.data.arrays import add_arrays, cell_array, field_array, field_string
from vtkmuscle.data.pipeline_times import announce_times
from vtkmuscle.filters import MomentArms

#: Two points that turn about the x axis with the bone, and where their fibres begin [mm].
STARTS = np.array([[0.0, -80.0, 30.0], [5.0, -80.0, 40.0]])
ENDS = np.array([[0.0, 40.0, 20.0], [5.0, 50.0, 10.0]])


def lines_at(angle):
    transform = rotation_about((0, 0, 0), (1, 0, 0), angle)
    ends = ENDS @ transform[:3, :3].T
    return lines_of(np.stack([STARTS, ends], axis=1))


def known_arms(angle):
    """Return the lever of each straight fibre's pull about the x axis, positive right-handed."""
    transform = rotation_about((0, 0, 0), (1, 0, 0), angle)
    ends = ENDS @ transform[:3, :3].T
    pull = STARTS - ends
    pull /= np.linalg.norm(pull, axis=1)[:, None]
    return np.cross(ends, pull)[:, 0]


class Fibres(VTKPythonAlgorithmBase):
    """A source of two straight fibres over time, by a function from time to lines."""

    def __init__(self, times, lines=lines_at):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkPolyData")
        self.times, self.lines, self.asked = [float(time) for time in times], lines, []

    def RequestInformation(self, request, in_info, out_info):
        announce_times(out_info.GetInformationObject(0), self.times)
        return 1

    def RequestData(self, request, in_info, out_info):
        info = out_info.GetInformationObject(0)
        key = self.GetExecutive().UPDATE_TIME_STEP()
        time = info.Get(key) if info.Has(key) else self.times[0]
        self.asked.append(time)
        output = info.Get(vtkDataObject.DATA_OBJECT())
        output.ShallowCopy(self.lines(time))
        output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), time)
        return 1


ANGLES = np.arange(0.0, 91.0, 5.0)


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
    found = arms_of(Fibres(np.arange(0.0, 91.0, step)))
    for angle in (0.0, 20.0, 55.0, 90.0):
        result = found.update(time=angle).output
        np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(angle), atol=bound)
        assert field_string(result, "Coordinate") == "time"
        assert field_array(result, "CoordinateValue")[0] == angle


def test_each_time_step_is_asked_for_once():
    source = Fibres(ANGLES)
    found = arms_of(source)
    found.update(time=20.0)
    assert set(source.asked) == set(ANGLES)
    before = len(source.asked)
    found.update(time=45.0)
    assert source.asked[before:] == [45.0]
    source.Modified()
    found.update(time=45.0)
    assert len(source.asked) >= before + len(ANGLES)


def test_a_motion_says_what_the_coordinate_is():
    motion = RigidMotion(
        np.arange(len(ANGLES)),
        {},
        None,
        {"knee": Coordinate(-ANGLES, "deg"), "still": Coordinate(0 * ANGLES)},
    )
    result = arms_of(Fibres(range(len(ANGLES)), lambda t: lines_at(5.0 * t)), motion=motion).update(time=4.0)
    np.testing.assert_allclose(cell_array(result.output, "MomentArm", ""), -known_arms(20.0), atol=0.1)
    assert field_string(result.output, "Coordinate") == "knee"
    assert field_array(result.output, "CoordinateValue")[0] == pytest.approx(-20.0)
    radians = arms_of(Fibres(np.radians(ANGLES), lambda t: lines_at(np.degrees(t))), unit="rad")
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
        turned = lines_at(np.interp(time, motion.times, angles))
        points = np.array(turned.GetPoints().GetData())
        points[::2, 1] -= np.interp(time, motion.times, shifts)
        return lines_of(points.reshape(2, 2, 3))

    found = arms_of(Fibres(motion.times, lines), motion=motion)
    early = found.update(time=3.0).output.GetCellData()
    assert early.HasArray("MomentArm_turn")
    assert not early.HasArray("MomentArm_slide")
    late = found.update(time=19.0).output
    assert not late.GetCellData().HasArray("MomentArm_turn")
    arms = cell_array(late, "MomentArm_slide", "")
    assert ((arms < -0.8) & (arms > -1.0)).all()  # it lengthens by nearly as much as it is drawn out
    alone = arms_of(Fibres(motion.times, lines), motion=motion, coordinate="slide").update(time=19.0).output
    np.testing.assert_array_equal(cell_array(alone, "MomentArm", ""), arms)


@pytest.mark.parametrize(
    ("parameters", "times", "message"),
    [
        ({}, [1.0], "MomentArms: no coordinate of the motion changes .'time'."),
        (
            {"motion": hinge("b", (0, 0, 0), (1, 0, 0), ANGLES), "coordinate": "hip"},
            ANGLES,
            "no coordinate 'hip'",
        ),
        ({"motion": RigidMotion(ANGLES, {})}, ANGLES, "no coordinate of the motion changes .none"),
    ],
)
def test_what_cannot_be_is_refused_in_words(parameters, times, message):
    with pytest.raises(ValueError, match=message):
        arms_of(Fibres(times), **parameters).update()


def test_fibres_must_be_the_same_and_have_a_time():
    one = lines_of([[[0.0, 0, 0], [1, 0, 0]]])
    with pytest.raises(ValueError, match="at time 10 there are 1, at first 2"):
        arms_of(Fibres(ANGLES, lambda time: one if time == 10.0 else lines_at(time))).update()


# ---------------------------------------------------------------------------- fibres with paths


class Paths(Fibres):
    """The straight fibres, as paths that pull at the bone of their ends."""

    def __init__(self, times):
        super().__init__(times, self.lines_at)

    @staticmethod
    def lines_at(angle):
        data = lines_at(angle)
        points = np.array(data.GetPoints().GetData()).reshape(-1, 2, 3)
        pull = points[:, 0] - points[:, 1]
        add_arrays(
            data,
            points={"RestPosition": np.array(lines_at(0.0).GetPoints().GetData())},
            cells={"Length": np.linalg.norm(pull, axis=1)},
        )
        pull /= np.linalg.norm(pull, axis=1)[:, None]
        add_arrays(data, cells={"Lever_knee": np.cross(points[:, 1], pull)[:, 0]})
        return data


KNEE = hinge("b", (0, 0, 0), (1, 0, 0), ANGLES, coordinate="knee")


def test_of_paths_they_are_levers_in_the_one_pose_that_is_asked_for():
    source = Paths(ANGLES)
    for time in (0.0, 20.0, 22.5, 90.0):
        source.asked.clear()
        result = arms_of(source, motion=KNEE).update(time=time).output
        np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(time), atol=1e-9)
        assert set(source.asked) <= {time}, "no other pose is needed"
        assert field_array(result, "CoordinateValue")[0] == pytest.approx(time)


def test_of_paths_there_are_none_in_a_pose_that_has_no_levers():
    source = Paths(ANGLES)
    source.lines = lambda time: Paths.lines_at(time) if time > 10.0 else without_levers(time)
    found = arms_of(source, motion=KNEE)
    assert not found.update(time=0.0).output.GetCellData().HasArray("MomentArm")
    result = found.update(time=15.0).output
    np.testing.assert_allclose(cell_array(result, "MomentArm", ""), known_arms(15.0), atol=1e-9)


def without_levers(time):
    data = Paths.lines_at(time)
    data.GetCellData().RemoveArray("Lever_knee")
    return data

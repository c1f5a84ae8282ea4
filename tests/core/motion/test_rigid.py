"""Rigid motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vtkmuscle.core.motion import rigid

coordinate = st.floats(-1e3, 1e3)
vector = st.tuples(coordinate, coordinate, coordinate)
direction = vector.filter(lambda axis: np.linalg.norm(axis) > 1e-3)
angle = st.floats(-720, 720)


def screw(centre, axis, degrees, shift):
    transform = rigid.rotation_about(centre, axis, degrees)
    transform[:3, 3] += shift
    return transform


@given(centre=vector, axis=direction, degrees=angle)
def test_rotation_about_keeps_its_axis_and_are_rigid(centre, axis, degrees):
    transform = rigid.rotation_about(centre, axis, degrees)
    assert rigid.are_rigid(transform)
    on_axis = np.array([centre, np.add(centre, 2.0 * np.array(axis))])
    np.testing.assert_allclose(rigid.apply_transform(transform, on_axis), on_axis, atol=1e-8)


def test_rotation_is_right_handed():
    turned = rigid.apply_transform(rigid.rotation_about((0, 0, 0), (0, 0, 1), 90), np.array([[1.0, 0, 0]]))
    np.testing.assert_allclose(turned, [[0, 1, 0]], atol=1e-15)


@given(centre=vector, axis=direction, degrees=angle, shift=vector)
def test_inverse_undoes_a_transform(centre, axis, degrees, shift):
    transform = screw(centre, axis, degrees, shift)
    np.testing.assert_allclose(rigid.inverse(transform) @ transform, np.eye(4), atol=1e-8)


@pytest.mark.parametrize(
    "transform",
    [
        np.diag([2.0, 2, 2, 1]),
        np.diag([-1.0, 1, 1, 1]),
        np.diag([1.0, 1, 1, 2]),
        np.full((4, 4), np.nan),
        np.eye(4) + np.diag([1e-3, 0, 0], k=1),
        np.zeros((4, 4)),
    ],
    ids=["scale", "mirror", "weight", "NaN", "shear", "zero"],
)
def test_are_rigid_refuses(transform):
    assert not rigid.are_rigid(transform)


def test_are_rigid_accepts_a_table_of_six_digits():
    assert rigid.are_rigid(np.round(screw((10, 20, 30), (1, 2, 3), 33.0, (1, 2, 3)), 6))


# -------------------------------------------------------------------- motions


@pytest.fixture
def motion():
    """Rotation about x by 0, 90 and 180 degrees about a centre that moves along x."""
    centre = np.array([5.0, 6, 7])
    table = [screw(centre, (1, 0, 0), 90.0 * i, (4.0 * i, 0, 0)) for i in range(3)]
    return rigid.RigidMotion([0.0, 10.0, 20.0], {"bone": table}, centre)


def test_motion_turns_evenly_between_rows_about_its_centre(motion):
    transform = motion.at(2.5)["bone"]
    np.testing.assert_allclose(transform, screw((5, 6, 7), (1, 0, 0), 22.5, (1.0, 0, 0)), atol=1e-12)


def test_motion_between_rows_are_rigid_and_keeps_the_joint_together(motion):
    for time in np.linspace(0, 20, 41):
        transform = motion.at(time)["bone"]
        assert rigid.are_rigid(transform)
        centre = rigid.apply_transform(transform, motion.centre[None])[0]
        np.testing.assert_allclose(centre, [5 + 0.4 * time, 6, 7], atol=1e-12)


def test_motion_copies_what_it_is_given():
    times, table = np.array([0.0, 1.0]), np.tile(np.eye(4), (2, 1, 1))
    motion = rigid.RigidMotion(times, {"bone": table})
    table[:] = 7.0
    times[:] = 7.0
    np.testing.assert_array_equal(motion.at(1.0)["bone"], np.eye(4))
    with pytest.raises(ValueError, match="read-only"):
        motion.transforms["bone"][0] = 7.0


@pytest.mark.parametrize(
    ("times", "table", "message"),
    [
        ([], np.zeros((0, 4, 4)), "non-empty"),
        ([0.0, np.nan], np.tile(np.eye(4), (2, 1, 1)), "finite"),
        ([0.0, 2.0, 2.0], np.tile(np.eye(4), (3, 1, 1)), "row 2"),
        ([0.0, 1.0], np.tile(np.eye(4), (3, 1, 1)), "'bone'.*shape"),
        ([0.0, 1.0], np.array([np.eye(4), 2 * np.eye(4)]), "'bone'.*row 1.*not rigid"),
    ],
)
def test_motion_refuses_and_says_where(times, table, message):
    with pytest.raises(ValueError, match=message):
        rigid.RigidMotion(times, {"bone": table})


@pytest.mark.parametrize("centre", [(1.0, 2.0), (np.inf, 0.0, 0.0)])
def test_motion_refuses_a_centre(centre):
    with pytest.raises(ValueError, match="centre"):
        rigid.RigidMotion([0.0], {}, centre)


def test_hinge_turns_by_its_times():
    knee = rigid.hinge("tibia", centre=(1, 2, 3), axis=(0, 0, 5), angles=[0, 30, 60])
    np.testing.assert_allclose(
        knee.at(45.0)["tibia"], rigid.rotation_about((1, 2, 3), (0, 0, 1), 45), atol=1e-12
    )


@pytest.mark.parametrize(
    ("centre", "axis", "angles", "words"),
    [
        ((0, 0, 0), (0, 0, 0), [0, 1], "axis"),
        ((0, 0, 0), (np.nan, 0, 0), [0, 1], "axis"),
        ((0, 0), (0, 0, 1), [0, 1], "centre of a motion must be three finite"),
        ((0, 0, 0), (0, 0, 1), [0, 200], "180"),
        ((0, 0, 0), (0, 0, 1), [0, np.nan], "finite"),
    ],
)
def test_hinges_that_cannot_be_are_refused(centre, axis, angles, words):
    with pytest.raises(ValueError, match=words):
        rigid.hinge("tibia", centre, axis, angles)

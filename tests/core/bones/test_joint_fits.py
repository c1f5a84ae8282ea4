"""Fits of balls and condyles to bones of known shape."""

import numpy as np
import pytest

from vtkmuscle import phantoms
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.joint_fits import fitted_ball, fitted_hinge, head_in, oriented_points
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.data.arrays import blocks_of, checked_surface, surface_from
from vtkmuscle.labels.guesses import guessed_joints
from vtkmuscle.phantoms.implicit import ball, thick_curve, union
from vtkmuscle.phantoms.meshing import mesh_of

#: A head on a shaft, and two condyles that stand out behind another.
HEAD = ball((3, 5, 7), 22.0).joined(thick_curve([(3, 5, 7), (-40, 5, -20), (-40, 5, -200)], [9, 12, 12]), 4.0)
MEDIAL, LATERAL = np.array((24.0, 10, 2)), np.array((-24.0, 12, -2))
SHAFT = thick_curve([(0, -4, 14), (0, -6, 200)], [13, 12])
KNEE = union([SHAFT, ball(MEDIAL, 20.0), ball(LATERAL, 19.0)], 4.0)


def parts(solid):
    return oriented_points(*mesh_of(solid, 3.0, 8000))


def test_the_head_of_a_bone_is_found_wherever_it_is_touched():
    surface = parts(HEAD)
    for touched in (surface.points[:, 2] > 20.0, surface.points[:, 0] > 18.0):
        fit = fitted_ball(surface, touched)
        assert fit.centre == pytest.approx((3, 5, 7), abs=0.3)
        assert fit.radius == pytest.approx(22.0, abs=0.3)
        assert fit.confidence > 0.7


@pytest.mark.parametrize("scale", [0.03, 1.0, 30.0])
def test_the_head_of_a_femur_is_found_in_the_pelvis(scale):
    phantom, placed = phantoms.hip(), frame_at((300.0, -20.0, 900.0), (0.4, 1.1, -2.0))
    bones = {}
    for name, surface in blocks_of(phantom.bones):
        points, triangles = checked_surface(surface, name)
        bones[name] = Bone(scale * (points @ placed[:3, :3].T + placed[:3, 3]), triangles, name)
    head = head_in(bones["femur"], bones["pelvis"])
    np.testing.assert_allclose(head.centre, scale * placed[:3, 3], atol=0.05 * head.radius)
    assert head.radius == pytest.approx(scale * phantom.known["head_radius"], rel=0.05)
    assert head.confidence > 0.7
    assert head_in(bones["pelvis"], bones["femur"]) is None  # a hollow


def test_the_axis_goes_through_both_condyles():
    surface = parts(KNEE)
    fit = fitted_hinge(surface, surface.points[:, 2] < -8.0)
    assert fit.centre == pytest.approx(0.5 * (MEDIAL + LATERAL), abs=0.5)
    assert abs(fit.axis @ ((MEDIAL - LATERAL) / np.linalg.norm(MEDIAL - LATERAL))) > np.cos(np.radians(1.0))
    assert fit.confidence > 0.5


def test_two_bones_of_a_joint_move_together():
    femur, shank = (
        surface_from(*mesh_of(solid, 3.0, 8000))
        for solid in (KNEE, thick_curve([(0, 8, -40), (0, 8, -250)], [20, 12]))
    )
    for thigh, leg in (("femur", "shank"), ("femur", "leg"), ("upper_leg", "lower_leg")):
        joints, limits, _ = guessed_joints({thigh: femur, leg: shank, "leg_tibia": shank})
        assert (joints["knee"]["parent"], joints["knee"]["child"]) == (thigh, leg)
        assert joints["leg_tibia"] == {"parent": leg, "child": "leg_tibia", "type": "weld"}
        assert list(limits) == ["knee_flexion"]


def test_what_is_not_round_is_refused():
    surface = parts(thick_curve([(0, 0, 0), (0, 0, 100)], [12, 12]))
    flat = surface._replace(normals=np.tile([0.0, 0.0, 1.0], (len(surface.points), 1)))
    with pytest.raises(ValueError, match="the bone at the joint is not round"):
        fitted_ball(flat, np.abs(surface.points[:, 2] - 50) < 20)
    with pytest.raises(ValueError, match="the bone at the joint is not round"):
        fitted_hinge(surface, surface.points[:, 2] > 1000.0)

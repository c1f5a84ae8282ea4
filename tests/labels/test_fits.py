"""Fits of balls and condyles to bones of known shape."""

import numpy as np
import pytest

from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.data.arrays import surface_from
from vtkmuscle.labels.guesses import fitted_ball, fitted_hinge, guessed_joints
from vtkmuscle.phantoms.implicit import ball, thick_curve, union
from vtkmuscle.phantoms.meshing import mesh_of

#: A head on a shaft, and two condyles that stand out behind another.
HEAD = ball((3, 5, 7), 22.0).joined(thick_curve([(3, 5, 7), (-40, 5, -20), (-40, 5, -200)], [9, 12, 12]), 4.0)
MEDIAL, LATERAL = np.array((24.0, 10, 2)), np.array((-24.0, 12, -2))
SHAFT = thick_curve([(0, -4, 14), (0, -6, 200)], [13, 12])
KNEE = union([SHAFT, ball(MEDIAL, 20.0), ball(LATERAL, 19.0)], 4.0)


def parts(solid):
    points, triangles = mesh_of(solid, 3.0, 8000)
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(points))
    return points, vertex_normals(points, triangles), areas


def test_the_head_of_a_bone_is_found_wherever_it_is_touched():
    points, normals, areas = parts(HEAD)
    for touched in (points[:, 2] > 20.0, points[:, 0] > 18.0):
        fit = fitted_ball(points, normals, areas, touched)
        assert fit.centre == pytest.approx((3, 5, 7), abs=0.3)
        assert fit.radius == pytest.approx(22.0, abs=0.3)
        assert fit.confidence > 0.7


def test_the_axis_goes_through_both_condyles():
    points, normals, areas = parts(KNEE)
    fit = fitted_hinge(points, normals, areas, points[:, 2] < -8.0)
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
    points, normals, areas = parts(thick_curve([(0, 0, 0), (0, 0, 100)], [12, 12]))
    flat = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    with pytest.raises(ValueError, match="the bone at the joint is not round"):
        fitted_ball(points, flat, areas, np.abs(points[:, 2] - 50) < 20)
    with pytest.raises(ValueError, match="the bone at the joint is not round"):
        fitted_hinge(points, normals, areas, points[:, 2] > 1000.0)

"""Lengths as polynomials, fibres by groups, and paths over a few points: known answers."""

from itertools import pairwise

import numpy as np
import pytest

from vtkmuscle.core.fibres.groups import group_errors, group_fibres
from vtkmuscle.core.motion.frames import frame_at
from vtkmuscle.opensim.fitted_lengths import fit_length
from vtkmuscle.opensim.fitted_points import fit_points
from vtkmuscle.opensim.functions import IDENTITY
from vtkmuscle.opensim.muscle_paths import PathPoint, PointPath, moment_arm, powers, terms
from vtkmuscle.opensim.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim.tree_motion import grid_of


def leg():
    axis = JointAxis((0, 0, 1), IDENTITY, "hip")
    hip = Joint("hip_joint", "pelvis", "femur", [axis], kind="pin")
    knee = Joint(
        "knee_joint",
        "femur",
        "tibia",
        [JointAxis((0, 0, 1), IDENTITY, "knee")],
        parent_frame=frame_at((0.0, -0.4, 0.0)),
        kind="pin",
    )
    return KinematicTree(
        "pelvis", [hip, knee], [JointCoordinate(name, range=(-1, 2)) for name in ("hip", "knee")]
    )


GRID = grid_of({"hip": np.linspace(0.0, 1.5, 9), "knee": np.linspace(0.0, 1.5, 8)})


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_polynomial_is_found_with_its_order(rng, order):
    samples = np.column_stack([GRID["hip"], GRID["knee"]])
    coefficients = rng.normal(size=len(powers(2, order)))
    fit = fit_length(terms(samples, order) @ coefficients, GRID)
    assert fit.path.order == order
    np.testing.assert_allclose(fit.path.coefficients, coefficients, atol=1e-9)
    assert fit.largest_error < 1e-10


def test_the_order_is_chosen_against_noise(rng):
    lengths = 0.3 - 0.05 * GRID["hip"] + 0.02 * GRID["hip"] * GRID["knee"] + rng.normal(0, 1e-4, 72)
    fit = fit_length(lengths, GRID)
    assert fit.path.order <= 3
    assert fit.held_back_error < 3e-4
    arms = moment_arm(fit.path, leg(), GRID, "hip")
    np.testing.assert_allclose(arms, 0.05 - 0.02 * GRID["knee"], atol=1e-3)


def test_a_coordinate_that_does_not_change_is_left_out():
    fit = fit_length(0.1 * GRID["knee"], {"hip": np.zeros(72), "knee": GRID["knee"]})
    assert fit.path.names == ("knee",)
    with pytest.raises(ValueError, match="no coordinate changes"):
        fit_length(np.ones(4), {"hip": np.zeros(4)})


def test_fibres_of_one_moment_arm_are_one_group():
    knee = GRID["knee"][:, None]
    arms = np.array([0.02, 0.05, 0.02, 0.05, 0.05])
    lengths = np.array([0.1, 0.2, 0.3, 0.4, 0.5]) - arms * knee
    groups = group_fibres(lengths, 2)
    assert groups.tolist() == [0, 1, 0, 1, 1]
    errors, medoids = group_errors(lengths, groups)
    assert errors.max() < 1e-12
    assert groups[medoids].tolist() == [0, 1]
    assert group_fibres(lengths, 5).max() <= 4
    assert group_fibres(lengths, 1).max() == 0


def fibre_of(path, n_between=5):
    """Return points (f, n, 3) along a path over fixed points."""
    poses = leg().poses(GRID)
    corners = np.stack(
        [poses[p.body][:, :3, :3] @ np.asarray(p.place) + poses[p.body][:, :3, 3] for p in path.points],
        axis=1,
    )
    parts = [corners[:, :1]]
    for i in range(corners.shape[1] - 1):
        t = np.linspace(0, 1, n_between + 1)[1:, None]
        parts.append(corners[:, None, i] * (1 - t) + corners[:, None, i + 1] * t)
    return np.concatenate(parts, axis=1)


def test_points_that_were_fixed_are_found_again():
    path = PointPath(
        [
            PathPoint("pelvis", (0.05, 0.05, 0.0)),
            PathPoint("femur", (0.05, -0.1, 0.0)),
            PathPoint("femur", (0.05, -0.38, 0.0)),
            PathPoint("tibia", (0.05, -0.1, 0.0)),
        ]
    )
    fit = fit_points(fibre_of(path), leg(), GRID, ("pelvis", "tibia"), tolerance=1e-6)
    assert fit.largest_error < 1e-9
    assert abs(fit.offset) < 1e-9


def test_a_tolerance_is_kept_with_few_points():
    centre, radius = np.array([0.0, -0.4, 0.0]), 0.04
    # Round a roller at the knee: no fixed point is right.
    knee = np.linspace(0.0, 1.5, 12)
    values = {"hip": np.zeros(12), "knee": knee}
    fibres = []
    for angle in knee:
        arc = np.linspace(0.0, angle, 9)
        on = centre + radius * np.column_stack([np.cos(arc), np.sin(arc), np.zeros(9)])
        end = on[-1] + 0.2 * np.array([np.sin(angle), -np.cos(angle), 0.0])
        fibres.append(np.vstack([centre + np.array([radius, 0.2, 0.0]), on, end]))
    points = np.array(fibres)
    fit = fit_points(points, leg(), values, ("femur", "tibia"), tolerance=1e-4, most=6)
    straight = fit_points(points, leg(), values, ("femur", "tibia"), tolerance=1e-4, most=2)
    assert fit.error < 0.5 * straight.error
    assert len(fit.path.points) <= 6


def test_moving_points_stand_between_bodies():
    path = PointPath([PathPoint("pelvis", (0.05, 0.05, 0)), PathPoint("tibia", (0.05, -0.1, 0))])
    points = fibre_of(path) + 0.02 * np.sin(np.linspace(0, np.pi, 6))[:, None] * [1.0, 0, 0]
    fit = fit_points(points, leg(), GRID, ("pelvis", "tibia"), tolerance=1e-9)
    on = [(point.body, point.moves) for point in fit.path.points]
    assert all(a[0] != b[0] for a, b in pairwise(on) if a[1] or b[1])

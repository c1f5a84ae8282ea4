"""Lengths as polynomials, fibres by groups, and paths over a few points: known answers."""

import numpy as np
import pytest

from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.joints import grid_of
from vtkmuscle.joints.functions import IDENTITY
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim import export_parts
from vtkmuscle.opensim.export_parts import fit_length, fit_points
from vtkmuscle.opensim.muscle_paths import Cylinder, PathPoint, PointPath, moment_arm, powers, terms


def leg():
    hip = Joint("hip_joint", "pelvis", "femur", [JointAxis((0, 0, 1), IDENTITY, "hip")], kind="pin")
    bending, at_knee = [JointAxis((0, 0, 1), IDENTITY, "knee")], frame_at((0.0, -0.4, 0.0))
    knee = Joint("knee_joint", "femur", "tibia", bending, parent_frame=at_knee, kind="pin")
    coordinates = [JointCoordinate(name, range=(-1, 2)) for name in ("hip", "knee")]
    return KinematicTree("pelvis", [hip, knee], coordinates)


GRID = grid_of({"hip": np.linspace(0.0, 1.5, 9), "knee": np.linspace(0.0, 1.5, 8)})


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_polynomial_is_found_with_its_order(rng, order):
    samples = np.column_stack([GRID["hip"], GRID["knee"]])
    coefficients = rng.normal(size=len(powers(2, order)))
    fit = fit_length(terms(samples, order) @ coefficients, GRID)
    assert fit.order == order
    np.testing.assert_allclose(fit.coefficients, coefficients, atol=1e-9)


def test_fibres_of_one_moment_arm_are_one_group():
    knee = GRID["knee"][:, None]
    arms = np.array([0.02, 0.05, 0.02, 0.05, 0.05])
    lengths = np.array([0.1, 0.2, 0.3, 0.4, 0.5]) - arms * knee
    assert group_fibres(lengths, 2).tolist() == [0, 1, 0, 1, 1]
    assert group_fibres(lengths, 5).max() <= 4
    assert group_fibres(lengths, 1).max() == 0


def test_moment_arms_tell_what_few_lengths_do_not():
    few = grid_of({"hip": np.array([0.0, 0.75, 1.5]), "knee": np.array([0.0, 0.75, 1.5])})
    (hip, knee), (x, y) = few.values(), GRID.values()
    lengths = 0.3 - 0.03 * np.sin(hip) * np.cos(knee)
    arms = {"hip": 0.03 * np.cos(hip) * np.cos(knee), "knee": -0.03 * np.sin(hip) * np.sin(knee)}
    known = 0.3 - 0.03 * np.sin(x) * np.cos(y)
    alone, both = (np.abs(fit_length(lengths, few, by).lengths(leg(), GRID) - known) for by in (None, arms))
    assert both.max() < 1e-3
    assert both.max() < 0.2 * alone.max()


ROLLER = Cylinder("femur", np.array([0.0, -0.4, 0.0]), np.array([0.0, 0.0, 1.0]), 0.04, 0)
ROUND_THE_ROLLER = PointPath(
    [PathPoint("femur", (0.03, -0.1, 0.0)), PathPoint("tibia", (0.05, -0.1, 0.0))], (), [ROLLER]
)


def places_of(points, poses):
    """Return the places (f, 3) of each of a path's points in the poses of the bodies."""
    return [poses[p.body][:, :3, :3] @ np.asarray(p.position) + poses[p.body][:, :3, 3] for p in points]


def bowed(tips):
    """Return lines (f, n, 3) between two ends (f, 3), in a bow to the front."""
    way = np.linspace(0.0, 1.0, 21)[:, None]
    return tips[0][:, None] * (1 - way) + tips[1][:, None] * way + [0.03, 0.0, 0.0] * np.sin(np.pi * way)


def fibre_of(path, n_between=5):
    """Return points (f, n, 3) along a path over fixed points."""
    corners = np.stack(places_of(path.points, leg().poses(GRID)), axis=1)
    parts = [corners[:, :1]]
    for i in range(corners.shape[1] - 1):
        t = np.linspace(0, 1, n_between + 1)[1:, None]
        parts.append(corners[:, None, i] * (1 - t) + corners[:, None, i + 1] * t)
    return np.concatenate(parts, axis=1)


def fitted(path, line, ends, values=GRID, **options):
    """Fit points to a path's own lengths and moment arms; return them and their largest errors."""
    tree = leg()
    arms = {name: moment_arm(path, tree, values, name) for name in path.coordinates(tree)}
    found = fit_points(line, tree, values, ends, path.lengths(tree, values), arms, **options)
    off = [found.lengths(tree, values) - path.lengths(tree, values)]
    off += [moment_arm(found, tree, values, name) - arm for name, arm in arms.items()]
    return found, [float(np.abs(one).max()) for one in off]


def test_points_that_were_fixed_are_found_again():
    path = PointPath(
        [
            PathPoint("femur", (0.03, -0.1, 0.0)),
            PathPoint("femur", (0.05, -0.38, 0.0)),
            PathPoint("tibia", (0.05, -0.1, 0.0)),
            PathPoint("tibia", (0.02, -0.2, 0.0)),
        ]
    )
    found, errors = fitted(path, fibre_of(path), ("femur", "tibia"), tolerance=2e-4)
    assert max(errors) < 1e-3
    assert not found.cylinders
    np.testing.assert_allclose(found.points[0].position, path.points[0].position, atol=1e-12)
    np.testing.assert_allclose(found.points[-1].position, path.points[-1].position, atol=1e-12)


def test_a_roller_is_found_again(monkeypatch):
    monkeypatch.setattr(export_parts, "PLACES", (0.5,))
    values = {"hip": np.zeros(8), "knee": np.linspace(-0.5, 0.2, 8)}
    arms = moment_arm(ROUND_THE_ROLLER, leg(), values, "knee")
    np.testing.assert_allclose(arms[values["knee"] < -0.1], 0.04, atol=1e-9)
    assert arms[-1] > 0.045
    line = bowed(places_of(ROUND_THE_ROLLER.points, leg().poses(values)))
    found, errors = fitted(ROUND_THE_ROLLER, line, ("femur", "tibia"), values, tolerance=1e-5)
    assert len(found.cylinders) == 1
    assert errors[0] < 2e-4
    assert errors[1] < 1e-3


def test_the_way_round_a_cylinder_is_tangents_and_an_arc():
    roller = Cylinder("b", np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 2.0]), 1.0, 0)
    pose = np.tile(np.eye(4), (4, 1, 1))
    first = np.array([[-1.0, 1.0, 0.0], [1.0, 2.0, 0.0], [1.0, 2.0, 0.0], [1.0, 0.5, 0.0]])
    second = np.array([[3.0, 1.0, 3.0], [2.0, -np.sqrt(3.0), 0.0], [1.0, -2.0, 0.0], [1.0, -5.0, 0.0]])
    lengths, _ = roller.segments(pose, first, second)
    assert lengths[0] == pytest.approx(5.0)  # touches: straight, 4 along and 3 up
    assert lengths[1] == pytest.approx(2.0 * np.sqrt(3.0) + np.radians(150.0 - 120.0))
    assert lengths[2] == pytest.approx(2.0 * np.sqrt(3.0) + np.pi - 2.0 * np.pi / 3.0)
    assert lengths[3] == pytest.approx(5.5)  # from within: straight


@pytest.mark.slow
def test_a_cylinder_that_is_passed_on_both_sides_is_not_taken():
    values = {"hip": np.zeros(9), "knee": np.linspace(-1.2, 0.2, 9)}  # through the middle on the way
    poses = leg().poses(values)
    tips = places_of(ROUND_THE_ROLLER.points, poses)
    assert set(ROLLER.segments(poses["femur"], *tips)[1]) == {-1.0, 0.0, 1.0}
    found, _ = fitted(ROUND_THE_ROLLER, bowed(tips), ("femur", "tibia"), values, tolerance=1e-5)
    for one in found.cylinders:
        near = places_of(found.points[one.after : one.after + 2], poses)
        turns = one.segments(poses[one.body], *near)[1]
        assert not turns.min() < 0.0 < turns.max()

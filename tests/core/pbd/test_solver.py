"""What the solver keeps whatever it is given; test_algorithm_2.py has it against the paper."""

import numpy as np
import pytest
from shapes import box
from spindle import spindle

from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.pbd.levels import TwoLevels, coarse_fixed_points
from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters, PBDSolver

BOTH = pytest.mark.parametrize("published", [False, True])


def solver_of(mesh=None, *, bones=(), published=False, **settings):
    """Return the solver of a spindle; as printed with voxels, else with signed distances."""
    parameters = Parameters(**{**(PUBLISHED if published else {}), "iterations": 10, **settings})
    voxels = (20**3, None) if published else None
    return PBDSolver(FixedMuscle(*(mesh or spindle(seed=0))), parameters, dict(bones), 0.0, voxels)


def bent(angle, centre=(0.0, 20.0, 0.0)):
    return np.array([np.eye(4), rotation_about(centre, [1, 0, 0], angle)])


def box_bone(bone, low, high, *, placed=None):
    points, triangles = box(low, high)
    return bone, bone_of(points if placed is None else apply_transform(placed, points), triangles)


@BOTH
@pytest.mark.parametrize("bone_push", ["off", "transform"])
def test_rest_is_an_equilibrium(published, bone_push):
    inside = box_bone(0, [-5, -40, -20], [5, -2, 20])  # overlaps the muscle at rest, as real bones do
    solver = solver_of(iterations=1000, bone_push=bone_push, bones=[inside], published=published)
    state = solver.step(solver.at_rest(2), bent(0.0))
    assert np.abs(state.positions - solver.rest).max() <= 1e-9
    if published:
        assert np.abs(state.velocities).max() <= 1e-9


def test_bones_that_move_together_take_the_muscle_along_unchanged():
    frame = rotation_about([10, -40, 7], [1, 2, 3], 130.0)
    frame[:3, 3] += [300.0, -200.0, 50.0]
    solver = solver_of(iterations=3)
    state = solver.step(solver.at_rest(2), np.array([frame, frame]))
    expected = apply_transform(frame, solver.shape.points)
    np.testing.assert_allclose(state.surface, expected, rtol=0.0, atol=1e-9)


def test_large_steps_are_parted():
    """A step of 36 degrees is twelve of 3."""
    solver = solver_of(finish=False)
    once = solver.step(solver.at_rest(2), bent(36))
    state = solver.at_rest(2)
    for part in range(1, 13):
        state = solver.step(state, bent(3 * part))
    np.testing.assert_allclose(once.surface, state.surface, rtol=0.0, atol=1e-8)


def test_neither_the_order_of_bones_nor_points_of_no_triangle_count():
    points, triangles, fixed_to = spindle(seed=0)
    fixed_to[40:43], bones = 2, np.vstack([bent(4.0), bent(-4.0)[1:]])
    wanted = (solver := solver_of((points, triangles, fixed_to))).step(solver.at_rest(3), bones).surface
    fixed_to = np.append(np.array([1, 2, 0, -1])[fixed_to], [-1, -1])
    solver = solver_of((np.vstack([points, np.diag([900.0, 0, 0])[:2]]), triangles, fixed_to))
    surface = solver.step(solver.at_rest(3), bones[[2, 0, 1]]).surface[:-2]
    np.testing.assert_allclose(surface, wanted, rtol=0.0, atol=1e-9)


def test_a_pose_depends_on_its_start_alone_and_a_good_start_stays():
    solver = solver_of()
    turned = rotation_about((0.0, 20.0, 0.0), [1, 2, 3], 70.0)
    start = apply_transform(turned, solver.shape.points)
    state = solver.pose(start, np.array([turned, turned]))
    np.testing.assert_allclose(state.surface, start, rtol=0.0, atol=1e-9)
    # Lengths as they are there: a muscle that is stretched and squeezed keeps its volume, and stays.
    points, triangles, _ = spindle(seed=0)
    free = solver_of((points, triangles, np.full(len(points), -1)), shape_stiffness=0.0)
    longer = points * [2.0**-0.5, 2.0**-0.5, 2.0]
    np.testing.assert_allclose(free.pose(longer, bent(0.0)).surface, longer, rtol=0.0, atol=1e-9)


def test_points_that_met_a_bone_have_no_velocity_where_asked_for():
    """P21, section 5: it would make spikes in the next step."""
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120])
    free, moving = spindle(seed=0)[2] < 0, {}
    for kept in ("keep", "zero"):
        settings = {"external_force": (0.0, -8.0, 0.0), "contact_velocity": kept}
        solver = solver_of(bones=[wall], published=True, **settings)
        state = solver.step(solver.at_rest(2), bent(0))
        moving[kept] = free & (state.velocities != 0.0).any(axis=1)
        assert state.colliding > 0
        assert np.linalg.norm(state.velocities[moving[kept]], axis=1).max() > 1.0
    assert moving["zero"].sum() == free.sum() - state.colliding < moving["keep"].sum()


def test_a_fine_surface_goes_with_the_coarse_surface_and_its_fixed_points_with_the_bones():
    coarse, fine = spindle(rings=12, around=8), spindle(rings=24, around=16)
    levels = TwoLevels(solver_of(coarse), solver_of(fine), fine[2])
    turned = rotation_about((5.0, -30.0, 7.0), [1, 2, 3], 70.0)
    moved = levels.prolonged(apply_transform(turned, coarse[0]), np.array([turned, turned]))
    np.testing.assert_allclose(moved, apply_transform(turned, fine[0]), rtol=0.0, atol=1e-9)
    stayed = levels.prolonged(coarse[0], bent(10.0))
    for bone, transform in enumerate(bent(10.0)):
        fixed = fine[2] == bone
        np.testing.assert_allclose(stayed[fixed], apply_transform(transform, fine[0][fixed]), atol=1e-9)


def test_a_bone_that_no_coarse_point_is_nearest_to_gets_the_one_nearest_to_its_points():
    fine, fixed_to = np.eye(3)[[0] * 12] * np.arange(12.0)[:, None], np.full(12, -1)
    fixed_to[:4], fixed_to[6:8] = 0, 1
    coarse = fine[[1, 5, 10]] + [0.1, 1.0, 0.0]
    np.testing.assert_array_equal(coarse_fixed_points(fine, fixed_to, coarse), [0, 1, -1])

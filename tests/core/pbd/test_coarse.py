from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spindle import spindle

from vtkmuscle.core.mesh.ring_rotations import ring_rotations
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.pbd.coarse import (
    Prolongation,
    bind,
    coarse_muscle,
    decimate,
    inherit_fixed_points,
)
from vtkmuscle.core.pbd.solver import MuscleSolver, SolverParameters


class Coarse(NamedTuple):
    rest: np.ndarray
    triangles: np.ndarray
    fixed_to: np.ndarray


@pytest.fixture(scope="module")
def fine():
    return spindle(rings=40, around=24)


@pytest.fixture(scope="module")
def coarse(fine):
    return Coarse(*coarse_muscle(*fine, 200))


@pytest.fixture(scope="module")
def prolongation(fine, coarse):
    return Prolongation(coarse.rest, coarse.triangles, fine[0])


def test_decimation_leaves_a_closed_surface_of_about_the_same_volume(fine):
    points, triangles, _ = fine
    coarse_points, coarse_triangles = decimate(points, triangles, 200)
    report, before = survey(coarse_points, coarse_triangles), survey(points, triangles)
    assert report.closed
    assert report.manifold
    assert report.n_unused_points == 0
    assert abs(report.n_points - 200) <= 2
    assert report.volume == pytest.approx(before.volume, rel=0.02)


def test_a_small_muscle_is_not_decimated(fine):
    points, triangles, _ = fine
    same, faces = decimate(points, triangles, 10_000)
    np.testing.assert_array_equal(same, points)
    np.testing.assert_array_equal(faces, triangles)


def test_attachments_are_inherited_and_none_gets_lost(fine, coarse):
    _, _, fixed_to = fine
    for bone in (0, 1):
        part = (coarse.fixed_to == bone).mean()
        assert part == pytest.approx((fixed_to == bone).mean(), abs=0.05)
    lonely = np.full(len(fixed_to), -1)
    lonely[500] = 7
    assert (inherit_fixed_points(coarse.rest, fine[0], lonely) == 7).sum() == 1


def test_rings_turn_with_a_rigid_motion(coarse, prolongation):
    turn = Rotation.from_euler("xyz", [20, 50, -110], degrees=True).as_matrix()
    rotations = ring_rotations(coarse.rest, coarse.rest @ turn.T + 3.0, coarse.triangles, prolongation._rings)
    np.testing.assert_allclose(rotations, np.broadcast_to(turn, rotations.shape), atol=1e-12)


def test_flat_and_collapsed_rings_give_rotations():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    rings = np.array([[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1], [2, 3], [3, 0], [3, 2]])
    for now in (points, 0.0 * points, points[:, [1, 0, 2]]):
        rotations = ring_rotations(points, now, triangles, rings)
        np.testing.assert_allclose(np.linalg.det(rotations), 1.0)


def test_weights_of_a_binding_sum_to_one(prolongation):
    binding = prolongation.binding
    np.testing.assert_allclose(binding.weights.sum(axis=1), 1.0)
    assert (binding.weights >= 0).all()
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
    same_distance = bind(np.array([[0.5, 0.5, 1.0]]), square[:4])
    np.testing.assert_allclose(same_distance.weights, 1.0 / 3.0)


def test_a_rigid_motion_of_the_coarse_muscle_moves_the_full_one_rigidly(fine, coarse, prolongation):
    motion = rotation_about([10, 20, 30], [1, 2, 3], 70.0)
    moved = prolongation.prolong(coarse.rest, apply_transform(motion, coarse.rest), fine[0])
    np.testing.assert_allclose(moved, apply_transform(motion, fine[0]), atol=1e-10)


def test_prolonging_from_a_moved_origin_is_prolonging_the_rest_of_the_motion(fine, coarse, prolongation):
    motion = rotation_about([0, 0, 0], [0, 1, 0], 30.0)
    there = apply_transform(motion, coarse.rest)
    moved = prolongation.prolong(there, there, apply_transform(motion, fine[0]))
    np.testing.assert_allclose(moved, apply_transform(motion, fine[0]), atol=1e-10)


def solver_of(mesh, **options):
    settings = {"iterations": 10, **options.pop("settings", {})}
    return MuscleSolver(*mesh, SolverParameters(**settings), **options)


def bent(angle, centre=(0.0, 0.0, 0.0)):
    return np.array([np.eye(4), rotation_about(centre, [1, 0, 0], angle)])


def test_a_surface_that_cannot_stay_closed_is_refused(fine):
    points, triangles, fixed_to = fine
    with pytest.raises(ValueError, match=r"cannot be decimated to 200 and stay closed"):
        coarse_muscle(points, triangles[40:], fixed_to, 200)


def test_moving_all_bones_together_moves_both_muscles_rigidly(fine, coarse):
    solver = solver_of(fine, settings={"start": "coarse"}, coarse=solver_of(coarse))
    motion = rotation_about([5, 5, 5], [1, 1, 0], 40.0)
    state = solver.step(solver.rest_state(2), np.array([motion] * 2))
    np.testing.assert_allclose(solver.points(state), apply_transform(motion, fine[0]), atol=1e-6)
    there = apply_transform(motion, coarse.rest)
    coarse_solver = solver_of(coarse)
    np.testing.assert_allclose(coarse_solver.points(state.coarse), there, atol=1e-6)


@pytest.mark.parametrize("solver", ["gauss-seidel", "anderson"])
def test_few_iterations_come_nearer_to_the_end_from_the_coarse_start(fine, coarse, solver):
    end = solver_of(fine, settings={"iterations": 800})
    starts = {
        "blend": solver_of(fine, settings={"solver": solver, "stiffness": 1.0, "shape_stiffness": 0.9}),
        "coarse": solver_of(
            fine,
            settings={"solver": solver, "start": "coarse", "shape_stiffness": 0.9},
            coarse=solver_of(coarse, settings={"iterations": 100}),
        ),
    }
    states = {name: muscle.rest_state(2) for name, muscle in starts.items()}
    last = end.rest_state(2)
    for angle in (6.0, 12.0):
        last = end.step(last, bent(angle))
        states = {name: muscle.step(states[name], bent(angle)) for name, muscle in starts.items()}
    distance = {
        name: np.sqrt(np.mean((starts[name].points(state) - end.points(last)) ** 2))
        for name, state in states.items()
    }
    assert distance["coarse"] < 0.5 * distance["blend"]


def test_a_muscle_that_nothing_holds_falls_as_its_momentum_and_damping_have_it(fine, coarse):
    settings = {"external_force": (0.0, 3.0, 0.0), "damping": 0.5, "iterations": 5}
    loose, loose_coarse = ((*mesh[:2], np.full(len(mesh[2]), -1)) for mesh in (fine, coarse))
    solver = solver_of(
        loose, settings={**settings, "start": "coarse"}, coarse=solver_of(loose_coarse, settings=settings)
    )
    state = solver.rest_state(2)
    for _ in range(3):
        state = solver.step(state, bent(0.0))
    # v = (v + 3) / 2 from 0: 1.5, 2.25, 2.625
    np.testing.assert_allclose((state.positions - solver.rest).mean(axis=0), [0.0, 6.375, 0.0], atol=1e-6)
    np.testing.assert_allclose(state.velocities.mean(axis=0), [0.0, 2.625, 0.0], atol=1e-6)


def test_a_coarse_start_needs_a_coarse_muscle(fine):
    with pytest.raises(ValueError, match=r"start is 'coarse', but no coarse muscle is given"):
        solver_of(fine, settings={"start": "coarse"})


def test_settings_of_the_start_can_be_changed(fine, coarse):
    blended = solver_of(fine)
    other = blended.adjusted(SolverParameters(iterations=10, start="coarse"), coarse=solver_of(coarse))
    anew = solver_of(fine, settings={"start": "coarse"}, coarse=solver_of(coarse))
    states = [muscle.step(muscle.rest_state(2), bent(5.0)) for muscle in (other, anew)]
    np.testing.assert_array_equal(states[0].positions, states[1].positions)
    back = other.adjusted(SolverParameters(iterations=10))
    assert back.rest_state(2).coarse is None

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.core.spindle import spindle
from vtkmuscle.core.anderson import anderson
from vtkmuscle.core.batched_iteration import BatchedIteration, FreePoints
from vtkmuscle.core.batches import pack
from vtkmuscle.core.coarse import CoarseMuscle, bind, decimate, inherit_fixed_points, ring_rotations
from vtkmuscle.core.mesh import survey
from vtkmuscle.core.rigid import apply_transform, rotation_about
from vtkmuscle.core.topology import mesh_topology


@pytest.fixture(scope="module")
def fine():
    return spindle(rings=40, around=24)


@pytest.fixture(scope="module")
def coarse(fine):
    return CoarseMuscle(*fine, n_coarse=200)


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


def test_rings_turn_with_a_rigid_motion(coarse):
    turn = Rotation.from_euler("xyz", [20, 50, -110], degrees=True).as_matrix()
    rotations = ring_rotations(coarse.rest, coarse.rest @ turn.T + 3.0, coarse.triangles, coarse._rings)
    np.testing.assert_allclose(rotations, np.broadcast_to(turn, rotations.shape), atol=1e-12)


def test_flat_and_collapsed_rings_give_rotations():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    rings = np.array([[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1], [2, 3], [3, 0], [3, 2]])
    for now in (points, 0.0 * points, points[:, [1, 0, 2]]):
        rotations = ring_rotations(points, now, triangles, rings)
        np.testing.assert_allclose(np.linalg.det(rotations), 1.0)


def test_weights_of_a_binding_sum_to_one(fine, coarse):
    binding = coarse.binding
    np.testing.assert_allclose(binding.weights.sum(axis=1), 1.0)
    assert (binding.weights >= 0).all()
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
    same_distance = bind(np.array([[0.5, 0.5, 1.0]]), square[:4])
    np.testing.assert_allclose(same_distance.weights, 1.0 / 3.0)


def test_a_rigid_motion_of_the_coarse_muscle_moves_the_full_one_rigidly(fine, coarse):
    motion = rotation_about([10, 20, 30], [1, 2, 3], 70.0)
    moved = coarse.prolong(apply_transform(motion, coarse.rest), fine[0])
    np.testing.assert_allclose(moved, apply_transform(motion, fine[0]), atol=1e-10)


def test_prolonging_from_a_moved_origin_is_prolonging_the_rest_of_the_motion(fine, coarse):
    motion = rotation_about([0, 0, 0], [0, 1, 0], 30.0)
    there = apply_transform(motion, coarse.rest)
    moved = coarse.prolong(there, apply_transform(motion, fine[0]), origin=there)
    np.testing.assert_allclose(moved, apply_transform(motion, fine[0]), atol=1e-10)


def test_moving_all_bones_together_moves_the_coarse_muscle_rigidly(coarse):
    motion = rotation_about([5, 5, 5], [1, 1, 0], 40.0)
    rest = np.array([np.eye(4)] * 2)
    start = coarse.place(coarse.rest, rest, np.array([motion] * 2))
    solved, result = coarse.solve(start)
    assert result.converged
    np.testing.assert_allclose(solved, apply_transform(motion, coarse.rest), atol=1e-3)


def test_the_coarse_solution_is_a_better_start_than_the_blended_one(fine, coarse):
    points, triangles, fixed_to = fine
    rest = np.array([np.eye(4)] * 2)
    now = np.array([np.eye(4), rotation_about([0, 0, 0], [1, 0, 0], 5.0)])
    start = coarse.place(coarse.rest, rest, now)
    solved, _ = coarse.solve(start)
    mass = (fixed_to < 0).astype(float)
    iteration = BatchedIteration(
        pack(mesh_topology(len(points), triangles), points, mass, shape_stiffness=0.9)
    )
    errors = []
    reference = None
    for positions in (solved, start):
        prolonged = coarse.prolong(positions, points)
        for bone in (0, 1):
            prolonged[fixed_to == bone] = apply_transform(now[bone], points[fixed_to == bone])
        step = FreePoints(iteration, prolonged)
        if reference is None:
            reference = anderson(step, step.first, max_iterations=1500).x
        errors.append(np.abs(step.first - reference).max())
    assert errors[0] < 0.5 * errors[1]


def test_the_amplification_is_that_of_a_crawling_iteration(coarse):
    rest = np.array([np.eye(4)] * 2)
    now = np.array([np.eye(4), rotation_about([0, 0, 0], [1, 0, 0], 3.0)])
    amplification = coarse.amplification(coarse.place(coarse.rest, rest, now))
    assert 10.0 < amplification < 1e6


def test_the_stiffness_of_coarse_edges_is_asked_for(fine):
    asked = []

    def stiffness(points, topology, fixed_to):
        asked.append((len(points), len(topology.edges), len(fixed_to)))
        return np.full(len(topology.edges), 0.5)

    muscle = CoarseMuscle(*fine, n_coarse=200, stiffness_of=stiffness).muscle
    assert len(asked) == 1
    used = muscle.constants.reshape(-1, 5, 16)[:, 1].reshape(-1)[muscle.edges >= 0]
    np.testing.assert_array_equal(used, 0.5)

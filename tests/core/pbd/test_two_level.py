from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spindle import spindle
from test_solver import bent, box_bone, solver_of

from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.coarse_matrix import HOLD
from vtkmuscle.core.pbd.constraints import DIHEDRAL_FLOOR, dihedral_and_gradient, volume_and_gradient
from vtkmuscle.core.pbd.nodes import farthest_points
from vtkmuscle.core.pbd.solver import MuscleSolver, SolverParameters
from vtkmuscle.core.pbd.two_level import LONGEST_MOVE, CoarseCorrection, CoarseModel, has_coarse_model

N_NODES = 12


@pytest.fixture(scope="module")
def muscle():
    points, triangles, fixed_to = spindle(rings=24, around=16, seed=1)
    return points, mesh_topology(len(points), triangles), fixed_to < 0


@pytest.fixture(scope="module")
def model(muscle):
    points, topology, free = muscle
    return CoarseModel(points, topology, free, np.full(len(topology.edges), 0.7), 0.9, N_NODES)


def motions(model, points, free):
    """Return P (3 n, 6 c) as the text has it, point by point."""
    c = len(model.centres)
    matrix = np.zeros((len(points), 3, c, 6))
    for i in np.flatnonzero(free):
        for j, w in zip(model.neighbours[i], model.weights[i], strict=True):
            matrix[i, :, j, :3] += w * np.eye(3)
            arm = points[i] - model.centres[j]
            matrix[i, :, j, 3:] += w * np.cross(np.eye(3), arm).T / model.reach
    return matrix.reshape(3 * len(points), 6 * c)


def rows(points, topology, free):
    """Return a unit row per constraint that can move anything, distances first, and how many those are."""
    mass = free.astype(float)
    result = []
    for i, j in topology.edges:
        if mass[i] + mass[j] > 0:
            row = np.zeros_like(points)
            row[i], row[j] = mass[i] * (points[i] - points[j]), mass[j] * (points[j] - points[i])
            result.append(row / (np.linalg.norm(points[i] - points[j]) * np.sqrt(mass[i] + mass[j])))
    distances = len(result)
    for quad in topology.quads:
        _, g = dihedral_and_gradient(*points[quad], rest=0.0)
        squares = np.array([part @ part for part in g])
        if mass[quad].any():
            row = np.zeros_like(points)
            length = max((mass[quad] * squares).sum(), DIHEDRAL_FLOOR * squares.sum()) ** 0.5
            for point, part in zip(quad, g, strict=True):
                row[point] = mass[point] * part / length
            result.append(row)
    return np.array(result).reshape(len(result), -1), distances


def test_the_nodes_equations_are_those_of_the_constraints(muscle, model):
    points, topology, free = muscle
    moves = motions(model, points, free)
    all_rows, distances = rows(points, topology, free)
    stiffness = np.where(np.arange(len(all_rows)) < distances, 0.7, 0.9)
    seen = all_rows @ moves
    matrix = seen.T @ (stiffness[:, None] * seen) + HOLD * moves.T @ moves
    # The inverse is taken of the matrix with 1e-9 of its diagonal added.
    matrix[np.diag_indices(len(matrix))] *= 1.0 + 1e-9
    np.testing.assert_allclose(model.inverse @ matrix, np.eye(len(matrix)), atol=1e-5)


def correction_of(model, points, residual, *, contacts=None, keeps_volume=False):
    correction = CoarseCorrection(model, points, keeps_volume=keeps_volume)
    if contacts is not None:
        correction.touch(*contacts)
    moved = np.zeros_like(points)
    correction.add(residual, moved)
    return moved


def test_a_correction_solves_the_nodes_equations(muscle, model, rng):
    points, _, free = muscle
    residual = 1e-4 * rng.normal(size=points.shape)
    moves = motions(model, points, free)
    expected = moves @ (model.inverse @ (moves.T @ residual.reshape(-1)))
    moved = correction_of(model, points, residual)
    np.testing.assert_allclose(moved.reshape(-1), expected, atol=1e-9)
    assert np.abs(moved).max() > 0
    assert not moved[~free].any()


def test_a_correction_turns_with_the_muscle(muscle, model, rng):
    points, _, _ = muscle
    residual = 1e-4 * rng.normal(size=points.shape)
    turn = Rotation.from_euler("xyz", [40, -70, 160], degrees=True).as_matrix()
    one = correction_of(model, points, residual, keeps_volume=True)
    other = correction_of(model, points @ turn.T + [30.0, -5.0, 7.0], residual @ turn.T, keeps_volume=True)
    np.testing.assert_allclose(other, one @ turn.T, atol=1e-9 * np.abs(one).max() + 1e-12)


def test_a_correction_keeps_the_volume_and_slides_along_bones(muscle, model, rng):
    points, topology, free = muscle
    residual = 1e-4 * rng.normal(size=points.shape)
    gradient = np.empty_like(points)
    volume_and_gradient(points, topology.triangles, gradient)
    contacts = np.flatnonzero(free)[[5, 90, 200]]
    normals = rng.normal(size=(3, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    loose = correction_of(model, points, residual)
    bound = correction_of(model, points, residual, contacts=(contacts, normals), keeps_volume=True)
    assert abs((gradient * bound).sum()) <= 1e-6 * abs((gradient * loose).sum())
    along = [np.abs(np.einsum("ij,ij->i", moved[contacts], normals)).max() for moved in (loose, bound)]
    assert along[1] < 0.4 * along[0]  # a contact is as stiff as an edge, not stiffer


def test_a_correction_is_bounded(muscle, model, rng):
    points, _, _ = muscle
    moved = correction_of(model, points, 1e6 * rng.normal(size=points.shape))
    longest = np.linalg.norm(moved, axis=1).max()
    assert longest == pytest.approx(LONGEST_MOVE * model.size)


def test_farthest_points_are_spread_and_all_different(rng):
    points = rng.random((500, 3))
    picked = farthest_points(points, 40)
    assert len(set(picked)) == 40
    apart = np.linalg.norm(points[picked][:, None] - points[picked], axis=2) + 9 * np.eye(40)
    others = np.linalg.norm(points[:, None] - points[picked], axis=2).min(axis=1)
    assert others.max() <= apart.min() * (1.0 + 1e-5)  # or that point would have been picked before


@pytest.mark.parametrize("order", ["colour", "sequential"])
def test_it_ends_where_acceleration_alone_ends_but_sooner(order):
    mesh = spindle(rings=40, around=24, seed=2)
    ends = {}
    for solver, n in (
        ("anderson", 1500),
        ("two-level", 300),
        ("anderson-short", 25),
        ("two-level-short", 25),
    ):
        made = solver_of(mesh, solver=solver.removesuffix("-short"), iterations=n, order=order)
        ends[solver] = made.step(made.rest_state(2), bent(20.0)).positions

    def apart(a, b):
        return np.sqrt(np.mean(np.sum((ends[a] - ends[b]) ** 2, axis=1)))

    assert apart("two-level", "anderson") < 1e-3
    assert apart("two-level-short", "two-level") < 0.1 * apart("anderson-short", "two-level")


def test_a_muscle_on_a_bone_converges_too():
    bone = box_bone(0, [-60, 16, -5], [60, 60, 5])
    mesh = spindle(rings=40, around=24, seed=2)
    few, many = (solver_of(mesh, obstacles=[bone], iterations=n) for n in (60, 400))
    a, b = (made.step(made.rest_state(2), bent(-25.0)) for made in (few, many))
    assert a.colliding > 0
    assert np.sqrt(np.mean(np.sum((a.positions - b.positions) ** 2, axis=1))) < 5e-3


def test_a_step_goes_on_as_the_last_one_did():
    """Steady motion: what the blend errs by is known from the step before, and nearly nothing is left."""
    made = solver_of(spindle(rings=40, around=24, seed=2), iterations=60)
    state = made.rest_state(2)
    for angle in (2.0, 4.0):
        state = made.step(state, bent(angle))
    end = made.step(state, bent(6.0)).positions
    short = solver_of(spindle(rings=40, around=24, seed=2), iterations=2)
    away = [
        np.linalg.norm(short.step(start, bent(6.0)).positions - end)
        for start in (state, replace(state, trend=None))
    ]
    assert away[0] < 0.3 * away[1]


def test_a_step_that_stands_still_expects_nothing():
    made = solver_of(spindle(rings=40, around=24, seed=2), iterations=100)
    state = made.step(made.rest_state(2), bent(10.0))
    again = made.step(state, bent(10.0))
    assert np.abs(again.positions - state.positions).max() < 1e-6


def test_estimated_distance_stops_at_the_tolerance():
    mesh = spindle(rings=40, around=24, seed=2)
    end = solver_of(mesh, iterations=300)
    end = end.step(end.rest_state(2), bent(15.0))
    made = solver_of(mesh, iterations=300, tolerance=0.05)
    state = made.step(made.rest_state(2), bent(15.0))
    assert state.iterations < 100
    assert state.distance <= 0.05
    assert np.sqrt(np.mean(np.sum((state.positions - end.positions) ** 2, axis=1))) < 0.15


def test_a_tiny_muscle_has_no_coarse_model():
    assert not has_coarse_model(np.ones(39, dtype=bool))
    points = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    made = MuscleSolver(points, triangles, np.array([0, -1, -1, -1]), SolverParameters())
    moved = made.step(made.rest_state(1), np.eye(4)[None])
    np.testing.assert_allclose(made.points(moved), points, atol=1e-9)


def test_nodes_of_a_symmetric_muscle_do_not_hang_on_rounding(rng):
    points, _, _ = spindle(rings=24, around=16)
    turn = Rotation.random(random_state=3).as_matrix()
    np.testing.assert_array_equal(farthest_points(points, 30), farthest_points(points @ turn.T + 100.0, 30))

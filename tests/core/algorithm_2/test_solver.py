"""What Algorithm 2 keeps whatever it is given; that it is the paper's is in test_algorithm_2.py."""

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.algorithm_2.solver import Algorithm2, Parameters
from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.motion.rigid import apply_transform, inverse, rotation_about


def solver_of(mesh=None, *, bones=(), **settings):
    muscle = FixedMuscle(*(mesh or spindle(seed=0)))
    return Algorithm2(muscle, Parameters(**{"iterations": 10, **settings}), dict(bones), (20**3, None))


def bent(angle, centre=(0.0, 20.0, 0.0)):
    return np.array([np.eye(4), rotation_about(centre, [1, 0, 0], angle)])


def box_bone(bone, low, high, *, placed=None):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    points = np.asarray(low) + corners * (np.asarray(high) - np.asarray(low))
    return bone, bone_of(points if placed is None else apply_transform(placed, points), triangles)


@pytest.mark.parametrize("bone_push", ["off", "transform"])
def test_rest_is_an_equilibrium(bone_push):
    inside = box_bone(0, [-5, -40, -20], [5, -2, 20])  # overlaps the muscle at rest, as real bones do
    solver = solver_of(iterations=1000, bone_push=bone_push, bones=[inside])
    state = solver.step(solver.at_rest(2), bent(0.0))
    assert np.abs(state.positions - solver.rest).max() <= 1e-9
    assert np.abs(state.velocities).max() <= 1e-9


@pytest.mark.parametrize(("axis", "angle"), [([1, 0, 0], 90.0), ([1, 1, 1], 120.0)])
@pytest.mark.parametrize("sides", [(60, 30, 80), (60, 60, 60)])
def test_a_scene_turned_by_quarters_gives_the_same_turned(sides, axis, angle):
    """Voxels lie along the axes of the scene at rest: they turn with it by quarter turns."""
    points, triangles, fixed_to = spindle(seed=1)
    frame = rotation_about([10, -40, 7], axis, angle)
    low = np.array([-20.0, 14.0, -30.0])
    wall, turned = (box_bone(0, low, low + sides, placed=placed) for placed in (None, frame))
    here = solver_of((points, triangles, fixed_to), bones=[wall])
    there = solver_of((apply_transform(frame, points), triangles, fixed_to), bones=[turned])
    state, moved, hits = here.at_rest(2), there.at_rest(2), 0
    for flexion in (-2, -5, -10, -20):
        state = here.step(state, bent(flexion, (0.0, 0.0, 0.0)))
        moved = there.step(moved, frame @ bent(flexion, (0.0, 0.0, 0.0)) @ inverse(frame))
        hits += state.colliding
    assert hits > 0
    assert np.abs(apply_transform(frame, state.surface) - moved.surface).max() <= 1e-6


def test_far_from_the_origin_no_digits_are_lost():
    points, triangles, fixed_to = spindle(seed=2)
    far = np.array([1e6, -1e6, 1e6])
    shift = np.eye(4)
    shift[:3, 3] = far
    here, there = (solver_of((p, triangles, fixed_to)) for p in (points, points + far))
    state, moved = here.at_rest(2), there.at_rest(2)
    for angle in (10, 30):
        state = here.step(state, bent(angle))
        moved = there.step(moved, shift @ bent(angle) @ inverse(shift))
    assert np.abs(state.surface + far - moved.surface).max() <= 1e-6


def test_fixed_points_follow_their_bone():
    solver = solver_of()
    state, rest, fixed_to = solver.at_rest(2), solver.shape.points, spindle(seed=0)[2]
    for angle in (2, 4, 6):
        state = solver.step(state, bent(angle))
    for bone, transform in enumerate(bent(6)):
        fixed = fixed_to == bone
        assert np.abs(state.surface[fixed] - apply_transform(transform, rest[fixed])).max() <= 1e-9


def test_a_step_does_not_change_the_state_it_starts_from():
    solver = solver_of()
    first = solver.step(solver.at_rest(2), bent(5))
    copies = [first.positions.copy(), first.velocities.copy(), first.transforms.copy()]
    once, again = solver.step(first, bent(10)), solver.step(first, bent(10))
    for now, before in zip([first.positions, first.velocities, first.transforms], copies, strict=True):
        assert np.array_equal(now, before)
    assert np.array_equal(once.positions, again.positions)
    assert np.array_equal(once.velocities, again.velocities)


def test_a_force_beyond_all_numbers_is_an_error():
    solver = solver_of(external_force=(1e300, 0, 0), dt=1e10)
    with pytest.raises(ValueError, match="smaller external_force"):
        solver.step(solver.at_rest(2), bent(0))


def test_a_force_moves_a_free_body_as_newton_has_it():
    points, triangles, _ = spindle(seed=3)
    free = (points, triangles, np.full(len(points), -1))
    solver = solver_of(free, dt=0.1, velocity_kept=1.0, external_force=(0, 0, -10.0))
    state = solver.at_rest(1)
    for _ in range(5):
        state = solver.step(state, np.eye(4)[None])
    # Symplectic Euler: dt^2 f (1 + 2 + ... + 5).
    assert np.allclose(state.positions - solver.rest, [0, 0, -10 * 0.01 * 15], atol=1e-9)


def test_damping_stops_a_body():
    points, triangles, _ = spindle(seed=3)
    free = (points, triangles, np.full(len(points), -1))
    solver = solver_of(free, velocity_kept=0.0, external_force=(1.0, 0, 0))
    state = solver.step(solver.at_rest(1), np.eye(4)[None])
    assert np.allclose(state.positions, solver.rest)


@pytest.mark.parametrize("bone_push", ["off", "transform"])
def test_points_stay_out_of_a_bone_that_the_muscle_is_pushed_against(bone_push):
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120])
    mesh = spindle(rings=24, around=16)
    solver = solver_of(mesh, bones=[wall], external_force=(0, -4.0, 0), bone_push=bone_push)
    state, hits = solver.at_rest(2), 0
    for _ in range(20):
        state = solver.step(state, bent(0))
        hits += state.colliding
    assert state.surface[mesh[2] < 0, 1].min() > -18.0 - 1e-12
    assert hits > 0


def test_points_that_met_a_bone_have_no_velocity_where_asked_for():
    """P21, section 5: it would make spikes in the next step."""
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120])
    free, moving = spindle(seed=0)[2] < 0, {}
    for kept in ("keep", "zero"):
        solver = solver_of(bones=[wall], external_force=(0.0, -8.0, 0.0), contact_velocity=kept)
        state = solver.step(solver.at_rest(2), bent(0))
        moving[kept] = free & (state.velocities != 0.0).any(axis=1)
        assert state.colliding > 0
        assert np.linalg.norm(state.velocities[moving[kept]], axis=1).max() > 1.0
    assert moving["zero"].sum() == free.sum() - state.colliding < moving["keep"].sum()


def test_a_bone_out_of_reach_costs_no_voxels():
    near, far = box_bone(0, [-5, -40, -20], [5, -2, 20]), box_bone(1, [500, 0, 0], [600, 10, 10])
    solver = solver_of(bones=[near, far])
    solver.step(solver.at_rest(2), bent(1))
    assert list(solver._contact._grids) == [0]


def test_all_points_fixed_is_allowed():
    points, triangles, _ = spindle()
    solver = solver_of((points, triangles, np.ones(len(points), dtype=int)))
    state = solver.step(solver.at_rest(2), bent(40))
    assert np.allclose(state.surface, apply_transform(bent(40)[1], points))


def test_open_and_flat_surfaces_are_refused():
    points, triangles, fixed_to = spindle()
    with pytest.raises(ValueError, match="open: 3 edges"):
        solver_of((points, triangles[1:], fixed_to))
    with pytest.raises(ValueError, match="no volume"):
        solver_of((points * [1, 1, 0], triangles, fixed_to))


def test_progress_rises_to_one_and_may_stop_the_step():
    solver = solver_of(iterations=4)
    parts = []
    solver.step(solver.at_rest(2), bent(10), progress=parts.append)
    assert parts == pytest.approx(np.arange(1, 5) / 4)

    def stop(part):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solver.step(solver.at_rest(2), bent(10), progress=stop)

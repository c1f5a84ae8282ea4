"""What the solver keeps whatever it is given; test_algorithm_2.py has it against the paper."""

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.fixed_muscle import FixedMuscle
from vtkmuscle.core.motion.rigid import apply_transform, inverse, rotation_about
from vtkmuscle.core.pbd.levels import TwoLevels
from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters, PBDSolver
from vtkmuscle.core.pbd.voxels import _GRIDS

BOTH = pytest.mark.parametrize("published", [False, True])


def solver_of(mesh=None, *, bones=(), published=False, **settings):
    """Return the solver of a spindle; as printed with voxels, else with signed distances."""
    printed = PUBLISHED if published else {}
    parameters = Parameters(**{**printed, "iterations": 10, **settings})
    voxels = (20**3, None) if published else None
    return PBDSolver(FixedMuscle(*(mesh or spindle(seed=0))), parameters, dict(bones), 0.0, voxels)


def bent(angle, centre=(0.0, 20.0, 0.0)):
    return np.array([np.eye(4), rotation_about(centre, [1, 0, 0], angle)])


def box_bone(bone, low, high, *, placed=None):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    points = np.asarray(low) + corners * (np.asarray(high) - np.asarray(low))
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


@pytest.mark.parametrize(("axis", "angle"), [([1, 0, 0], 90.0), ([1, 1, 1], 120.0)])
@pytest.mark.parametrize("sides", [(60, 30, 80), (60, 60, 60)])
@BOTH
def test_a_scene_turned_by_quarters_gives_the_same_turned(sides, axis, angle, published):
    """Voxels lie along the axes of the scene at rest: they turn with it by quarter turns."""
    points, triangles, fixed_to = spindle(seed=1)
    frame = rotation_about([10, -40, 7], axis, angle)
    low = np.array([-20.0, 14.0, -30.0])
    wall, turned = (box_bone(0, low, low + sides, placed=placed) for placed in (None, frame))
    here = solver_of((points, triangles, fixed_to), bones=[wall], published=published)
    there = solver_of(
        (apply_transform(frame, points), triangles, fixed_to), bones=[turned], published=published
    )
    state, moved, hits = here.at_rest(2), there.at_rest(2), 0
    for flexion in (-2, -5, -10, -20):
        state = here.step(state, bent(flexion, (0.0, 0.0, 0.0)))
        moved = there.step(moved, frame @ bent(flexion, (0.0, 0.0, 0.0)) @ inverse(frame))
        hits += state.colliding
    assert hits > 0
    assert np.abs(apply_transform(frame, state.surface) - moved.surface).max() <= 1e-6


@BOTH
def test_far_from_the_origin_no_digits_are_lost(published):
    points, triangles, fixed_to = spindle(seed=2)
    far = np.array([1e6, -1e6, 1e6])
    shift = np.eye(4)
    shift[:3, 3] = far
    here, there = (solver_of((p, triangles, fixed_to), published=published) for p in (points, points + far))
    state, moved = here.at_rest(2), there.at_rest(2)
    for angle in (10, 30):
        state = here.step(state, bent(angle))
        moved = there.step(moved, shift @ bent(angle) @ inverse(shift))
    assert np.abs(state.surface + far - moved.surface).max() <= 1e-6


def test_bones_that_move_together_take_the_muscle_along_unchanged():
    frame = rotation_about([10, -40, 7], [1, 2, 3], 130.0)
    frame[:3, 3] += [300.0, -200.0, 50.0]
    solver = solver_of(iterations=3)
    state = solver.step(solver.at_rest(2), np.array([frame, frame]))
    expected = apply_transform(frame, solver.shape.points)
    np.testing.assert_allclose(state.surface, expected, rtol=0.0, atol=1e-9)


@BOTH
def test_fixed_points_follow_their_bone(published):
    solver = solver_of(published=published)
    state, rest, fixed_to = solver.at_rest(2), solver.shape.points, spindle(seed=0)[2]
    for angle in (2, 4, 6):
        state = solver.step(state, bent(angle))
    for bone, transform in enumerate(bent(6)):
        fixed = fixed_to == bone
        assert np.abs(state.surface[fixed] - apply_transform(transform, rest[fixed])).max() <= 1e-9


@BOTH
def test_a_step_does_not_change_the_state_it_starts_from(published):
    solver = solver_of(published=published)
    first = solver.step(solver.at_rest(2), bent(5))
    arrays = [first.surface, first.positions, first.transforms]
    copies = [array.copy() for array in arrays]
    ends = [solver.step(first, bent(10)) for _ in range(2)]
    assert all(map(np.array_equal, arrays, copies))
    assert np.array_equal(ends[0].positions, ends[1].positions)


@pytest.mark.parametrize("iterations", [1, 3, 10, 100])
@pytest.mark.parametrize("step", [2.0, 10.0, 45.0, 90.0])
@pytest.mark.parametrize("anisotropy", ["always", "fibres"])
def test_it_keeps_its_shape_whatever_the_step(iterations, step, anisotropy):
    mesh = spindle(rings=30, around=20)
    top = mesh[0][:, 1].max()
    bar = box_bone(0, [-60, top + 1.0, -6], [60, top + 40.0, 6])
    solver = solver_of(mesh, iterations=iterations, anisotropy=anisotropy, bones=[bar])
    state = solver.at_rest(2)
    for angle in np.arange(step, 90.1, step):
        state = solver.step(state, bent(-angle))
        report = solver.shape.compare(state.surface)
        assert report.volume_ratio == pytest.approx(1.0, abs=1e-6)
        assert report.edge_stretch_max < 12.0
        assert report.degenerate_edges == 0
        assert iterations < 10 or report.dihedral_error_p95 < 30.0


def test_large_steps_are_parted():
    """A step of 40 degrees is ten of 4."""
    solver = solver_of(finish=False)
    once = solver.step(solver.at_rest(2), bent(40))
    state = solver.at_rest(2)
    for part in range(1, 11):
        state = solver.step(state, bent(4 * part))
    np.testing.assert_allclose(once.surface, state.surface, rtol=0.0, atol=1e-8)


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


def test_a_force_beyond_all_numbers_is_an_error():
    solver = solver_of(published=True, external_force=(1e300, 0, 0), dt=1e10)
    with pytest.raises(ValueError, match="smaller external_force"):
        solver.step(solver.at_rest(2), bent(0))


def test_a_force_moves_a_free_body_as_newton_has_it():
    points, triangles, _ = spindle(seed=3)
    free = (points, triangles, np.full(len(points), -1))
    solver = solver_of(free, published=True, dt=0.1, velocity_kept=1.0, external_force=(0, 0, -10.0))
    state = solver.at_rest(1)
    for _ in range(5):
        state = solver.step(state, np.eye(4)[None])
    # Symplectic Euler: dt^2 f (1 + 2 + ... + 5).
    assert np.allclose(state.positions - solver.rest, [0, 0, -10 * 0.01 * 15], atol=1e-9)


@pytest.mark.parametrize("bone_push", ["off", "transform"])
def test_points_stay_out_of_a_bone_that_the_muscle_is_pushed_against(bone_push):
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120])
    mesh = spindle(rings=24, around=16)
    solver = solver_of(mesh, bones=[wall], published=True, external_force=(0, -4.0, 0), bone_push=bone_push)
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
        settings = {"external_force": (0.0, -8.0, 0.0), "contact_velocity": kept}
        solver = solver_of(bones=[wall], published=True, **settings)
        state = solver.step(solver.at_rest(2), bent(0))
        moving[kept] = free & (state.velocities != 0.0).any(axis=1)
        assert state.colliding > 0
        assert np.linalg.norm(state.velocities[moving[kept]], axis=1).max() > 1.0
    assert moving["zero"].sum() == free.sum() - state.colliding < moving["keep"].sum()


def test_a_bone_out_of_reach_costs_no_voxels_nor_distances():
    near, far = box_bone(0, [-5, -40, -20], [5, -2, 20]), box_bone(1, [500, 0, 0], [600, 10, 10])
    solver = solver_of(bones=[near, far], published=True)
    solver.step(solver.at_rest(2), bent(1))
    assert near[1] in _GRIDS
    assert far[1] not in _GRIDS
    solver = solver_of(bones=[near, far])
    solver.step(solver.at_rest(2), bent(1))
    assert near[1].nbytes > 0 == far[1].nbytes


@BOTH
def test_all_points_fixed_is_allowed(published):
    points, triangles, _ = spindle()
    solver = solver_of((points, triangles, np.ones(len(points), dtype=int)), published=published)
    state = solver.step(solver.at_rest(2), bent(40))
    assert np.allclose(state.surface, apply_transform(bent(40)[1], points))


def test_open_and_flat_surfaces_are_refused():
    points, triangles, fixed_to = spindle()
    with pytest.raises(ValueError, match="open: 3 edges"):
        solver_of((points, triangles[1:], fixed_to))
    with pytest.raises(ValueError, match="no volume"):
        solver_of((points * [1, 1, 0], triangles, fixed_to))


@pytest.mark.parametrize(("angle", "parts"), [(4, 1), (10, 3)])
def test_progress_rises_to_one_and_may_stop_the_step(angle, parts):
    solver, done = solver_of(iterations=4), []
    solver.step(solver.at_rest(2), bent(angle), progress=done.append)
    assert done == pytest.approx(np.arange(1, 4 * parts + 1) / (4 * parts))

    def stop(part):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solver.step(solver.at_rest(2), bent(angle), progress=stop)


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

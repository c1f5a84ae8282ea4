import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spindle import spindle

from vtkmuscle.core.bones.bone import bone_axes
from vtkmuscle.core.collision.distance_obstacle import DistanceObstacle
from vtkmuscle.core.collision.obstacles import VoxelObstacle
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.motion.rigid import apply_transform, inverse, rotation_about
from vtkmuscle.core.pbd.anisotropy import edge_stiffness, harmonic_directions
from vtkmuscle.core.pbd.parameters import SolverParameters
from vtkmuscle.core.pbd.solver import MuscleSolver


def solver_of(mesh=None, *, obstacles=(), anisotropy=True, **settings):
    """Return a solver that follows no fibres and makes all its iterations, accelerated by default."""
    settings = {"iterations": 10, "tolerance": 0.0, **settings}
    points, triangles, fixed_to = mesh or spindle(seed=0)
    topology = mesh_topology(len(points), triangles)
    directions = harmonic_directions(points, topology, fixed_to) if anisotropy else None
    stiffness = None if directions is None else edge_stiffness(points, topology.edges, directions)
    return MuscleSolver(
        points,
        triangles,
        fixed_to,
        SolverParameters(**settings),
        edge_stiffness=stiffness,
        obstacles=obstacles,
    )


def bent(angle, centre=(0.0, 20.0, 0.0)):
    return np.array([np.eye(4), rotation_about(centre, [1, 0, 0], angle)])


def box_bone(bone, low, high, collision="sdf", *, placed=None):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    points = np.asarray(low) + corners * (np.asarray(high) - np.asarray(low))
    if placed is not None:
        points = apply_transform(placed, points)
    if collision == "voxel":
        return VoxelObstacle(bone, points, triangles, n_max=20**3)
    return DistanceObstacle(bone, points, triangles)


#: Ways to keep points out of bones.
KINDS = [("sdf", "off"), ("voxel", "off"), ("voxel", "transform")]


@pytest.mark.parametrize("start", ["inertial", "blend"])
@pytest.mark.parametrize(("collision", "bone_push"), KINDS)
def test_rest_is_an_equilibrium(start, collision, bone_push):
    inside = box_bone(
        0, [-5, -40, -20], [5, -2, 20], collision
    )  # overlaps the muscle at rest, as real bones do
    solver = solver_of(iterations=1000, prediction=start, bone_push=bone_push, obstacles=[inside])
    state = solver.step(solver.rest_state(2), bent(0.0))
    assert np.abs(state.positions - solver.rest).max() <= 1e-9
    assert np.abs(state.velocities).max() <= 1e-9


@pytest.mark.parametrize("start", ["inertial", "blend"])
def test_everything_moved_rigidly_gives_the_same_moved(start):
    points, triangles, fixed_to = spindle(seed=1)
    frame = rotation_about([10, -40, 7], [1, 2, 3], 130.0)
    frame[:3, 3] += [300.0, -200.0, 50.0]
    here, there = (
        solver_of((p, triangles, fixed_to), prediction=start)
        for p in (points, apply_transform(frame, points))
    )
    state, moved = here.rest_state(2), there.rest_state(2)
    for angle in (5, 10, 30, 60):
        state = here.step(state, bent(angle))
        moved = there.step(moved, frame @ bent(angle) @ inverse(frame))
    assert np.abs(apply_transform(frame, here.points(state)) - there.points(moved)).max() <= 1e-6


#: Voxels lie along the axes of the scene at rest: they turn with it by quarter turns.
TURNS = [("sdf", [1, 2, 3], 130.0), ("voxel", [1, 0, 0], 90.0), ("voxel", [1, 1, 1], 120.0)]


@pytest.mark.parametrize("sides", [(60, 30, 80), (60, 60, 60)])
@pytest.mark.parametrize(("collision", "axis", "angle"), TURNS)
def test_collisions_do_not_depend_on_how_the_scene_is_turned(sides, collision, axis, angle):
    points, triangles, fixed_to = spindle(seed=1)
    frame = rotation_about([10, -40, 7], axis, angle)
    low = np.array([-20.0, 14.0, -30.0])
    wall, turned = (box_bone(0, low, low + sides, collision, placed=placed) for placed in (np.eye(4), frame))
    here = solver_of((points, triangles, fixed_to), obstacles=[wall])
    there = solver_of((apply_transform(frame, points), triangles, fixed_to), obstacles=[turned])
    state, moved, hits = here.rest_state(2), there.rest_state(2), 0
    for flexion in (-2, -5, -10, -20):
        state = here.step(state, bent(flexion, (0.0, 0.0, 0.0)))
        moved = there.step(moved, frame @ bent(flexion, (0.0, 0.0, 0.0)) @ inverse(frame))
        hits += state.colliding
    assert hits > 0
    assert np.abs(apply_transform(frame, here.points(state)) - there.points(moved)).max() <= 1e-6


@pytest.mark.parametrize("start", ["inertial", "blend"])
def test_bones_that_move_together_take_the_muscle_with_them(start):
    solver = solver_of(prediction=start, iterations=400 if start == "inertial" else 10, velocity_kept=0.0)
    move = rotation_about([0, 300, 0], [0, 1, 1], 0.02 if start == "inertial" else 90.0)
    state = solver.step(solver.rest_state(2), np.array([move, move]))
    expected = apply_transform(move, solver.points(solver.rest_state(2)))
    error = np.abs(solver.points(state) - expected).max()
    # From standing still the muscle takes many iterations to follow; blended it is there from the start.
    assert error <= (0.1 if start == "inertial" else 1e-9)


def test_far_from_the_origin_no_digits_are_lost():
    points, triangles, fixed_to = spindle(seed=2)
    far = np.array([1e6, -1e6, 1e6])
    shift = np.eye(4)
    shift[:3, 3] = far
    here, there = (solver_of((p, triangles, fixed_to)) for p in (points, points + far))
    state, moved = here.rest_state(2), there.rest_state(2)
    for angle in (10, 30):
        state = here.step(state, bent(angle))
        moved = there.step(moved, shift @ bent(angle) @ inverse(shift))
    assert np.abs(here.points(state) + far - there.points(moved)).max() <= 1e-6
    assert there.report(moved).volume_ratio == pytest.approx(here.report(state).volume_ratio, abs=1e-9)


@pytest.mark.parametrize("start", ["inertial", "blend"])
@pytest.mark.parametrize("iterations", [3, 10])
def test_volume_is_kept_in_every_frame(start, iterations):
    solver = solver_of(prediction=start, iterations=iterations)
    rest = signed_volume(solver.rest, solver.topology.triangles)
    state = solver.rest_state(2)
    for angle in range(5, 91, 5):
        state = solver.step(state, bent(angle))
        volume = signed_volume(state.positions, solver.topology.triangles)
        assert volume == pytest.approx(rest, rel=1e-3)
        assert solver.report(state).volume_ratio == pytest.approx(volume / rest, rel=1e-12)


def test_fixed_points_follow_their_bone():
    solver = solver_of()
    state = solver.rest_state(2)
    rest = solver.points(state)
    for angle in (20, 45, 90):
        state = solver.step(state, bent(angle))
    for bone, transform in enumerate(bent(90)):
        fixed = solver.fixed_to == bone
        assert np.abs(solver.points(state)[fixed] - apply_transform(transform, rest[fixed])).max() <= 1e-9


def test_a_step_does_not_change_the_state_it_starts_from():
    solver = solver_of(prediction="inertial")
    first = solver.step(solver.rest_state(2), bent(5))
    copies = [first.positions.copy(), first.velocities.copy(), first.transforms.copy()]
    once = solver.step(first, bent(10))
    assert all(
        np.array_equal(now, before)
        for now, before in zip([first.positions, first.velocities, first.transforms], copies, strict=True)
    )
    again = solver.step(first, bent(10))
    assert np.array_equal(once.positions, again.positions)
    assert np.array_equal(once.velocities, again.velocities)


@pytest.mark.parametrize("start", ["inertial", "blend"])
@pytest.mark.parametrize("dt", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("k", [0.0, 0.5, 1.0])
def test_a_quarter_turn_in_one_step_is_finite(start, dt, k):
    solver = solver_of(
        prediction=start,
        dt=dt,
        stiffness=k,
        shape_stiffness=k,
        volume_stiffness=k,
        external_force=(0, 0, -9810.0),
    )
    state = solver.rest_state(2)
    for angle in (90, 0, 90):
        state = solver.step(state, bent(angle))
        assert np.isfinite(state.positions).all()
        assert np.isfinite(state.velocities).all()
        said = [value for value in vars(solver.report(state)).values() if value is not None]
        assert np.isfinite(said).all()


def test_a_force_beyond_all_numbers_is_an_error():
    solver = solver_of(external_force=(1e300, 0, 0), dt=1e10)
    with pytest.raises(ValueError, match="smaller external_force"):
        solver.step(solver.rest_state(2), bent(0))


def test_a_force_moves_a_free_body_as_newton_has_it():
    points, triangles, _ = spindle(seed=3)
    free = (points, triangles, np.full(len(points), -1))
    solver = solver_of(free, dt=0.1, velocity_kept=1.0, external_force=(0, 0, -10.0), prediction="blend")
    state = solver.rest_state(1)
    for _ in range(5):
        state = solver.step(state, np.eye(4)[None])
    # Symplectic Euler: dt^2 f (1 + 2 + ... + 5).
    assert np.allclose(state.positions - solver.rest, [0, 0, -10 * 0.01 * 15], atol=1e-9)


def test_damping_stops_a_body():
    points, triangles, _ = spindle(seed=3)
    solver = solver_of(
        (points, triangles, np.full(len(points), -1)), velocity_kept=0.0, external_force=(1.0, 0, 0)
    )
    state = solver.step(solver.rest_state(1), np.eye(4)[None])
    assert np.allclose(state.positions, solver.rest)


@pytest.mark.parametrize(("solver", "end"), [("gauss-seidel", 90), ("anderson", 90)])
def test_substeps_follow_the_bones_on_their_arc(solver, end):
    coarse, fine = solver_of(substeps=1, solver=solver), solver_of(substeps=end // 10, solver=solver)
    steps = solver_of(solver=solver)
    state = steps.rest_state(2)
    for angle in range(10, end + 1, 10):
        state = steps.step(state, bent(angle))
    at_once = fine.step(fine.rest_state(2), bent(end))
    assert np.allclose(at_once.positions, state.positions, atol=1e-9)
    assert not np.allclose(coarse.step(coarse.rest_state(2), bent(90)).positions, state.positions, atol=0.1)


@pytest.mark.parametrize("solver", ["gauss-seidel", "anderson"])
@pytest.mark.parametrize(("collision", "bone_push"), KINDS)
def test_points_stay_out_of_a_bone_that_the_muscle_is_pushed_against(collision, bone_push, solver):
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120], collision)
    solver = solver_of(
        spindle(rings=24, around=16),
        obstacles=[wall],
        external_force=(0, -4.0, 0),
        prediction="inertial",
        solver=solver,
        bone_push=bone_push,
    )
    state = solver.rest_state(2)
    hits = 0
    for _ in range(20):
        state = solver.step(state, bent(0))
        hits += state.colliding
    free = solver.fixed_to < 0
    # A bone's distances are those of its triangles to a small part of a cell; voxels stop points on a face.
    slack = 1e-3 if collision == "sdf" else 1e-12
    assert solver.points(state)[free, 1].min() > -18.0 - slack
    assert hits > 0
    assert solver.report(state).volume_ratio == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("collision", ["sdf", "voxel"])
def test_points_that_met_a_bone_have_no_velocity(collision):
    """P21, section 5: it would make spikes in the next step."""
    wall = box_bone(0, [-120, -60, -120], [120, -18, 120], collision)
    solver = solver_of(obstacles=[wall], prediction="inertial", external_force=(0.0, -8.0, 0.0))
    state = solver.step(solver.rest_state(2), bent(0))
    free = solver.fixed_to < 0
    still = free & (state.velocities == 0.0).all(axis=1)
    assert state.colliding > 0
    assert still.sum() == state.colliding
    assert np.linalg.norm(state.velocities[free & ~still], axis=1).max() > 1.0


@pytest.mark.parametrize("collision", ["sdf", "voxel"])
def test_a_bone_out_of_reach_costs_no_grid(collision):
    near = box_bone(0, [-5, -40, -20], [5, -2, 20], collision)
    far = box_bone(1, [500, 0, 0], [600, 10, 10], collision)
    solver = solver_of(obstacles=[near, far])
    solver.step(solver.rest_state(2), bent(1))
    made = "grid" if collision == "voxel" else "shape"
    assert made in vars(near)
    assert made not in vars(far)


def test_all_points_fixed_is_allowed():
    points, triangles, _ = spindle()
    solver = solver_of((points, triangles, np.ones(len(points), dtype=int)))
    state = solver.step(solver.rest_state(2), bent(40))
    assert np.allclose(solver.points(state), apply_transform(bent(40)[1], points))


def test_a_part_without_fixed_points_is_carried_along():
    points, triangles, fixed_to = spindle()
    both = np.vstack([points, points + np.array([60.0, 0, 0])])
    mesh = both, np.vstack([triangles, triangles + len(points)]), np.r_[fixed_to, np.full(len(points), -1)]
    solver = solver_of(mesh)
    state = solver.step(solver.rest_state(2), bent(10))
    assert np.isfinite(state.positions).all()
    assert solver.report(state).volume_ratio == pytest.approx(1.0, abs=1e-3)


def test_report_of_a_rigid_motion_is_no_strain():
    solver = solver_of()
    move = np.eye(4)
    move[:3, :3] = Rotation.from_rotvec([1.0, 2.0, 0.5]).as_matrix()
    state = solver.step(solver.rest_state(2), np.array([move, move]))
    report = solver.report(state)
    for stretch in (report.edge_stretch_p50, report.edge_stretch_p95, report.edge_stretch_max):
        assert stretch == pytest.approx(1.0, abs=1e-9)
    assert report.dihedral_error_p95 == pytest.approx(0.0, abs=1e-6)


def test_open_and_flat_surfaces_are_refused():
    points, triangles, fixed_to = spindle()
    with pytest.raises(ValueError, match="open: 3 edges"):
        solver_of((points, triangles[1:], fixed_to))
    flat = points * [1, 1, 0]
    with pytest.raises(ValueError, match="no volume"):
        solver_of((flat, triangles, fixed_to), anisotropy=False)


def test_progress_rises_to_one_and_may_stop_the_step():
    solver = solver_of(iterations=4, substeps=2)
    parts = []
    solver.step(solver.rest_state(2), bent(10), progress=parts.append)
    assert parts == pytest.approx(np.arange(1, 9) / 8)

    def stop(part):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solver.step(solver.rest_state(2), bent(10), progress=stop)


@pytest.mark.parametrize("order", ["batched", "sequential"])
def test_the_numbers_of_the_points_hardly_matter_where_the_solve_ends(order, rng):
    """By them edges have their order, and constraints that contradict each other are met in turn."""
    points, triangles, fixed_to = spindle(seed=1)
    new = rng.permutation(len(points))
    old = np.argsort(new)
    ends = []
    for muscle in ((points, triangles, fixed_to), (points[old], new[triangles], fixed_to[old])):
        solver = solver_of(muscle, iterations=3000, projection_order=order)
        ends.append(solver.step(solver.rest_state(2), bent(2)).positions)
    moved = np.linalg.norm(ends[0] - points, axis=1).max()
    assert np.linalg.norm(ends[0] - ends[1][new], axis=1).max() <= 0.05 * moved


def test_acceleration_goes_to_the_end_of_the_plain_iteration():
    plain = solver_of(iterations=20_000, solver="gauss-seidel", shape_stiffness=1.0, anisotropy=False)
    fast = solver_of(iterations=1000, shape_stiffness=1.0, anisotropy=False)
    rest = plain.rest_state(2)
    slow, quick = plain.step(rest, bent(2)), fast.step(rest, bent(2))
    assert quick.distance is None  # no fibres draw the points, so that nothing bounds it
    assert np.abs(slow.positions - quick.positions).max() <= 1e-2


def test_a_bone_that_jumps_through_the_muscle_takes_nothing_to_its_other_side():
    wall = box_bone(2, [-60, 60, -60], [60, 70, 60])
    points, triangles, fixed_to = spindle(seed=1)
    fixed_to[fixed_to == 1] = -1  # held at its lower end only
    solver = solver_of((points, triangles, fixed_to), obstacles=[wall], anisotropy=False)
    now = np.array([np.eye(4)] * 3)
    now[2, 1, 3] = -50.0
    with pytest.warns(UserWarning, match="bone: it moved 50 mm .* but is 10 mm thick"):
        state = solver.step(solver.rest_state(3), now)
    free = fixed_to < 0
    assert np.isfinite(state.positions).all()
    assert solver.points(state)[free, 1].max() <= 10.0 + 1e-2


def test_the_axes_of_a_bone_turn_with_it(rng):
    points = rng.normal(size=(200, 3)) * [3.0, 2.0, 1.0]
    axes = bone_axes(points)
    for _ in range(20):
        frame = rotation_about(rng.normal(size=3), rng.normal(size=3), rng.uniform(0, 360))
        assert np.allclose(bone_axes(apply_transform(frame, points)), axes @ inverse(frame), atol=1e-9)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ({"solver": "gauss_seidel"}, r"SolverParameters.solver is 'gauss_seidel', but must be 'anderson' or"),
        ({"prediction": "inertal"}, "prediction is 'inertal', but must be 'blend' or 'inertial'"),
        ({"projection_order": "color"}, "projection_order is 'color', but must be 'batched' or 'sequential'"),
        ({"bone_push": True}, "bone_push is True"),
        ({"iterations": 0}, r"iterations is 0, but must be >= 1 and <= 1000000"),
        ({"velocity_kept": 7}, r"velocity_kept is 7, but must be >= 0.0 and <= 1.0"),
        ({"tolerance": -1.0}, r"tolerance is -1.0, but must be >= 0.0"),
        ({"tolerance": np.nan}, "tolerance is nan"),
        ({"dt": 0.0}, "dt is 0.0, but must be > 0.0"),
        ({"external_force": (1.0,)}, "must have three components"),
    ],
)
def test_settings_that_make_no_sense_are_refused(setting, told):
    with pytest.raises(ValueError, match=told):
        SolverParameters(**setting)

"""Large meshes in parts, on several threads: the same numbers, whoever computes them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_batched_constraints import Scalar

from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd import batched_iteration, batches, domains
from vtkmuscle.core.pbd.batched_constraints import WIDTH
from vtkmuscle.core.pbd.batched_iteration import BatchedIteration
from vtkmuscle.core.pbd.batches import AFTER, EDGES, FIRST, KIND, LAST, pack


def torus(along, around):
    """Return a bumpy torus."""
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    u, v = 2.0 * np.pi * i / along, 2.0 * np.pi * j / around
    r = 10.0 + np.sin(7 * u) * np.cos(5 * v)
    points = np.stack([(30 + r * np.cos(v)) * np.cos(u), (30 + r * np.cos(v)) * np.sin(u), r * np.sin(v)], 2)
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = (i + 1) % along * around + j, (i + 1) % along * around + (j + 1) % around
    triangles = np.stack([a, c, b, b, c, d], axis=2).reshape(-1, 3)
    return points.reshape(-1, 3), triangles


@pytest.fixture(scope="module")
def large():
    """Return topology, points in an order that is not the mesh's, mass and moved points."""
    points, triangles = torus(128, 40)
    rng = np.random.default_rng(5)
    shuffled = rng.permutation(len(points))
    points, triangles = points[np.argsort(shuffled)], shuffled[triangles]
    mass = (points[:, 0] > -30.0).astype(float)
    moved = points + 0.05 * rng.normal(size=points.shape) * mass[:, None]
    return mesh_topology(len(points), triangles), points, mass, moved


@pytest.fixture
def cut_early(monkeypatch):
    """Have meshes of the size of a test's cut into parts."""
    monkeypatch.setattr(domains, "LARGE", 1000)
    monkeypatch.setattr(batches, "LARGE", 1000)


def packed(large, **settings):
    topology, points, mass, _ = large
    return pack(topology, points, mass, shape_stiffness=0.9, **settings)


@pytest.mark.usefixtures("cut_early")
def test_tasks_of_one_stage_move_no_point_that_another_of_them_needs(large):
    muscle = packed(large)
    tasks = muscle.tasks[muscle.tasks[:, KIND] == EDGES]
    assert len(tasks) > domains.DOMAINS
    spare = 4 * muscle.n_points
    for stage in np.unique(tasks[:, AFTER]):
        points = [
            np.unique(muscle.edge_at[4 * WIDTH * task[FIRST] : 4 * WIDTH * task[LAST]])
            for task in tasks[tasks[:, AFTER] == stage]
        ]
        together = np.concatenate([p[p < spare] for p in points])
        assert len(np.unique(together)) == len(together)


@pytest.mark.usefixtures("cut_early")
def test_every_edge_that_can_move_is_in_one_task(large):
    muscle = packed(large)
    edges = np.sort(muscle.edges[muscle.edges >= 0])
    assert len(np.unique(edges)) == len(edges)
    tasks = muscle.tasks[muscle.tasks[:, KIND] == EDGES]
    assert tasks[0, FIRST] == 0
    assert (tasks[1:, FIRST] == tasks[:-1, LAST]).all()
    assert tasks[-1, LAST] * WIDTH == len(muscle.edges)
    assert (muscle.tasks[:, AFTER] <= np.arange(len(muscle.tasks))).all()


@pytest.mark.usefixtures("cut_early")
def test_parts_give_what_the_scalar_projections_give_in_that_order(large):
    topology, points, mass, moved = large
    muscle = packed(large)
    scalar = Scalar(muscle, topology, points, 1.0, 0.9)
    scalar.mass = mass
    expected = moved.copy()
    for _ in range(3):
        scalar.edges(expected)
        scalar.volume(expected)
    records = muscle.records(moved)
    BatchedIteration(muscle).run(records, 3)
    np.testing.assert_allclose(muscle.points(records), expected, rtol=0.0, atol=1e-12)


@pytest.mark.usefixtures("cut_early")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_any_number_of_threads_gives_the_same_bits(large, dtype):
    muscle = packed(large, dtype=dtype)
    start = muscle.records(large[3])
    alone = start.copy()
    volume = BatchedIteration(muscle).run(alone, 20)
    assert not np.array_equal(alone, start)
    for threads in (2, 3, 8):
        together = start.copy()
        iteration = BatchedIteration(muscle, threads=threads)
        assert iteration.threads == threads
        assert iteration.run(together, 20) == volume
        assert together.tobytes() == alone.tobytes()


@pytest.mark.usefixtures("cut_early")
def test_each_half_of_an_iteration_is_the_same_on_threads(large):
    muscle = packed(large)
    alone, together = muscle.records(large[3]), muscle.records(large[3])
    volumes = []
    for threads, records in ((1, alone), (4, together)):
        iteration = BatchedIteration(muscle, threads=threads)
        iteration.edges(records)
        volumes.append(iteration.volume(records))
    assert together.tobytes() == alone.tobytes()
    assert volumes[0] == volumes[1]


@pytest.mark.usefixtures("cut_early")
def test_muscles_solved_side_by_side_do_not_disturb_each_other(large):
    muscle = packed(large)
    start = muscle.records(large[3])
    alone = start.copy()
    BatchedIteration(muscle).run(alone, 5)

    def solve(_):
        records = start.copy()
        BatchedIteration(muscle, threads=3).run(records, 5)
        return records.tobytes()

    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(solve, range(8))) == {alone.tobytes()}


@pytest.mark.usefixtures("cut_early")
def test_helpers_that_never_come_are_not_waited_for(large, monkeypatch):
    class Absent:
        def submit(self, *arguments):
            """Do nothing."""

    muscle = packed(large)
    start = muscle.records(large[3])
    alone = start.copy()
    BatchedIteration(muscle).run(alone, 2)
    monkeypatch.setattr(batched_iteration, "_helpers", Absent)
    BatchedIteration(muscle, threads=8).run(start, 2)
    assert start.tobytes() == alone.tobytes()


def test_a_small_muscle_is_left_to_one_thread_in_one_part(large):
    muscle = packed(large)
    assert muscle.tasks[:, KIND].tolist() == [0, 1, 2]
    np.testing.assert_array_equal(muscle.places, np.arange(muscle.n_points))
    assert BatchedIteration(muscle, threads=8).threads == 1


@pytest.mark.usefixtures("cut_early")
def test_a_large_muscle_of_which_nothing_can_move(large):
    topology, points, mass, moved = large
    muscle = pack(topology, points, 0.0 * mass)
    records = muscle.records(moved)
    BatchedIteration(muscle, threads=2).run(records, 2)
    np.testing.assert_array_equal(muscle.points(records), moved)

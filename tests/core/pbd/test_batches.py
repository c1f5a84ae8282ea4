import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.batched_constraints import RECORD, WIDTH
from vtkmuscle.core.pbd.batches import cut_into_batches, pack


@pytest.fixture
def rough():
    points, triangles, fixed_to = spindle(seed=1)
    return mesh_topology(len(points), triangles), points, (fixed_to < 0).astype(float)


def test_every_edge_that_can_move_something_is_in_one_batch(rough):
    topology, points, mass = rough
    muscle = pack(topology, points, mass)
    movable = (mass[topology.edges] > 0).any(axis=1)
    movable[topology.quad_edges] |= (mass[topology.quads] > 0).any(axis=1)
    packed = np.sort(muscle.edges[muscle.edges >= 0])
    assert packed.tolist() == np.flatnonzero(movable).tolist()
    assert not movable.all()


def test_no_two_edges_of_a_batch_share_a_point(rough):
    topology, points, mass = rough
    muscle = pack(topology, points, mass)
    spare = RECORD * len(points)
    for batch in muscle.edge_at.reshape(-1, 4 * WIDTH):
        moved = batch[batch < spare]
        assert len(np.unique(moved)) == len(moved)


def test_edges_without_a_stiffness_are_dropped(rough):
    topology, points, mass = rough
    assert len(pack(topology, points, mass, edge_stiffness=0.0, shape_stiffness=0.0).edges) == 0


def test_batches_keep_the_order_within_a_colour():
    ids = np.array([7, 3, 9, 1, 5])
    batches = cut_into_batches(ids, np.array([1, 0, 1, 0, 1]), 2)
    assert batches.tolist() == [3, 1, 7, 9, 5, -1]


def test_nothing_to_cut():
    none = np.empty(0, dtype=np.int64)
    assert len(cut_into_batches(none, none, 4)) == 0


def test_records_hold_the_points_and_start_on_a_cache_line(rough, rng):
    topology, points, mass = rough
    muscle = pack(topology, points, mass)
    moved = points + rng.normal(size=points.shape)
    records = muscle.records(moved)
    assert records.ctypes.data % 64 == 0
    np.testing.assert_array_equal(muscle.points(records), moved)
    np.testing.assert_array_equal(records.reshape(-1, RECORD)[:-1, 3], mass)


def test_packing_is_the_same_every_time(rough):
    one, other = pack(*rough), pack(*rough)
    np.testing.assert_array_equal(one.edge_at, other.edge_at)
    np.testing.assert_array_equal(one.ring_at, other.ring_at)


def test_a_packed_muscle_takes_less_than_200_bytes_per_triangle():
    points, triangles, fixed_to = spindle(rings=60, around=30)
    muscle = pack(mesh_topology(len(points), triangles), points, (fixed_to < 0).astype(float))
    assert muscle.nbytes < 200 * len(triangles)

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.batches import RECORD, WIDTH, cut_into_batches, pack
from vtkmuscle.core.pbd.rest_shape import RestShape


@pytest.fixture
def rough():
    points, triangles, fixed_to = spindle(seed=1)
    topology = mesh_topology(len(points), triangles)
    return topology, RestShape(points, topology), (fixed_to < 0).astype(float)


def test_every_edge_that_can_move_something_is_in_one_batch(rough):
    topology, _, mass = rough
    muscle = pack(*rough)
    movable = (mass[topology.edges] > 0).any(axis=1)
    movable[topology.quad_edges] |= (mass[topology.quads] > 0).any(axis=1)
    packed = np.sort(muscle.edges[muscle.edges >= 0])
    assert packed.tolist() == np.flatnonzero(movable).tolist()
    assert not movable.all()


def test_no_two_edges_of_a_batch_share_a_point(rough):
    muscle = pack(*rough)
    spare = RECORD * muscle.n_points
    for batch in muscle.edge_at.reshape(-1, 4 * WIDTH):
        moved = batch[batch < spare]
        assert len(np.unique(moved)) == len(moved)


def test_edges_without_a_stiffness_are_dropped(rough):
    assert len(pack(*rough, edge_stiffness=0.0, shape_stiffness=0.0).edges) == 0


def test_batches_keep_the_order_within_a_colour():
    ids = np.array([7, 3, 9, 1, 5])
    batches = cut_into_batches(ids, np.array([1, 0, 1, 0, 1]), 2)
    assert batches.tolist() == [3, 1, 7, 9, 5, -1]


def test_nothing_to_cut():
    none = np.empty(0, dtype=np.int64)
    assert len(cut_into_batches(none, none, 4)) == 0


def test_records_start_on_a_cache_line(rough):
    packed = pack(*rough)
    records = packed.records()
    assert records.ctypes.data % 64 == 0
    assert records.shape == (RECORD * (packed.n_points + 1),)


def test_packing_is_the_same_every_time(rough):
    one, other = pack(*rough), pack(*rough)
    np.testing.assert_array_equal(one.edge_at, other.edge_at)
    np.testing.assert_array_equal(one.constants, other.constants)


def test_packed_edges_take_less_than_150_bytes_per_triangle():
    points, triangles, fixed_to = spindle(rings=60, around=30)
    topology = mesh_topology(len(points), triangles)
    packed = pack(topology, RestShape(points, topology), (fixed_to < 0).astype(float))
    assert packed.edges.nbytes + packed.edge_at.nbytes + packed.constants.nbytes < 150 * len(triangles)

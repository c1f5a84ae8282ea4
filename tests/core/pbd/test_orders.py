import platform

import numba
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from one_by_one import sweep_dihedrals, sweep_distances
from spindle import spindle

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.orders import BUFFER, ColourOrder, SequentialOrder, Stiffness, Volume, sweep_batches
from vtkmuscle.core.pbd.rest_shape import RestShape

#: Largest difference between projections one by one and many at a time, in one iteration [mm].
AGREEMENT = 1e-12


def no_bones(p):
    return np.zeros(len(p), dtype=np.bool_)


class Colours:
    """The order of the colours, and its edges one by one."""

    def __init__(self, points, triangles, mass, *, edge_stiffness=1.0, shape_stiffness=0.9):
        self.topology = topology = mesh_topology(len(points), triangles)
        self.shape, self.mass = RestShape(points, topology), mass
        edges = np.broadcast_to(edge_stiffness, len(topology.edges)).astype(float)
        self.stiffness = Stiffness(edges, shape_stiffness, 1.0)
        self.order = ColourOrder(topology, self.shape, mass, self.stiffness)
        self.packed = self.order._edges
        self.quad_of = np.full(len(topology.edges), -1)
        defined = self.shape.angle_defined
        self.quad_of[topology.quad_edges[defined]] = np.flatnonzero(defined)

    def many_at_a_time(self, p):
        records = self.packed.records()
        table = records.reshape(-1, 4)
        table[:-1, :3], table[:-1, 3] = p, self.mass
        sweep_batches(records, self.packed.edge_at, self.packed.constants, np.zeros(BUFFER))
        return table[:-1, :3].copy()

    def one_by_one(self, p):
        p, shape, topology = p.copy(), self.shape, self.topology
        for e in self.packed.edges[self.packed.edges >= 0]:
            one = slice(e, e + 1)
            if self.mass[topology.edges[e]].any():
                sweep_distances(
                    p, self.mass, topology.edges[one], shape.lengths[one], self.stiffness.edges[one]
                )
            q = self.quad_of[e]
            if q >= 0:
                one = slice(q, q + 1)
                angles = shape.angles[one]
                sweep_dihedrals(
                    p,
                    self.mass,
                    topology.quads[one],
                    np.cos(angles),
                    np.sin(angles),
                    self.stiffness.shape,
                    shape.angle_squares[one],
                )
        return p

    def iterations(self, p, count):
        p = p.copy()
        for _ in range(count):
            self.order.project(p, no_bones, bones_last=False)
        return p


@pytest.fixture(scope="module")
def rough():
    points, triangles, fixed_to = spindle(seed=1)
    return points, triangles, (fixed_to < 0).astype(float)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 5.0), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=25)
def test_many_at_a_time_are_one_by_one_in_the_same_order(seed, size, shape_stiffness):
    rng = np.random.default_rng(seed)
    points, triangles, _ = spindle(seed=1)
    mass = (rng.random(len(points)) < 0.8).astype(float)
    stiffness = rng.random(len(mesh_topology(len(points), triangles).edges))
    muscle = Colours(points, triangles, mass, edge_stiffness=stiffness, shape_stiffness=shape_stiffness)
    start = points + size * rng.normal(size=points.shape) * mass[:, None]
    # Rounding grows from constraint to constraint where the noise has turned triangles over.
    difference = np.abs(muscle.many_at_a_time(start) - muscle.one_by_one(start)).max()
    assert difference < AGREEMENT * max(1.0, 100.0 * size)


def test_an_iteration_is_the_edges_and_then_the_volume(rough, rng):
    points, triangles, mass = rough
    muscle = Colours(*rough)
    start = points + rng.normal(size=points.shape) * mass[:, None]
    expected = muscle.one_by_one(start)
    volume = Volume(triangles, muscle.shape, mass).project(expected, 1.0)
    assert volume == pytest.approx(signed_volume(muscle.one_by_one(start), triangles), rel=1e-12)
    assert np.abs(muscle.iterations(start, 1) - expected).max() < 1e-11


@pytest.mark.parametrize("bones_last", [True, False])
def test_points_that_met_a_bone_take_no_part_in_a_volume_that_comes_after_it(rough, bones_last):
    points, _, mass = rough
    muscle = Colours(*rough)
    hit = (points[:, 0] > 0) & (mass > 0)
    met = []

    def keep_out(p):
        met.append(p.copy())
        return hit

    p = 1.05 * points
    assert muscle.order.project(p, keep_out, bones_last=bones_last) is hit
    free = mass > 0
    assert np.array_equal(p[hit], met[0][hit])
    assert np.array_equal(p[free & ~hit], met[0][free & ~hit]) == bones_last


def test_degenerate_shapes_stay_finite(rough):
    folded = rough[0].copy()
    folded[20:60] = folded[20]  # zero edges, zero areas, collinear and folded pairs
    folded[60:80, 2] = 0.0
    folded[80] = folded[81] + 1e-9
    assert np.isfinite(Colours(*rough).iterations(folded, 50)).all()


def test_a_degenerate_rest_shape_keeps_lengths_only_where_no_angle_is_defined(rough):
    points, triangles, mass = (array.copy() for array in rough)
    points[30] = points[31]
    muscle = Colours(points, triangles, mass)
    start = points + 0.1 * np.sin(np.arange(points.size)).reshape(-1, 3)
    assert np.abs(muscle.many_at_a_time(start) - muscle.one_by_one(start)).max() < AGREEMENT


@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.floats(0.0, 60.0),
    shape_stiffness=st.floats(0.0, 1.0),
    anisotropy=st.floats(0.0, 1.0),
    count=st.integers(1, 3000),
)
@example(seed=0, size=50.0, shape_stiffness=1.0, anisotropy=1.0, count=4000)
@settings(deadline=None, max_examples=25)
def test_the_muscle_stays_within_bounds_whatever_stiffness_iterations_and_anisotropy(
    seed, size, shape_stiffness, anisotropy, count
):
    """Angles keep triangles of up to 8 times their size; without that the example grows by 10^5 times."""
    rng = np.random.default_rng(seed)
    points, triangles, fixed_to = spindle(seed=4)
    mass = (fixed_to < 0).astype(float)
    stiffness = 1.0 - anisotropy * rng.choice([0.0, 1.0], len(mesh_topology(len(points), triangles).edges))
    stiffness = stiffness if anisotropy < 1.0 else 0.0
    muscle = Colours(points, triangles, mass, edge_stiffness=stiffness, shape_stiffness=shape_stiffness)
    start = points + size * rng.normal(size=points.shape) * mass[:, None]
    reach = np.linalg.norm(start, axis=1).max()
    assert np.linalg.norm(muscle.iterations(start, count), axis=1).max() < 8.0 * (reach + 100.0)


def test_fixed_points_do_not_move(rough, rng):
    points, _, mass = rough
    start = points + rng.normal(size=points.shape)
    np.testing.assert_array_equal(Colours(*rough).iterations(start, 5)[mass == 0], start[mass == 0])


@pytest.mark.parametrize("order", [ColourOrder, SequentialOrder])
def test_the_rest_shape_does_not_move(rough, order):
    points, triangles, mass = rough
    topology = mesh_topology(len(points), triangles)
    stiffness = Stiffness(np.ones(len(topology.edges)), 0.9, 1.0)
    made, p = order(topology, RestShape(points, topology), mass, stiffness), points.copy()
    for _ in range(5):
        made.project(p, no_bones, bones_last=False)
    assert np.abs(p - points).max() < AGREEMENT


def test_all_points_may_be_fixed_and_none(rough):
    points, triangles, mass = rough
    for value in (0.0, 1.0):
        end = Colours(points, triangles, np.full_like(mass, value)).iterations(1.2 * points, 3)
        assert np.isfinite(end).all()
        moved = np.abs(end - 1.2 * points).max()
        assert moved == 0.0 if value == 0.0 else moved > 0.1


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
def test_the_loops_over_lanes_are_vector_instructions(rough):
    packed = Colours(*rough).packed
    compiled = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"})(sweep_batches.py_func)
    compiled(packed.records(), packed.edge_at, packed.constants, np.zeros(BUFFER))
    assembly = next(iter(compiled.inspect_asm().values()))
    assert "sqrtpd" in assembly
    assert "divpd" in assembly
    assert "sqrtsd" not in assembly

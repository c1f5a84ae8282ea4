import platform

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spindle import spindle

from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd import batched_volume, constraints
from vtkmuscle.core.pbd.batched_constraints import ARCTANGENT, sweep_edges
from vtkmuscle.core.pbd.batched_iteration import BatchedIteration, FreePoints
from vtkmuscle.core.pbd.batches import pack

#: Largest difference between the scalar and the batched projections of one iteration [mm].
AGREEMENT = 1e-12


class Scalar:
    """The scalar projections, in the order of the batches."""

    def __init__(self, muscle, topology, rest, edge_stiffness, shape_stiffness):
        self.muscle, self.topology = muscle, topology
        self.mass = muscle.inverse_mass
        self.lengths = edge_lengths(rest, topology.edges)
        self.edge_stiffness = np.broadcast_to(edge_stiffness, len(topology.edges)).copy()
        self.shape_stiffness = shape_stiffness
        angles, defined = constraints.dihedral_angle(*(rest[topology.quads[:, i]] for i in range(4)))
        self.cosines, self.sines = np.cos(angles), np.sin(angles)
        self.quad_of = np.full(len(topology.edges), -1)
        self.quad_of[topology.quad_edges[defined]] = np.flatnonzero(defined)

    def edges(self, p):
        for e in self.muscle.edges[self.muscle.edges >= 0]:
            one = slice(e, e + 1)
            if self.mass[self.topology.edges[e]].any():
                constraints.project_distance(
                    p, self.mass, self.topology.edges[one], self.lengths[one], self.edge_stiffness[one]
                )
            q = self.quad_of[e]
            if q >= 0:
                one = slice(q, q + 1)
                constraints.project_dihedral(
                    p,
                    self.mass,
                    self.topology.quads[one],
                    self.cosines[one],
                    self.sines[one],
                    self.shape_stiffness,
                )

    def volume(self, p, mass=None):
        return constraints.project_volume(
            p,
            self.mass if mass is None else mass,
            self.topology.triangles,
            self.muscle.rest_volume,
            self.muscle.volume_floor,
            self.muscle.volume_stiffness,
            np.empty_like(p),
        )


def both(points, triangles, mass, *, edge_stiffness=1.0, shape_stiffness=0.9):
    topology = mesh_topology(len(points), triangles)
    muscle = pack(topology, points, mass, edge_stiffness=edge_stiffness, shape_stiffness=shape_stiffness)
    return BatchedIteration(muscle), Scalar(muscle, topology, points, edge_stiffness, shape_stiffness)


@pytest.fixture(scope="module")
def rough():
    points, triangles, fixed_to = spindle(seed=1)
    return points, triangles, (fixed_to < 0).astype(float)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 5.0), st.floats(0.0, 1.0))
@settings(deadline=None, max_examples=25)
def test_edges_agree_with_the_scalar_projections_in_the_same_order(seed, size, shape_stiffness):
    rng = np.random.default_rng(seed)
    points, triangles, _ = spindle(seed=1)
    mass = (rng.random(len(points)) < 0.8).astype(float)
    stiffness = rng.random(len(mesh_topology(len(points), triangles).edges))
    batched, scalar = both(points, triangles, mass, edge_stiffness=stiffness, shape_stiffness=shape_stiffness)
    start = points + size * rng.normal(size=points.shape) * mass[:, None]
    p = batched.muscle.records(start)
    batched.edges(p)
    scalar.edges(start)
    # Rounding grows from constraint to constraint where the noise has turned triangles over.
    assert np.abs(batched.muscle.points(p) - start).max() < AGREEMENT * max(1.0, 100.0 * size)


def test_ten_iterations_agree_with_the_scalar_projections(rough, rng):
    points, triangles, mass = rough
    batched, scalar = both(points, triangles, mass)
    start = points + rng.normal(size=points.shape) * mass[:, None]
    p = batched.muscle.records(start)
    volume = batched.run(p, 10)
    for _ in range(10):
        scalar.edges(start)
        expected = scalar.volume(start)
    assert np.abs(batched.muscle.points(p) - start).max() < 1e-11
    assert volume == pytest.approx(expected, rel=1e-13)


def test_the_volume_agrees_with_the_scalar_projection(rough, rng):
    points, triangles, mass = rough
    batched, scalar = both(points, triangles, mass)
    start = points * [1.1, 1.0, 1.0] + 0.1 * rng.normal(size=points.shape)
    p = batched.muscle.records(start)
    assert batched.volume(p) == pytest.approx(scalar.volume(start), rel=1e-13)
    assert np.abs(batched.muscle.points(p) - start).max() < AGREEMENT


def test_points_without_a_mass_in_the_records_take_no_part_in_the_volume(rough, rng):
    points, triangles, mass = rough
    batched, scalar = both(points, triangles, mass)
    resting = np.where(rng.random(len(mass)) < 0.3, 0.0, mass)
    start = 1.05 * points
    p = batched.muscle.records(start)
    p.reshape(-1, 4)[:-1, 3] = resting
    batched.volume(p)
    scalar.volume(start, resting)
    assert np.abs(batched.muscle.points(p) - start).max() < AGREEMENT


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_the_volume_is_right_where_surfaces_touch_or_are_not_closed(offset, rng):
    """Two tetrahedra that share a point, a lone triangle, and one turned inside out on another's edge."""
    points = rng.normal(size=(10, 3)) * 10.0 + offset
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    ids = np.array([0, 4, 5, 6])
    triangles = np.vstack([tetrahedron, ids[tetrahedron], [[7, 8, 9], [1, 0, 7]]])
    batched, scalar = both(points, triangles, np.ones(10))
    start = points + rng.normal(size=points.shape)
    p = batched.muscle.records(start)
    assert batched.volume(p) == pytest.approx(scalar.volume(start), rel=1e-9)
    assert np.abs(batched.muscle.points(p) - start).max() < 1e-9


def test_a_vertex_with_300_neighbours_agrees_with_the_scalar_projections(rng):
    turn = np.arange(300) * 2 * np.pi / 300
    rim = 50.0 * np.column_stack([np.cos(turn), np.sin(turn), 0.05 * rng.normal(size=300)])
    points = np.vstack([rim, [[0, 0, 20], [0, 0, -20]]])
    i, j = np.arange(300), np.roll(np.arange(300), -1)
    triangles = np.vstack(
        [np.column_stack([i, j, np.full(300, 300)]), np.column_stack([j, i, np.full(300, 301)])]
    )
    batched, scalar = both(points, triangles, np.ones(302))
    start = points + 0.1 * rng.normal(size=points.shape)
    p = batched.muscle.records(start)
    batched.run(p, 1)
    scalar.edges(start)
    scalar.volume(start)
    assert np.abs(batched.muscle.points(p) - start).max() < 1e-11


def test_degenerate_shapes_stay_finite(rough):
    points, triangles, mass = rough
    batched, _ = both(points, triangles, mass)
    folded = points.copy()
    folded[20:60] = folded[20]  # zero edges, zero areas, collinear and folded pairs
    folded[60:80, 2] = 0.0
    folded[80] = folded[81] + 1e-9
    p = batched.muscle.records(folded)
    batched.run(p, 50)
    assert np.isfinite(p).all()


def test_a_degenerate_rest_shape_keeps_lengths_only_where_no_angle_is_defined(rough):
    points, triangles, mass = (array.copy() for array in rough)
    points[30] = points[31]
    batched, scalar = both(points, triangles, mass)
    start = points + 0.1 * np.sin(np.arange(points.size)).reshape(-1, 3)
    p = batched.muscle.records(start)
    batched.edges(p)
    scalar.edges(start)
    assert np.abs(batched.muscle.points(p) - start).max() < AGREEMENT


def test_fixed_points_do_not_move(rough, rng):
    points, triangles, mass = rough
    batched, _ = both(points, triangles, mass)
    start = points + rng.normal(size=points.shape)
    p = batched.muscle.records(start)
    batched.run(p, 5)
    np.testing.assert_array_equal(batched.muscle.points(p)[mass == 0], start[mass == 0])


def test_the_rest_shape_does_not_move(rough):
    points, triangles, mass = rough
    batched, _ = both(points, triangles, mass)
    p = batched.muscle.records(points)
    batched.run(p, 5)
    assert np.abs(batched.muscle.points(p) - points).max() < AGREEMENT


def test_all_points_may_be_fixed_and_none(rough):
    points, triangles, mass = rough
    for value in (0.0, 1.0):
        batched, _ = both(points, triangles, np.full_like(mass, value))
        p = batched.muscle.records(1.2 * points)
        batched.run(p, 3)
        assert np.isfinite(p).all()
        moved = np.abs(batched.muscle.points(p) - 1.2 * points).max()
        assert moved == 0.0 if value == 0.0 else moved > 0.1


def test_single_precision_agrees_to_its_digits(rough, rng):
    points, triangles, mass = rough
    topology = mesh_topology(len(points), triangles)
    start = points + rng.normal(size=points.shape) * mass[:, None]
    results = []
    for dtype in ("float64", "float32"):
        batched = BatchedIteration(pack(topology, points, mass, dtype=dtype))
        p = batched.muscle.records(start)
        assert p.dtype == dtype
        batched.run(p, 10)
        results.append(batched.muscle.points(p))
    assert 0.0 < np.abs(results[0] - results[1]).max() < 1e-3


def test_free_points_alone_make_the_same_iteration(rough, rng):
    points, triangles, mass = rough
    batched, _ = both(points, triangles, mass)
    start = points + rng.normal(size=points.shape)
    p = batched.muscle.records(start)
    batched.run(p, 1)
    step = FreePoints(batched, start)
    np.testing.assert_array_equal(step.positions(step(step.first)), batched.muscle.points(p))


def test_the_polynomial_is_the_arctangent_to_the_last_digits():
    t = np.linspace(-1.0, 1.0, 20_001)
    assert np.abs(t * np.polynomial.polynomial.polyval(t * t, ARCTANGENT) - np.arctan(t)).max() < 1e-15


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 assembly")
def test_the_loops_over_lanes_are_vector_instructions(rough):
    batched, _ = both(*rough)
    muscle = batched.muscle
    p, buffer = muscle.records(rough[0]), np.zeros(10_000)

    def assembly(function, *arguments):
        compiled = numba.njit(nogil=True, error_model="numpy", fastmath={"contract"})(function.py_func)
        compiled(*arguments)
        return next(iter(compiled.inspect_asm().values()))

    edges = assembly(sweep_edges, p, muscle.edge_at, muscle.constants, 0, 1, buffer)
    assert "sqrtpd" in edges
    assert "divpd" in edges
    assert "sqrtsd" not in edges
    volume = assembly(
        batched_volume.volume_gradient,
        *(p, muscle.vertex_at, muscle.ring_starts, muscle.ring_at, 0, 1, p.copy(), buffer),
    )
    assert "mulpd" in volume

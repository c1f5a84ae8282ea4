import numpy as np
from spindle import spindle

from vtkmuscle.core.mesh.surface import mesh_topology, unique_edges


def test_closed_surface_has_one_quadruple_per_edge():
    points, triangles, _ = spindle()
    topology = mesh_topology(len(points), triangles)
    assert np.array_equal(topology.edges, unique_edges(triangles))
    assert len(topology.edges) == 3 * len(triangles) // 2
    assert np.array_equal(np.sort(topology.quads[:, :2]), topology.edges)
    assert topology.n_boundary_edges == 0


def test_quadruples_run_with_their_first_triangle_and_against_their_second():
    points, triangles, _ = spindle()
    p1, p2, p3, p4 = mesh_topology(len(points), triangles).quads.T
    directed = {(a, b, c) for t in triangles for a, b, c in (np.roll(t, k) for k in range(3))}
    assert all(quad in directed for quad in zip(p1, p2, p3, strict=True))
    assert all(quad in directed for quad in zip(p2, p1, p4, strict=True))


def test_edge_triangles_contain_the_edge():
    points, triangles, _ = spindle()
    topology = mesh_topology(len(points), triangles)
    for side in range(2):
        beside = triangles[topology.edge_triangles[:, side]]
        assert (beside[:, :, None] == topology.edges[:, None, :]).any(axis=1).all()
    assert (topology.edge_triangles[:, 0] != topology.edge_triangles[:, 1]).all()


def test_boundary_and_crowded_edges_have_no_quadruple():
    square = np.array([[0, 1, 2], [0, 2, 3]])
    topology = mesh_topology(4, square)
    assert topology.n_boundary_edges == 4
    assert topology.quads.tolist() == [[2, 0, 1, 3]]
    book = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert mesh_topology(5, book).quads.shape == (0, 4)


def test_triangles_with_a_repeated_point_take_no_part():
    topology = mesh_topology(4, np.array([[0, 1, 2], [2, 2, 3], [0, 2, 3]]))
    assert (topology.edges[:, 0] < topology.edges[:, 1]).all()
    assert len(topology.quads) == 1

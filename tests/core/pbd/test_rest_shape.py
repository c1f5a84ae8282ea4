"""What is reported of a deformed surface."""

import numpy as np
import pytest
from constraint_oracles import dihedral_angle
from spindle import spindle

from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.pbd.rest_shape import RestShape, dihedral_angles


def test_angles_one_by_one_are_those_of_arrays(rng):
    points, triangles, _ = spindle(seed=3)
    points += rng.normal(scale=5.0, size=points.shape)
    points[7] = points[8]  # triangles that have collapsed
    quads = mesh_topology(len(points), triangles).quads
    expected, defined = dihedral_angle(*(points[quads[:, i]] for i in range(4)))
    angles, ours = dihedral_angles(points, quads)
    assert not defined.all()
    np.testing.assert_array_equal(ours, defined)
    np.testing.assert_allclose(angles, expected, rtol=0.0, atol=1e-12)


def test_report_of_a_stretched_surface_is_known():
    points, triangles, _ = spindle()
    shape = RestShape(points, mesh_topology(len(points), triangles))
    report = shape.compare(1.5 * points)
    assert report.volume_ratio == pytest.approx(1.5**3)
    assert report.edge_stretch_p50 == pytest.approx(1.5)
    assert report.edge_stretch_max == pytest.approx(1.5)
    assert report.dihedral_error_p95 == pytest.approx(0.0, abs=1e-6)
    assert report.degenerate_edges == 0


def test_edges_along_and_across_the_fibres_are_told_apart():
    points, triangles, _ = spindle(seed=1)
    topology = mesh_topology(len(points), triangles)
    shape = RestShape(points, topology)
    along_z = np.tile([0.0, 0.0, -1.0], (len(topology.edges), 1))
    report = shape.compare(points * [1.1, 1.1, 0.7], along_z)
    # l / l0 of an edge at the angle a to z is sqrt(0.7^2 cos^2 a + 1.1^2 sin^2 a).
    edges = points[topology.edges[:, 1]] - points[topology.edges[:, 0]]
    angles = np.degrees(np.arccos(np.abs(edges[:, 2]) / np.linalg.norm(edges, axis=1)))
    ratio = np.sqrt((0.7 * np.cos(np.radians(angles))) ** 2 + (1.1 * np.sin(np.radians(angles))) ** 2)
    for spread, chosen in ((report.along, angles < 18.0), (report.across, angles > 72.0)):
        assert 10 < chosen.sum() < len(edges)
        assert spread == pytest.approx(np.percentile(ratio[chosen], [5, 50, 95]))
    assert report.along[1] < 0.75
    assert report.across[1] > 1.05


def test_edges_without_a_direction_are_neither_along_nor_across():
    points, triangles, _ = spindle(seed=1)
    topology = mesh_topology(len(points), triangles)
    shape = RestShape(points, topology)
    unknown = shape.compare(points, np.zeros((len(topology.edges), 3)))
    assert unknown.along is None
    assert unknown.across is None
    assert shape.compare(points).across is None

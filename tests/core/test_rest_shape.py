"""What is reported of a deformed surface."""

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.constraints import dihedral_angle
from vtkmuscle.core.rest_shape import RestShape, dihedral_angles
from vtkmuscle.core.topology import mesh_topology


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

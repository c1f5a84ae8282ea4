"""What is reported of a deformed surface."""

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.mesh.rest_shape import RestShape, dihedral_angles
from vtkmuscle.core.mesh.surface import mesh_topology


def test_report_of_a_stretched_surface_is_known():
    points, triangles, _ = spindle()
    shape = RestShape(points, mesh_topology(len(points), triangles))
    report = shape.compare(1.5 * points)
    assert report.volume_ratio == pytest.approx(1.5**3)
    assert report.edge_stretch_p95 == pytest.approx(1.5)
    assert report.edge_stretch_max == pytest.approx(1.5)
    assert report.dihedral_error_p95 == pytest.approx(0.0, abs=1e-6)
    assert report.degenerate_edges == 0


def test_changes_of_angles_are_those_of_the_angles(rng):
    points, triangles, _ = spindle(seed=2)
    topology = mesh_topology(len(points), triangles)
    moved = points + rng.normal(scale=2.0, size=points.shape)
    moved[7] = moved[8]  # triangles that collapse
    report = RestShape(points, topology).compare(moved)
    rest, _ = dihedral_angles(points, topology.quads)
    angles, defined = dihedral_angles(moved, topology.quads)
    turns = np.abs((angles - rest + np.pi) % (2.0 * np.pi) - np.pi)[defined]
    assert report.dihedral_error_p95 == pytest.approx(np.degrees(np.percentile(turns, 95)))
    assert report.degenerate_edges == (~defined).sum() > 0


def test_slivers_do_not_count_for_how_a_surface_is_bent(rng):
    points, triangles, _ = spindle(seed=2)
    topology = mesh_topology(len(points), triangles)
    bent = points + rng.normal(scale=0.05, size=points.shape)
    expected = RestShape(points, topology).compare(bent).dihedral_error_p95
    inner, faces = [], [tuple(one) for one in triangles]
    for number in range(0, len(triangles), 8):  # a point beside a corner: two of its triangles are slivers
        a, b, c = faces[number]
        inner.append(points[a] + 1e-7 * (points[b] + points[c] - 2.0 * points[a]))
        new = len(points) + len(inner) - 1
        faces[number] = (a, b, new)
        faces += [(b, c, new), (c, a, new)]
    slivered, faces = np.vstack([points, inner]), np.array(faces)
    moved = np.vstack(
        [bent, bent[faces[::8][: len(inner), 0]] + rng.normal(scale=1e-3, size=(len(inner), 3))]
    )
    report = RestShape(slivered, mesh_topology(len(slivered), faces)).compare(moved)
    assert report.dihedral_error_p95 == pytest.approx(expected, rel=0.2)

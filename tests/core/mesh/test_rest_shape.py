"""What is reported of a deformed surface."""

import numpy as np
import pytest
from spindle import spindle

from vtkmuscle.core.mesh.rest_shape import RestShape, dihedral_angles, volume_and_gradient
from vtkmuscle.core.mesh.surface import mesh_topology, signed_volume


def test_report_of_a_stretched_surface_is_known():
    points, triangles, _ = spindle()
    report = RestShape(points, mesh_topology(len(points), triangles)).compare(1.5 * points)
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


ANGLES = [0.0, 1e-9, -1e-9, 0.3, -0.3, 1.5, -1.5, 2.5, -2.5, 3.1, -3.1, np.pi / 2]


def bent(angle):
    """Return two triangles over an edge, a flat plane with its normal along y bent by an angle."""
    x, y = np.cos(angle / 2), -np.sin(angle / 2)
    return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [x, y, 0.7], [-1.3 * x, 1.3 * y, 1.1]])


@pytest.mark.parametrize("angle", ANGLES)
def test_the_angle_is_signed(angle):
    angles, defined = dihedral_angles(bent(angle), np.arange(4)[None])
    assert defined.all()
    assert angles[0] == pytest.approx(angle, abs=1e-12)


def test_it_is_positive_on_a_convex_body():
    points, triangles, _ = spindle()
    sphere = points / np.linalg.norm(points, axis=1, keepdims=True)
    angles, defined = dihedral_angles(sphere, mesh_topology(len(points), triangles).quads)
    assert signed_volume(sphere, triangles) > 0
    assert defined.all()
    assert (angles > -1e-9).all()
    assert angles.max() > 0.1


def test_volume_is_that_of_the_mesh_also_far_away():
    points, triangles, _ = spindle(seed=3)
    gradient = np.empty_like(points)
    near = volume_and_gradient(points, triangles, gradient)
    assert near == pytest.approx(signed_volume(points, triangles), rel=1e-13)
    far_gradient = np.empty_like(points)
    far = volume_and_gradient(points + np.array([1e6, -1e6, 1e6]), triangles, far_gradient)
    assert far == pytest.approx(near, rel=1e-10)
    assert np.allclose(far_gradient, gradient, atol=1e-7)

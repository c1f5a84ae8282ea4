import numpy as np
import pytest
from hinge_oracle import dihedral_angle
from spindle import spindle

from vtkmuscle.core.mesh.rest_shape import dihedral_angles
from vtkmuscle.core.mesh.surface import mesh_topology, signed_volume

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


def test_angles_are_those_of_vector_notation(rng):
    points, triangles, _ = spindle(seed=3)
    points += rng.normal(scale=5.0, size=points.shape)
    points[7] = points[8]  # triangles that have collapsed
    quads = mesh_topology(len(points), triangles).quads
    expected, defined = dihedral_angle(*(points[quads[:, i]] for i in range(4)))
    angles, ours = dihedral_angles(points, quads)
    assert not defined.all()
    np.testing.assert_array_equal(ours, defined)
    np.testing.assert_allclose(angles, expected, rtol=0.0, atol=1e-12)

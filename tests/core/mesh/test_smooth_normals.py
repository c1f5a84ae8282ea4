import numpy as np
import pytest
from shapes import sphere

from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.smooth_normals import smooth_normals, surface_angles
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.phantoms.meshing import box


def normals_at(points, triangles, queries):
    faces, places, _ = triangle_tree(points, triangles).nearest(queries)
    return smooth_normals(points, triangles, faces, places)


def test_on_a_ball_they_are_its_radii(rng):
    points, triangles = sphere(10.0, 1200)
    turn, z = rng.uniform(0, 2 * np.pi, 200), rng.uniform(-0.8, 0.8, 200)
    away = np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
    found = normals_at(points, triangles, 10 * away)
    assert np.degrees(np.arccos(np.abs((found * away).sum(axis=1)))).max() < 1.5


def test_on_an_edge_both_triangles_give_the_same():
    points, triangles = sphere(10.0, 60)
    ends = triangles[0, :2]
    edge = points[ends].mean(axis=0)
    beside = np.flatnonzero(np.isin(triangles, ends).sum(axis=1) == 2)
    assert len(beside) == 2
    one, two = smooth_normals(points, triangles, beside, np.tile(edge, (2, 1)))
    assert one == pytest.approx(two, abs=1e-12)
    flat = unit_vectors(triangle_normals(points, triangles[beside]))
    assert np.degrees(np.arccos(flat[0] @ flat[1])) > 5.0


def test_they_do_not_jump_as_a_hinge_folds():
    """A triangle that is turned from one beside it by more and more lets it go little by little."""
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    place, found = np.array([[1.0, 0.2, 0.0]]), []
    for fold in np.radians(np.linspace(0.0, 120.0, 1201)):
        points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 2, 0], [1, -2 * np.cos(fold), -2 * np.sin(fold)]])
        found.append(smooth_normals(points, triangles, np.array([0]), place)[0])
    jumps = np.degrees(np.arccos(np.minimum((np.array(found[1:]) * found[:-1]).sum(axis=1), 1.0)))
    assert jumps.max() < 0.2
    assert found[0] == pytest.approx([0.0, 0.0, 1.0])
    assert found[-1] == pytest.approx([0.0, 0.0, 1.0])
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert not smooth_normals(line, triangles[:1], np.array([0]), line[1:2]).any()


def test_an_angle_is_the_mean_over_the_faces_on_both_sides_of_an_edge_and_all_round_a_corner():
    points, triangles = box((0.0, 0, 0), (20.0, 10.0, 5.0), 5.0)
    places = np.array([[10.0, 5.0, 5.0], [10.0, 2.5, 5.0], [10.0, 10.0, 4.0], [20.0, 10.0, 5.0]])
    directions = unit_vectors(np.array([[1.0, 2.0, 3.0], [3.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 1.0, 3.0]]))
    faces = triangle_tree(points, triangles).nearest(places)[0]
    angles = surface_angles(points, triangles, faces, places, directions)
    normals, corners = triangle_normals(points, triangles), points[triangles]
    areas = np.linalg.norm(normals, axis=1)
    for place, direction, angle in zip(places, directions, angles, strict=True):
        sides = corners - place
        parts = np.linalg.norm(np.cross(sides, np.roll(sides, 1, axis=1)), axis=2).sum(axis=1)
        each = np.degrees(np.arcsin(np.abs(normals @ direction) / areas))
        on = parts <= areas * (1 + 1e-9)
        assert angle == pytest.approx(np.average(each[on], weights=areas[on]), abs=1e-9)

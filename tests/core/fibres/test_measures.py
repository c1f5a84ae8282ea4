import numpy as np
import pytest
from numpy.testing import assert_allclose

from vtkmuscle.core.fibres.measures import (
    angles_to,
    centroid_path,
    line_of_action,
    physiological_cross_section,
    section_areas,
)
from vtkmuscle.phantoms.meshing import box


def arc(radius, turn, n=40):
    t = np.linspace(0, turn, n)
    return radius * np.column_stack([np.cos(t), np.sin(t), 0 * t])


def test_the_centroid_path_of_parallel_arcs_is_the_middle_one():
    lines = [np.add(arc(20.0, 2.0), [0, 0, z]) for z in (-3.0, 0.0, 6.0)]
    path = centroid_path(np.vstack(lines), np.array([0, 40, 80, 120]), 40)
    assert_allclose(path, np.add(arc(20.0, 2.0), [0, 0, 1.0]), atol=0.01)


def test_angles_to_the_line_of_action():
    lines = np.array([[[0, 0, 0], [1, 0, 1]], [[0, 0, 0], [-1, 0, 1]], [[5, 0, 0], [5, 0, 7.0]]])
    offsets = np.array([0, 2, 4, 6])
    direction = line_of_action(lines.reshape(-1, 3), offsets)
    assert_allclose(direction, [0, 0, 1])
    assert_allclose(angles_to(lines.reshape(-1, 3), offsets, direction), [45, 45, 0], atol=1e-12)


def test_the_physiological_cross_section_of_a_pennate_block():
    # Fibres of length L at angle alpha in a volume V: V / L, and cos(alpha) of it along the line.
    area, along = physiological_cross_section(96000.0, np.full(7, 60.0), np.full(7, 60.0))
    assert area == pytest.approx(1600.0)
    assert along == pytest.approx(800.0)


def test_section_areas_of_a_box_whichever_way_it_faces():
    points, triangles = box((0, 0, 0), (20.0, 30.0, 50.0), 6.0)
    places = np.array([[10, 15, 17.3], [3.3, 15, 25], [10, 15, 99]])
    normals = np.array([[0, 0, 1.0], [1, 0, 0], [0, 0, 1]])
    assert_allclose(section_areas(points, triangles, places, normals), [600, 1500, 0], atol=1e-9)
    assert_allclose(section_areas(points, triangles[:, ::-1], places, -normals), [600, 1500, 0], atol=1e-9)
    slanted = np.array([[0, np.sin(0.3), np.cos(0.3)]])
    area = section_areas(points, triangles, np.array([[10, 15, 25.0]]), slanted)
    assert_allclose(area, 600 / np.cos(0.3), rtol=1e-9)

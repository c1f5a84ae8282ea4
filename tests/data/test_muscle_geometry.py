from functools import partial

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.data.muscle_geometry import RESULTS, surface_of


@pytest.fixture
def ball():
    return vtkSphereSource(radius=10.0, theta_resolution=20, phi_resolution=20).update().output


def copied(surface):
    return surface_from(points_of(surface), triangles_of(surface, ""))


def test_a_change_through_a_view_makes_another_surface_and_leaves_the_old_facts(ball):
    known = surface_of(ball, "test").geometry
    vtk_to_numpy(ball.GetPoints().GetData())[:] *= 2
    other = surface_of(ball, "test").geometry
    assert other is not known
    assert known.solids.depth([[0.0, 0, 0]])[0] == pytest.approx(10, abs=0.3)
    assert other.solids.depth([[0.0, 0, 0]])[0] == pytest.approx(20, abs=0.6)


def test_results_used_last_are_kept(ball):
    known, made = surface_of(ball, "test").geometry, []
    for last in range(1, RESULTS + 10):
        for number in (0, last):
            known.once("test", (number,), partial(made.append, number))
    known.once("test", (1,), partial(made.append, 1))
    assert made == [*range(RESULTS + 10), 1]


def test_facts_are_right(ball):
    known = surface_of(ball, "test").geometry
    points, triangles = points_of(ball), triangles_of(ball, "")
    assert known.n_open_edges == 0
    assert known.mean_edge == pytest.approx(edge_lengths(points, unique_edges(triangles)).mean(), rel=1e-12)
    assert surface_of(surface_from(points, triangles[1:]), "test").geometry.n_open_edges == 3
    more = surface_from(np.vstack([points, [0.0, 0.0, 1e5]]), triangles)  # a point of no triangle
    np.testing.assert_array_equal(surface_of(more, "test").geometry.samples(9), known.samples(9))
    triangles[0] = triangles[0, ::-1]  # forth twice along each side
    with pytest.raises(InputError, match=r"test: the surface has 6 open edge\(s\), or .* opposite sides"):
        surface_of(surface_from(points, triangles), "test").closed("")

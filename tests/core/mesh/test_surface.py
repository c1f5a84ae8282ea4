"""What a triangle mesh is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import igl

from vtkmuscle.core.mesh import surface
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.phantoms.meshing import box, solid_of_revolution

CORNERS = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


@pytest.fixture(params=[3, 18, 20])
def vase(request):
    """A closed surface without symmetry along its axis."""
    return solid_of_revolution([0.0, 3.0, 7.0, 12.0], [4.0, 6.0, 3.0, 5.0], request.param)


def test_unique_edges_agree_with_igl(vase):
    ours, theirs = surface.unique_edges(vase[1]), np.sort(np.asarray(igl.edges(vase[1])), axis=1)
    np.testing.assert_array_equal(ours, theirs[np.lexsort((theirs[:, 1], theirs[:, 0]))])


def test_stretches_are_the_singular_values_of_the_map_of_each_triangle(rng):
    """Of any linear map of a triangle's plane into space; triangles without area have none."""
    flat, maps = rng.normal(size=(50, 3, 2)), rng.normal(size=(50, 3, 2))
    rest = np.concatenate([np.dstack([flat, np.full((50, 3), 7.0)]).reshape(-1, 3), np.zeros((3, 3))])
    now = np.concatenate([(flat @ maps.transpose(0, 2, 1)).reshape(-1, 3), rng.normal(size=(3, 3))])
    triangles = np.arange(153).reshape(-1, 3)
    least, greatest, areas = surface.triangle_stretches(
        surface.side_products(rest, triangles), surface.side_products(now, triangles)
    )
    expected = np.linalg.svd(maps, compute_uv=False)
    np.testing.assert_allclose(np.column_stack([greatest, least])[:-1], expected, rtol=1e-6)
    np.testing.assert_allclose(2.0 * areas, np.linalg.norm(triangle_normals(rest, triangles), axis=1))
    assert (least[-1], greatest[-1], areas[-1]) == (1.0, 1.0, 0.0)
    lines = surface.side_products(np.linspace(0.1, 0.9, 153)[:, None] * rng.normal(size=3), triangles)
    assert np.isfinite(surface.triangle_stretches(lines, lines)).all()


@settings(max_examples=30)
@given(shift=st.tuples(*[st.floats(-1e6, 1e6)] * 3), angle=st.floats(-360, 360), scale=st.floats(1e-3, 1e3))
def test_volume_is_that_of_the_moved_surface_and_grows_with_the_cube_of_its_size(shift, angle, scale):
    points, triangles = box((0, 0, 0), (2, 3, 5), 1.0)
    moved = scale * apply_transform(rotation_about((1, 1, 1), (1, 2, 3), angle), points) + np.array(shift)
    assert surface.signed_volume(moved, triangles) == pytest.approx(30 * scale**3, rel=1e-5)


def test_vertex_normals_agree_with_igl(vase):
    points, triangles = vase
    expected = igl.per_vertex_normals(points, triangles, weighting=igl.PER_VERTEX_NORMALS_WEIGHTING_TYPE_AREA)
    np.testing.assert_allclose(vertex_normals(points, triangles), expected, atol=1e-12)


def test_survey_of_a_sound_surface(vase):
    report = surface.survey(*vase)
    assert (report.closed, report.manifold, report.oriented) == (True, True, True)
    assert (report.n_components, report.n_unused_points, report.n_degenerate_triangles) == (1, 0, 0)
    # Euler: V - E + F = 2.
    assert report.n_points - len(surface.unique_edges(vase[1])) + report.n_triangles == 2


@pytest.mark.parametrize(
    ("triangles", "facts"),
    [
        (FACES[1:], {"closed": False, "n_boundary_edges": 3, "manifold": True, "oriented": True}),
        (np.r_[FACES, [[1, 2, 4]]], {"manifold": False, "n_nonmanifold_edges": 1, "n_boundary_edges": 2}),
        (np.r_[FACES[:1, ::-1], FACES[1:]], {"closed": True, "oriented": False, "n_misoriented_edges": 3}),
        (np.vstack([FACES, [[0, 1, 5], [1, 1, 2]]]), {"n_degenerate_triangles": 2}),
    ],
    ids=["open", "a fin", "a triangle turned over", "degenerate triangles"],
)
def test_survey_of_a_tetrahedron_with_a_fault(triangles, facts):
    report = surface.survey(np.vstack([CORNERS, [[2.0, 2, 2], [0.5, 0, 0]]]), triangles)
    assert {name: getattr(report, name) for name in facts} == facts


def test_boundary_and_crowded_edges_have_no_quadruple():
    topology = surface.mesh_topology(4, np.array([[0, 1, 2], [0, 2, 3]]))
    assert topology.n_boundary_edges == 4
    assert topology.quads.tolist() == [[2, 0, 1, 3]]
    assert surface.mesh_topology(5, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])).quads.shape == (0, 4)


def test_triangles_with_a_repeated_point_take_no_part():
    topology = surface.mesh_topology(4, np.array([[0, 1, 2], [2, 2, 3], [0, 2, 3]]))
    assert (topology.edges[:, 0] < topology.edges[:, 1]).all()
    assert len(topology.quads) == 1

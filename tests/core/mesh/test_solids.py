"""Exact distances from closed surfaces, and what is inside of them."""

import numpy as np
import pytest
from oracles import igl
from shapes import box, convex, ring, sphere, union

from vtkmuscle.core.mesh.solids import closed_shells, solids_of
from vtkmuscle.core.mesh.surface import point_components, signed_volume, unique_edges
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.io import read_polydata
from vtkmuscle.phantoms.meshing import box as meshed_box


def needle():
    turn = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    base = np.column_stack([np.full(60, -25.0), 0.5 * np.cos(turn), 0.5 * np.sin(turn)])
    return convex(np.vstack([base, [[25.0, 0.0, 0.0]]]))


def ball(*, radius=10.0, centre=(0.0, 0.0, 0.0)):
    points, triangles = sphere(radius, 1200)
    return points + np.array(centre), triangles


def cube():
    return box((-10.0, -10.0, -10.0), (10.0, 10.0, 10.0))


def bar_through_itself():
    points, triangles = meshed_box((0.0, -2.0, -2.0), (72.0, 2.0, 2.0), 2.0)
    angle, radius = points[:, 0] / 10.0, 10.0 - points[:, 1]
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), points[:, 2]]), triangles


SHAPES = {"ball": ball(), "cube": cube(), "needle": needle(), "torus": ring()}


def near_points(points, triangles, *, n=2000, seed=1):
    """Return points at 1e-5 to 10 mm from faces, edges and corners."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet([1, 1, 1], n)
    weights[: n // 4] = [1, 0, 0]
    weights[n // 4 : n // 2, 2] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    on_surface = np.einsum("ij,ijk->ik", weights, points[rng.choice(triangles, n)])
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return on_surface + directions * 10 ** rng.uniform(-5, 1, (n, 1))


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_distances_agree_with_libigl(shape, inside_out):
    points, triangles = SHAPES[shape]
    positions = near_points(points, triangles)
    expected = igl.signed_distance(positions, points, triangles)[0]
    solids = solids_of(points, triangles[:, ::-1] if inside_out else triangles)
    np.testing.assert_allclose(solids.distances(positions), expected, atol=1e-9)
    distance, outward = solids.exact(positions)
    np.testing.assert_allclose(distance, expected, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(solids.distances(positions - distance[:, None] * outward), 0.0, atol=1e-8)


@pytest.mark.parametrize("shape", [*SHAPES, "bar"])
def test_points_are_inside_where_their_winding_number_says_so(shape):
    points, triangles = SHAPES.get(shape) or bar_through_itself()
    positions = near_points(points, triangles)
    solids = solids_of(points, triangles)
    depth, distance = solids.depth(positions), np.abs(solids.distances(positions))
    inside = igl.winding_number(points, triangles, positions) > 0.5
    clear = distance > 1e-6
    np.testing.assert_array_equal((depth > 0)[clear], inside[clear])
    np.testing.assert_array_equal(depth[inside & clear], distance[inside & clear])
    np.testing.assert_array_equal(solids.inside(positions), depth > 0)
    assert 0.1 < inside.mean() < 0.9


def test_points_outside_go_to_the_nearest_place_on_the_surface():
    solids = solids_of(*cube())
    inside, outside = [1.0, 2.0, 3.0], [14.0, 2.0, -3.0]
    np.testing.assert_allclose(solids.into([inside, outside]), [inside, [10.0, 2.0, -3.0]], atol=1e-12)


def test_where_shells_overlap_the_deepest_counts():
    a, b = ball(), ball(centre=(12.0, 0.0, 0.0))
    positions = np.random.default_rng(0).uniform(-12.0, 24.0, (2000, 3)) * [1, 0.6, 0.6]
    both = solids_of(*union(a, b)).depth(positions)
    each = [solids_of(*mesh).depth(positions) for mesh in (a, b)]
    np.testing.assert_allclose(both, np.maximum(*each), atol=1e-12)
    assert ((each[0] > 0) & (each[1] > 0)).sum() > 20
    assert both[np.linalg.norm(positions - [6.0, 0, 0], axis=1) < 3].min() > 0
    apart = [solids_of(*mesh).distances(positions) for mesh in (a, b)]
    np.testing.assert_allclose(solids_of(*union(a, b)).distances(positions), np.minimum(*apart), atol=1e-12)


def test_a_hollow_counts_as_bone():
    inner_points, inner = ball(radius=6.0)
    surface = solids_of(*union(ball(), (inner_points, inner[:, ::-1])))
    depth = surface.depth([[0.0, 0, 0], [8.0, 0, 0], [12.0, 0, 0]])
    assert depth[0] == pytest.approx(10.0, abs=0.1)
    assert depth[1] == pytest.approx(2.0, abs=0.1)
    assert depth[2] == 0.0


def test_triangles_with_points_of_their_own_are_joined():
    points, triangles = ball()
    loose = points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)
    positions = near_points(points, triangles)
    np.testing.assert_allclose(
        solids_of(*loose).depth(positions), solids_of(points, triangles).depth(positions), atol=1e-12
    )


def test_a_part_with_a_hole_is_closed():
    points, triangles = union(ball(), ball(centre=(50.0, 0.0, 0.0)))
    solids = solids_of(points, triangles[1:])
    assert "1 hole(s)" in solids.remarks[0]
    np.testing.assert_allclose(solids.depth([[0.0, 0, 0], [50.0, 0, 0]]), 10.0, atol=0.1)
    closed = closed_shells(points, triangles[1:])
    volumes = [signed_volume(closed.points, shell) for shell in closed.shells]
    np.testing.assert_allclose(volumes, signed_volume(*ball()), rtol=1e-9)


def test_a_part_that_encloses_nothing_has_a_distance_on_either_side():
    sheet = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    solids = solids_of(sheet, np.array([[0, 1, 2], [0, 2, 3]]))
    at = [[5.0, 5.0, 0.7], [5.0, 5.0, -0.7]]
    assert "enclose no volume" in solids.remarks[-1]
    distance, outward = solids.exact(at)
    np.testing.assert_allclose(distance, 0.7)
    np.testing.assert_allclose(outward, [[0, 0, 1], [0, 0, -1]], atol=1e-12)
    np.testing.assert_array_equal(solids.depth(at), 0.0)


@pytest.mark.parametrize("wrong", [[[np.nan, 0.0, 0.0]], [0.0, 0.0, 0.0], [[0.0, 0.0]]])
def test_points_that_are_not_finite_triples_are_refused(wrong):
    with pytest.raises(ValueError, match="finite"):
        solids_of(*cube()).depth(wrong)


def test_surfaces_without_triangles_or_with_nan_are_refused():
    points, triangles = cube()
    with pytest.raises(ValueError, match="no triangles"):
        solids_of(points, triangles[:0])
    with pytest.raises(ValueError, match="not finite"):
        solids_of(np.where(points > 9.0, np.nan, points), triangles)


@pytest.mark.slow
@pytest.mark.realdata
@pytest.mark.parametrize("bone", ["pelvis", "femur_r"])
def test_real_bones_agree_with_winding_numbers_shell_by_shell(lhdl_hip, bone):
    points, triangles = read(lhdl_hip / "bones" / f"{bone}.vtp")
    labels = point_components(len(points), unique_edges(triangles))[triangles[:, 0]]
    positions = near_points(points, triangles, n=400)
    expected = np.zeros(len(positions), dtype=bool)
    for label in np.unique(labels):
        expected |= igl.winding_number(points, triangles[labels == label], positions) > 0.5
    surface = solids_of(points, triangles)
    clear = np.abs(surface.distances(positions)) > 1e-6
    np.testing.assert_array_equal((surface.depth(positions) > 0)[clear], expected[clear])


@pytest.mark.realdata
def test_the_known_penetrations_of_the_rest_pose_are_found(lhdl_hip):
    depths, bones = {}, [solids_of(*read(lhdl_hip / f"bones/{bone}.vtp")) for bone in ("pelvis", "femur_r")]
    for muscle in ("gluteus_maximus", "gluteus_medius", "iliacus", "adductor_brevis"):
        points, _ = read(lhdl_hip / "muscles" / f"{muscle}.vtp")
        depth = np.maximum(*(bone.depth(points) for bone in bones))
        depths[muscle] = ((depth > 0).sum(), round(float(depth.max()), 2))
    assert list(depths.values()) == [(9, 0.35), (0, 0.0), (0, 0.0), (55, 2.3)]


def read(path):
    return checked_surface(read_polydata(path), str(path))


def test_a_corner_pushed_through_the_far_side_of_a_plate_leaves_the_outside_outside():
    points, triangles = meshed_box((0.0, 0.0, 0.0), (8.0, 8.0, 1.0), 1.0)
    points[(points == [4.0, 4.0, 1.0]).all(axis=1), 2] = -0.3
    below, solids = np.array([[4, 4, -0.31], [4.1, 3.9, -5], [4, 4, -200]]), solids_of(points, triangles)
    distances = [solids.distances(below), solids.exact(below)[0]]
    np.testing.assert_allclose(distances, np.linalg.norm([below - [4, 4, -0.3]] * 2, axis=2))
    assert solids.depth([[1.0, 1.0, 0.5]])[0] == pytest.approx(0.5)


def test_rays_through_points_and_along_edges_count_once():
    points, triangles = meshed_box((0.0, 0.0, 0.0), (4.0, 4.0, 4.0), 1.0)
    grid = np.stack(np.meshgrid(*[np.arange(0.5, 4.0, 0.5)] * 3), axis=-1).reshape(-1, 3)
    up, tree = np.array([0.0, 0.0, 4.0]), triangle_tree(points, triangles)
    assert tree.inside(grid).all()
    assert not tree.inside(grid + up).any()
    assert not tree.inside(grid - up).any()

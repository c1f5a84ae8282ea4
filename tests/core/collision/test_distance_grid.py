"""Distance grids against analytic distances, libigl, and themselves."""

import warnings

import igl
import numpy as np
import pytest
from shapes import ball, box, distance_to_box, ring, sphere, union

from vtkmuscle.core.collision.distance_blocks import SIDE
from vtkmuscle.core.collision.distance_grid import build_distance_grid
from vtkmuscle.core.collision.distance_lookup import signed_distance


def around(grid, rng, count=4000):
    return grid.origin + rng.random((count, 3)) * SIDE * np.array(grid.table.shape) * grid.cell


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_flat_faces_of_a_box_are_exact(rng):
    grid = build_distance_grid(*box(high=(12.0, 9.0, 7.0)), cell=0.7)
    points = np.column_stack([rng.uniform(3, 9, 500), rng.uniform(3, 6, 500), rng.uniform(6.0, 8.0, 500)])
    np.testing.assert_allclose(signed_distance(grid, points), points[:, 2] - 7.0, atol=1e-6)


def test_distances_near_a_box_are_those_of_a_box_also_at_its_edges(rng):
    low, high = (0.0, 0.0, 0.0), (12.0, 9.0, 7.0)
    grid = build_distance_grid(*box(low, high), cell=0.5)
    points = around(grid, rng)
    exact = distance_to_box(points, low, high)
    near = np.abs(exact) < grid.band - 2.0 * grid.cell
    error = np.abs(signed_distance(grid, points) - exact)[near]
    assert np.percentile(error, 95) < 0.2 * grid.cell
    assert error.max() < 0.5 * grid.cell


def test_all_of_the_inside_is_known_and_leads_out(rng):
    grid = build_distance_grid(*sphere(10.0), cell=0.5)
    points = around(grid, rng)
    radius = np.linalg.norm(points, axis=1)
    inside = radius < 9.5
    values = signed_distance(grid, points)
    np.testing.assert_allclose(values[inside], radius[inside] - 10.0, atol=0.6)
    deep = inside & (radius > 2.0)
    outward = points[deep] / radius[deep, None]
    assert (signed_distance(grid, points[deep] + 0.5 * outward) > values[deep]).all()


def test_beyond_the_band_and_the_grid_it_is_the_band(rng):
    grid = build_distance_grid(*sphere(10.0), cell=0.5, band=2.0)
    far = [[20.0, 0.0, 0.0], [0.0, 0.0, 1e9], [-12.2, 0.0, 0.0], [np.inf, 0.0, 0.0], [np.nan, 0.0, 0.0]]
    np.testing.assert_array_equal(signed_distance(grid, far), 2.0)
    points = around(grid, rng)
    exact = np.linalg.norm(points, axis=1) - 10.0
    np.testing.assert_allclose(
        signed_distance(grid, points)[exact > 0], np.minimum(exact, 2.0)[exact > 0], atol=0.4
    )


@pytest.mark.parametrize(
    "shape",
    [ball(), box(high=(9.0, 7.0, 5.0)), ring(), union(ball(), box((5.0, -2.0, -2.0), (15.0, 2.0, 2.0)))],
    ids=["ball", "box", "ring", "two shells"],
)
def test_signs_agree_with_winding_numbers(shape, rng):
    grid = build_distance_grid(*shape, cell=0.4)
    points = around(grid, rng)
    inside = igl.winding_number(*shape, points) > 0.5
    distance = np.abs(igl.point_mesh_squared_distance(points, *shape)[0]) ** 0.5
    clear = distance > 0.1 * grid.cell
    np.testing.assert_array_equal(signed_distance(grid, points)[clear] < 0, inside[clear])


def test_overlapping_shells_are_united_by_their_least_distance(rng):
    one, other = ((0.0, 0.0, 0.0), (10.0, 6.0, 6.0)), ((9.5, 1.0, 1.0), (18.0, 5.0, 5.0))
    grid = build_distance_grid(*union(box(*one), box(*other)), cell=0.5)
    points = around(grid, rng)
    exact = np.minimum(distance_to_box(points, *one), distance_to_box(points, *other))
    near = np.abs(exact) < 0.5
    error = np.abs(signed_distance(grid, points) - exact)[near]
    assert np.percentile(error, 95) < 0.2 * grid.cell
    assert error.max() < 0.5 * grid.cell


def test_a_hollow_counts_as_filled():
    outer, inner = ball(radius=10.0), ball(radius=6.0)
    hollow = union(outer, (inner[0], inner[1][:, ::-1]))
    grid = build_distance_grid(*hollow, cell=0.5)
    values = signed_distance(grid, [[0.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 8.0, 0.0], [0.0, 11.0, 0.0]])
    assert (values[:3] < -1.0).all()
    assert values[3] > 0.9


def test_inside_out_gives_the_same_and_a_warning():
    points, triangles = ball()
    expected = build_distance_grid(points, triangles, cell=0.6)
    with pytest.warns(UserWarning, match="inside out"):
        grid = build_distance_grid(points, triangles[:, ::-1], cell=0.6)
    np.testing.assert_allclose(grid.values, expected.values, atol=1e-6)


def test_triangles_that_disagree_about_their_side_are_turned():
    points, triangles = ball()
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    expected = build_distance_grid(points, triangles, cell=0.6)
    with pytest.warns(UserWarning, match="faced the other way"):
        grid = build_distance_grid(points, mixed, cell=0.6)
    np.testing.assert_allclose(grid.values, expected.values, atol=1e-6)


def test_an_open_bone_is_closed_with_a_warning(rng):
    points, triangles = box(high=(10.0, 10.0, 20.0))
    open_box = triangles[(points[triangles][:, :, 2] < 20.0).any(axis=1)]
    assert len(open_box) == len(triangles) - 2
    with pytest.warns(UserWarning, match=r"open: 1 hole\(s\), 4 edges"):
        grid = build_distance_grid(points, open_box, cell=0.8)
    queries = around(grid, rng)
    exact = distance_to_box(queries, (0, 0, 0), (10, 10, 20))
    clear = np.abs(exact) > 0.3
    np.testing.assert_array_equal(signed_distance(grid, queries)[clear] < 0, exact[clear] < 0)


def test_a_sheet_has_no_inside_but_a_distance():
    points = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    with pytest.warns(UserWarning, match="enclose no volume"):
        grid = build_distance_grid(points, np.array([[0, 1, 2], [0, 2, 3]]), cell=0.5)
    assert (grid.values > -0.2).all()
    np.testing.assert_allclose(signed_distance(grid, [[5.0, 5.0, 0.7], [5.0, 5.0, -0.7]]), 0.7, atol=0.05)


def test_triangles_with_points_of_their_own_are_joined_without_a_warning():
    points, triangles = ball()
    soup = points[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)
    grid = build_distance_grid(*soup, cell=0.6)
    np.testing.assert_allclose(
        grid.values, build_distance_grid(points, triangles, cell=0.6).values, atol=1e-6
    )


def test_degenerate_triangles_change_nothing():
    points, triangles = ball()
    more = np.vstack([triangles, [[0, 0, 1], [2, 2, 2]]])
    grid, expected = (build_distance_grid(points, t, cell=0.6) for t in (more, triangles))
    np.testing.assert_array_equal(grid.values, expected.values)


def test_the_result_does_not_depend_on_the_number_of_threads():
    shape = union(ball(), box((5.0, -2.0, -2.0), (15.0, 2.0, 2.0)))
    grids = [build_distance_grid(*shape, cell=0.25, threads=threads) for threads in (1, 2, 7)]
    for grid in grids[1:]:
        np.testing.assert_array_equal(grid.table, grids[0].table)
        np.testing.assert_array_equal(grid.values, grids[0].values)


def test_a_translation_moves_the_grid_along():
    points, triangles = ball()
    offset = np.array([300.0, -200.0, 1000.0])
    grid = build_distance_grid(points, triangles, cell=0.6)
    moved = build_distance_grid(points + offset, triangles, cell=0.6)
    np.testing.assert_allclose(moved.origin, grid.origin + offset, atol=1e-9)
    np.testing.assert_array_equal(moved.table, grid.table)
    np.testing.assert_allclose(moved.values, grid.values, atol=1e-5)


def test_a_region_holds_the_same_distances_in_less_memory(rng):
    shape = sphere(20.0)
    whole = build_distance_grid(*shape, cell=0.5)
    region = np.array([8.0, -6.0, -6.0]), np.array([24.0, 6.0, 6.0])
    part = build_distance_grid(*shape, cell=0.5, region=region)
    assert part.nbytes < 0.4 * whole.nbytes
    points = rng.uniform(*region, (4000, 3))
    near = np.abs(np.linalg.norm(points, axis=1) - 20.0) < 1.0
    np.testing.assert_allclose(
        signed_distance(part, points)[near], signed_distance(whole, points)[near], atol=1e-3
    )
    np.testing.assert_array_equal(signed_distance(part, points) < -1.0, signed_distance(whole, points) < -1.0)


@pytest.mark.parametrize(
    ("low", "high", "value"),
    [((-3, -3, -3), (3, 3, 3), -1.0), ((50, 50, 50), (60, 60, 60), 1.25)],
    ids=["inside", "far away"],
)
def test_a_region_that_meets_no_triangle_is_in_or_out(low, high, value):
    grid = build_distance_grid(*ball(radius=20.0), cell=0.5, region=(low, high))
    middle = (np.array([low, high])).mean(axis=0)
    assert np.sign(signed_distance(grid, [middle])[0]) == np.sign(value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cell": 0.0}, "cell > 0"),
        ({"cell": np.nan}, "cell > 0"),
        ({"cell": 1.0, "band": 1.0}, "band >= 2 cells"),
        ({"cell": 1.0, "region": ((1, 1, 1), (0, 2, 2))}, "region is"),
        ({"cell": 1.0, "region": ((0, 0), (2, 2))}, "region is"),
        ({"cell": 1e-4}, "too small"),
    ],
)
def test_senseless_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        build_distance_grid(*ball(), **settings)


def test_surfaces_without_triangles_or_with_nan_are_refused():
    points, triangles = ball()
    with pytest.raises(ValueError, match="no triangles"):
        build_distance_grid(points, triangles[:0], cell=1.0)
    with pytest.raises(ValueError, match="not finite"):
        build_distance_grid(np.where(points > 9.0, np.nan, points), triangles, cell=1.0)


def test_cells_larger_than_the_bone_are_finite():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        grid = build_distance_grid(*box(), cell=30.0)
    assert np.isfinite(grid.values).all()

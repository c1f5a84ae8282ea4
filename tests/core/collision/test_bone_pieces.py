"""Bones of several closed pieces, wherever these lie."""

import time
import warnings

import numpy as np
import pytest
from shapes import ball, box, distance_to_box, sphere, union

from vtkmuscle.core.collision.distance_grid import build_distance_grid
from vtkmuscle.core.collision.distance_lookup import signed_distance
from vtkmuscle.core.mesh.closed_shells import closed_shells

PLATE = (0.0, 0.0, 0.0), (20.0, 20.0, 0.6)
FAR = (100.0, 0.0, 0.0), (120.0, 20.0, 0.6)
AROUND_PLATE = (-2.0, -2.0, -2.0), (22.0, 22.0, 3.0)


def samples(rng, low, high, count=3000):
    return rng.uniform(low, high, (count, 3))


@pytest.mark.parametrize("far_first", [True, False], ids=["before", "after"])
def test_a_piece_out_of_reach_changes_nothing(rng, far_first):
    pieces = [box(*FAR), box(*PLATE)] if far_first else [box(*PLATE), box(*FAR)]
    grid = build_distance_grid(*union(*pieces), cell=1.0, region=AROUND_PLATE)
    points = samples(rng, *AROUND_PLATE)
    exact = distance_to_box(points, *PLATE)
    near = np.abs(exact) < 1.5
    np.testing.assert_allclose(signed_distance(grid, points)[near], exact[near], atol=0.5)


def test_a_region_that_reaches_no_piece_is_outside():
    grid = build_distance_grid(*union(box(*PLATE), box(*FAR)), cell=1.0, region=((50, 0, 0), (60, 9, 9)))
    assert signed_distance(grid, [[55.0, 5.0, 5.0]])[0] == grid.band


def test_nested_and_inside_out_pieces_are_one_solid(rng):
    outer, inner, hollow = ball(radius=10.0), ball(radius=3.0), ball(radius=2.0)
    shape = union(outer, (inner[0] + 4.0, inner[1]), (hollow[0] - 3.0, hollow[1][:, ::-1]))
    grid, plain = build_distance_grid(*shape, cell=0.5), build_distance_grid(*outer, cell=0.5)
    points = samples(rng, -11.0, 11.0)
    np.testing.assert_array_equal(signed_distance(grid, points) < 0, signed_distance(plain, points) < 0)


def test_overlapping_pieces_have_the_inside_of_all(rng):
    centres = rng.uniform(-8.0, 8.0, (5, 3))
    balls = [(ball(radius=4.0)[0] + centre, ball(radius=4.0)[1]) for centre in centres]
    grid = build_distance_grid(*union(*balls), cell=0.5)
    points = samples(rng, -12.0, 12.0)
    exact = np.min([np.linalg.norm(points - centre, axis=1) for centre in centres], axis=0) - 4.0
    clear = np.abs(exact) > 0.5
    np.testing.assert_array_equal(signed_distance(grid, points)[clear] < 0, exact[clear] < 0)


def test_a_piece_is_measured_the_same_beside_others_as_alone(rng):
    one, other = box(*PLATE), (sphere(6.0, 500)[0] + [40.0, 10.0, 0.0], sphere(6.0, 500)[1])
    both = build_distance_grid(*union(one, other), cell=0.7)
    points = samples(rng, (30.0, 0.0, -9.0), (50.0, 20.0, 9.0))
    exact = np.linalg.norm(points - [40.0, 10.0, 0.0], axis=1) - 6.0
    near = np.abs(exact) < 1.0
    np.testing.assert_allclose(signed_distance(both, points)[near], exact[near], atol=0.2)


def specks(rng, count, spread):
    """Return small tetrahedra, scattered."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    places = rng.uniform(-spread, spread, (count, 1, 3))
    return (corners + places).reshape(-1, 3), (faces + 4 * np.arange(count)[:, None, None]).reshape(-1, 3)


def test_a_thousand_specks_around_a_bone_take_seconds(rng):
    build_distance_grid(*union(ball(), specks(rng, 5, 20.0)), cell=1.0)  # compiled
    shape = union(sphere(100.0), specks(rng, 1000, 150.0))
    began = time.process_time()
    grid = build_distance_grid(*shape, cell=1.0)
    assert time.process_time() - began < 15.0  # 97 s where each speck costs as much as the box
    corners = shape[0][-4:]
    assert signed_distance(grid, [corners.mean(axis=0)])[0] < 0.5  # a speck is smaller than a cell


@pytest.mark.parametrize("turned", [False, True], ids=["as they are", "mixed"])
def test_thousands_of_loose_pieces_are_told_apart_in_seconds(rng, turned):
    points, triangles = specks(rng, 8000, 150.0)
    if turned:
        triangles[::4] = triangles[::4, ::-1]
    began = time.process_time()
    surface = closed_shells(points, triangles)
    assert time.process_time() - began < 8.0
    assert len(surface.shells) == 8000
    assert all(surface.solid)


def test_pieces_of_every_kind_at_once_raise_nothing(rng):
    sheet = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]]), np.array([[0, 1, 2]])
    kinds = [box(*PLATE), box(*FAR), (sheet[0] + 30.0, sheet[1]), specks(rng, 20, 60.0), ball(radius=30.0)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for region in (None, AROUND_PLATE, ((28, 28, 28), (42, 42, 32)), ((0, 0, 0), (1, 1, 1))):
            grid = build_distance_grid(*union(*kinds), cell=1.0, region=region)
            assert np.isfinite(grid.values).all()

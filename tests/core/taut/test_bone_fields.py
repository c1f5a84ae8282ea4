"""Distances from bones on grids that are filled on demand: exact at nodes, near to it between."""

import igl
import numpy as np
import pytest
from taut_phantoms import strung_phantom

from vtkmuscle.core.bones.bone import bone_axes
from vtkmuscle.core.mesh.solids import FAR, solids_of
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.taut.bone_fields import UNKNOWN, BoneFields, field_at, slope_at
from vtkmuscle.phantoms.implicit import ball
from vtkmuscle.phantoms.meshing import box, mesh_of

CELL, REACH = 2.0, 8.0


def signed_distance(at, points, triangles):
    """Return distances (n,), negative inside, by libigl."""
    inside = igl.winding_number(points, triangles, at) > 0.5
    return np.where(inside, -1.0, 1.0) * igl.point_mesh_squared_distance(at, points, triangles)[0] ** 0.5


@pytest.fixture(scope="module")
def bones():
    made = strung_phantom("wrapping_cylinder")
    return list(made.bones.values())


def fields_of(bones, cell=CELL):
    """Return the fields of bones, each (points, triangles, axes)."""
    solids = [(solids_of(points, triangles), axes) for points, triangles, axes in bones]
    return BoneFields(solids, cell=cell, reach=[REACH] * len(bones))


def looked_up(fields, bone, points):
    """Return distances (n,) and slopes (n, 3) at points (n, 3) of the scene, blocks filled as needed."""
    along = apply_transform(fields.to_axes[bone], points)
    values, slopes = np.empty(len(points)), np.empty((len(points), 3))
    for i, (x, y, z) in enumerate(along):
        while True:
            tables = fields.layout[bone], fields.table, fields.values, x, y, z
            values[i], missing = field_at(*tables)
            if missing < 0:
                missing = slope_at(*tables, slopes[i])
            if missing < 0:
                break
            fields.fill(np.array([missing]))
    return values, slopes @ fields.to_axes[bone][:3, :3]


def near(bone, rng, count, reach):
    points, triangles, _ = bone
    corners = points[triangles[rng.integers(len(triangles), size=count)]]
    return corners.mean(axis=1) + rng.uniform(-reach, reach, (count, 3)) / 3**0.5


def test_distances_agree_with_exact_ones(bones, rng):
    """Within a part of a cell at the edges and corners of a box, where the distance has kinks."""
    fields = fields_of(bones)
    for number, bone in enumerate(bones):
        points = near(bone, rng, 300, REACH)
        exact = signed_distance(points, bone[0], bone[1])
        solids = solids_of(bone[0], bone[1])
        np.testing.assert_allclose(solids.distances(points), exact, atol=1e-9)
        np.testing.assert_allclose(solids.exact(points)[0], exact, atol=1e-9)
        found, _ = looked_up(fields, number, points)
        assert np.abs(found - exact).max() < CELL / 3.0
        assert np.sqrt(np.mean((found - exact) ** 2)) < CELL / 20.0


def test_the_slope_is_the_way_out(rng):
    points, triangles = mesh_of(ball((5.0, -3.0, 2.0), 20.0), 1.5, 6000)
    fields = fields_of([(points, triangles, bone_axes(points))])
    away = rng.normal(size=(200, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    at = np.array([5.0, -3.0, 2.0]) + rng.uniform(17.0, 26.0, (200, 1)) * away
    _, slopes = looked_up(fields, 0, at)
    np.testing.assert_allclose(np.linalg.norm(slopes, axis=1), 1.0, rtol=1e-12)
    assert np.degrees(np.arccos((slopes * away).sum(axis=1).min())) < 3.0
    exact, directions = solids_of(points, triangles).exact(at)
    assert np.degrees(np.arccos((directions * away).sum(axis=1).min())) < 3.0
    np.testing.assert_allclose(exact, np.linalg.norm(at - [5.0, -3.0, 2.0], axis=1) - 20.0, atol=0.1)


def test_blocks_filled_in_any_order_have_the_same_values(bones, rng):
    points = near(bones[1], rng, 200, REACH)
    one, other = (fields_of(bones) for _ in range(2))
    forward, _ = looked_up(one, 1, points)
    backward, _ = looked_up(other, 1, points[::-1])
    np.testing.assert_array_equal(forward, backward[::-1])
    all_at_once = fields_of(bones)
    all_at_once.fill(rng.permutation(np.flatnonzero(one.table != UNKNOWN)))
    np.testing.assert_array_equal(looked_up(all_at_once, 1, points)[0], forward)


def test_neighbouring_blocks_agree_on_their_common_face(bones):
    fields = fields_of(bones[1:])
    counts = fields.layout[0, 4:7].astype(int)
    x, y, z = counts // 2
    here, beside = (np.ravel_multi_index((x, y, z + step), counts) for step in (0, 1))
    fields.fill(np.array([here, beside]))
    a, b = fields.values[fields.table[here]], fields.values[fields.table[beside]]
    np.testing.assert_allclose(a[:, :, -1], b[:, :, 0], atol=1e-9)


def test_only_blocks_that_are_asked_for_are_filled_and_each_once(bones, rng):
    fields = fields_of(bones)
    looked_up(fields, 0, near(bones[0], rng, 50, 1.0))
    filled = np.count_nonzero(fields.table != UNKNOWN)
    assert 0 < filled < 0.5 * len(fields.table)
    place = int(np.flatnonzero(fields.table != UNKNOWN)[0])
    before = fields.table[place]
    fields.fill(np.array([place, place]))
    assert fields.table[place] == before
    assert np.count_nonzero(fields.table != UNKNOWN) == filled


def test_beyond_the_grid_everything_is_far(bones):
    fields = fields_of(bones)
    distance, missing = field_at(fields.layout[0], fields.table, fields.values, 1e4, 0.0, 0.0)
    assert (distance, missing) == (FAR, -1)
    slope = np.ones(3)
    assert slope_at(fields.layout[0], fields.table, fields.values, 1e4, 0.0, 0.0, slope) == -1
    np.testing.assert_array_equal(slope, 0.0)


def test_a_bone_of_two_parts_has_the_distance_from_the_nearer_one(rng):
    first, second = box((0, 0, 0), (10, 10, 10), 5.0), box((20, 0, 0), (30, 10, 10), 5.0)
    points = np.vstack([first[0], second[0]])
    triangles = np.vstack([first[1], second[1] + len(first[0])])
    solids = solids_of(points, triangles)
    at = rng.uniform([-5, -5, -5], [35, 15, 15], (200, 3))
    nearer = np.minimum(*(signed_distance(at, *part) for part in (first, second)))
    np.testing.assert_allclose(solids.distances(at), nearer, atol=1e-9)
    np.testing.assert_allclose(solids.exact(at)[0], nearer, atol=1e-9)


def test_the_grid_goes_with_the_axes_of_the_bone(bones, rng):
    """A bone that is turned, with its axes, has the same grid: distances do not depend on where it is."""
    turn = rotation_about((3.0, 1.0, -2.0), np.array([1.0, 2.0, 2.0]) / 3.0, 37.0)
    points, triangles, axes = bones[1]
    moved = apply_transform(turn, points), triangles, axes @ np.linalg.inv(turn)
    at = near(bones[1], rng, 100, REACH)
    here, _ = looked_up(fields_of([bones[1]]), 0, at)
    there, _ = looked_up(fields_of([moved]), 0, apply_transform(turn, at))
    np.testing.assert_allclose(there, here, atol=1e-6)

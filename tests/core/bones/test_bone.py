"""One bone: its field against exact and analytic distances, and against itself."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import ball, box, distance_to_box, ring, sphere, union

from vtkmuscle.core.bones.bone import CELLS_PER_DIAGONAL, Bone, bone_of, depth_in
from vtkmuscle.core.bones.lookup import FIELD_ERROR

SHAPES = {
    "ball": ball(),
    "box": box(high=(9.0, 7.0, 5.0)),
    "ring": ring(),
    "two shells": union(ball(), box((5.0, -2.0, -2.0), (15.0, 2.0, 2.0))),
    "hollow": union(ball(), (ball(radius=6.0)[0], ball(radius=6.0)[1][:, ::-1])),
    "two apart": union(ball(radius=3.0), ball(radius=3.0, centre=(9.0, 0.0, 0.0))),
}


def around(shape, rng, count=2000, margin=4.0):
    return rng.uniform(shape[0].min(axis=0) - margin, shape[0].max(axis=0) + margin, (count, 3))


@pytest.mark.parametrize("shape", SHAPES)
def test_the_field_is_within_its_bound_of_the_exact_distance(shape, rng):
    bone = Bone(*SHAPES[shape], cell=0.7)
    points = around(SHAPES[shape], rng)
    distance, outward = bone.field(points)
    exact, away = bone.solids.exact(points)
    assert np.abs(distance - exact).max() <= FIELD_ERROR * bone.cell
    assert np.percentile(np.abs(distance - exact), 95) < 0.2 * bone.cell
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-9)
    assert np.median((outward * away).sum(axis=1)) > 0.99


@settings(max_examples=4)
@given(seed=st.integers(0, 2**32 - 1), parts=st.integers(1, 9))
def test_what_was_asked_before_changes_no_digit(seed, parts):
    rng = np.random.default_rng(seed)
    shape = SHAPES["two shells"]
    points = around(shape, rng, 300)
    distance, outward = Bone(*shape).field(points)
    bone, order = Bone(*shape), rng.permutation(len(points))
    for part in np.array_split(order, parts):
        bone.field(points[part], within=float(rng.choice([0.5, np.inf])))
    again, once_more = bone.field(points)
    np.testing.assert_array_equal(again, distance)
    np.testing.assert_array_equal(once_more, outward)


def test_threads_that_ask_one_bone_get_what_one_alone_gets(rng):
    shape = SHAPES["two shells"]
    points = around(shape, rng, 2000)
    bone, found = Bone(*shape), {}

    def ask(number):
        found[number] = [
            bone.field(part) for part in np.array_split(points[::-1] if number % 2 else points, 40)
        ]

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    alone = Bone(*shape).field(points)
    for number, parts in found.items():
        for which in range(2):
            together = np.concatenate([part[which] for part in parts])
            np.testing.assert_array_equal(together[::-1] if number % 2 else together, alone[which])


def test_the_field_of_a_ball_is_as_near_as_its_curvature_says(rng):
    """Midway between nodes it is off by cell^2 / 8 times the sum of the curvatures, 2 / R."""
    radius, cell = 20.0, 2.0
    bone = Bone(*sphere(radius, 20000), cell=cell)
    away = rng.normal(size=(3000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    heights = rng.uniform(-1.0, 3.0, 3000)
    distance, outward = bone.field((radius + heights)[:, None] * away)
    assert np.abs(distance - heights).max() < cell**2 / (4.0 * (radius - 1.0)) + 0.005  # of the facets
    assert np.degrees(np.arccos((outward * away).sum(axis=1).min())) < 3.0


def test_normals_have_no_jumps_between_cells_and_blocks():
    bone = Bone(*sphere(10.0), cell=0.5)
    angle = np.linspace(0.0, np.pi, 20_001)
    way = 10.3 * np.column_stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    distance, outward = bone.field(way)
    turns = np.linalg.norm(np.diff(outward, axis=0), axis=1)
    assert turns.max() < 10.0 * turns.mean()
    assert np.abs(np.diff(distance)).max() < np.linalg.norm(np.diff(way, axis=0), axis=1).max()


def test_the_deepest_of_moved_bones_counts(rng):
    low, high = np.array([0.0, 0, 0]), np.array([9.0, 7.0, 5.0])
    shift = np.eye(4)
    shift[:3, 3] = [4.0, 0.0, 0.0]
    points = rng.uniform(-2, 14, (2000, 3))
    bone = bone_of(*box(low, high))
    depth = depth_in([(bone, np.eye(4)), (bone, shift)], points)
    each = [-distance_to_box(points, low + by, high + by) for by in (0.0, shift[:3, 3])]
    np.testing.assert_allclose(depth, np.maximum(np.maximum(*each), 0.0), atol=1e-9)


def test_muscles_share_a_bone():
    points, triangles = ball()
    one = bone_of(points, triangles)
    assert bone_of(points.copy(), triangles.copy()) is one
    assert bone_of(points + 1.0, triangles) is not one
    named = [bone_of(points, triangles, name) for name in ("pelvis", "hip", "pelvis")]
    assert [bone.name for bone in named] == ["pelvis", "hip", "pelvis"]
    assert named[0] is named[2]
    low, high = one.box_along_axes
    assert one.cell == pytest.approx(np.linalg.norm(high - low) / CELLS_PER_DIAGONAL)


def test_each_point_has_its_own_distance_that_matters(rng):
    """Beyond it a distance is a bound, which fills less of the field; inside it may be negative."""
    shape = sphere(10.0)
    points = around(shape, rng, 300)
    known, bone, within = Bone(*shape), Bone(*shape), rng.uniform(-3.0, 3.0, 300)
    distance, outward = known.field(points)
    found, away = bone.field(points, within=within)
    near = distance <= within
    assert near.any()
    np.testing.assert_array_equal(found[near], distance[near])
    np.testing.assert_array_equal(away[near], outward[near])
    # A trilinear value is off by sqrt(3) / 2 of a cell, at most.
    assert (found <= distance + 0.87 * bone.cell).all()
    assert (found[~near] > within[~near]).all()
    assert np.count_nonzero(bone.look_up().nodes) < np.count_nonzero(known.look_up().nodes)

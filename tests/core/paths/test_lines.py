"""Points spread along fibres, and lines that stand in for fibres."""

from itertools import pairwise

import numpy as np
import pytest
from phantom_paths import strung_phantom

from vtkmuscle.core.mesh.polylines import evenly_spread
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.paths.lines import STAND_INS, bones_at_ends, lines_on_surface


def spread(line, count):
    return evenly_spread(np.asarray(line, dtype=float), np.array([0, len(line)]), count)[0]


def test_points_are_evenly_spread_between_the_ends(rng):
    line = np.cumsum(rng.uniform(0.2, 2.0, (12, 3)), axis=0)
    points = spread(line, 40)
    np.testing.assert_array_equal(points[[0, -1]], line[[0, -1]])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(steps) < 0.02 * steps.mean()


def test_a_straight_line_stays_straight():
    line = np.outer([0.0, 0.1, 0.5, 2.0, 3.0], [1.0, 2.0, 2.0])
    np.testing.assert_allclose(
        spread(line, 7), np.outer(np.linspace(0.0, 3.0, 7), [1.0, 2.0, 2.0]), atol=1e-12
    )
    np.testing.assert_allclose(
        spread(line[[0, -1]], 4), np.outer(np.arange(4.0), [1.0, 2.0, 2.0]), atol=1e-12
    )


def test_the_curve_is_on_the_circle_where_chords_are_not():
    turn = np.linspace(0.0, 2.0, 16)
    line = 30.0 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    off = np.linalg.norm(spread(line, 65), axis=1) - 30.0
    sagitta = 30.0 * (1.0 - np.cos(turn[1] / 2.0))
    assert np.abs(off).max() < 0.1 * sagitta


def test_points_that_repeat_count_once():
    line = np.array([[0.0, 0, 0], [0.0, 0, 0], [1.0, 1, 0], [1.0, 1, 0], [3.0, 0, 0]])
    np.testing.assert_array_equal(spread(line, 9), spread(line[[0, 2, 4]], 9))
    np.testing.assert_array_equal(spread(np.zeros((3, 3)), 4), np.zeros((4, 3)))


def test_a_line_of_fewer_points_than_others_is_as_if_alone(rng):
    lines = [np.cumsum(rng.uniform(0.2, 2.0, (count, 3)), axis=0) for count in (6, 1, 4, 2, 3)]
    offsets = np.cumsum([0, *map(len, lines)])
    memory = [np.full((5, 6, 3), np.nan) for _ in range(20)]  # what is not written would be this
    del memory
    for line, spread_line in zip(lines, evenly_spread(np.vstack(lines), offsets, 9), strict=True):
        np.testing.assert_allclose(spread_line, spread(line, 9), atol=1e-12)


def test_ends_are_on_the_bones_they_are_nearest_to():
    made = strung_phantom("strap_over_two_joints")
    start, end = bones_at_ends(made.fibres, made.points, made.fixed_to)
    assert {made.names[bone] for bone in start} == {"proximal"}
    assert {made.names[bone] for bone in end} == {"distal"}
    start, end = bones_at_ends(made.fibres[:, ::-1], made.points, made.fixed_to)
    assert {made.names[bone] for bone in start} == {"distal"}


@pytest.fixture(scope="module")
def strap():
    made = strung_phantom("lifting_strap")
    return made, mesh_topology(len(made.points), made.triangles)


def test_stand_ins_lead_over_the_surface_from_bone_to_bone(strap):
    made, topology = strap
    points, offsets = lines_on_surface(made.points, topology, made.fixed_to)
    assert 0.5 * STAND_INS <= len(offsets) - 1 <= 1.5 * STAND_INS
    start, end = points[offsets[:-1]], points[offsets[1:] - 1]
    fixed = {tuple(p): bone for p, bone in zip(made.points, made.fixed_to, strict=True) if bone >= 0}
    assert {fixed[tuple(p)] for p in start} == {0}
    assert {fixed[tuple(p)] for p in end} == {1}
    lengths = [np.linalg.norm(np.diff(points[a:b], axis=0), axis=1).sum() for a, b in pairwise(offsets)]
    # From the rim of one attachment to that of the other: the strap's ends are attached by their faces.
    assert np.median(lengths) == pytest.approx(made.phantom.known["length"](0.0), rel=0.08)


def test_stand_ins_move_with_the_muscle(strap):
    made, topology = strap
    points, offsets = lines_on_surface(made.points, topology, made.fixed_to)
    turn = rotation_about((10.0, -20.0, 5.0), np.array([2.0, -1.0, 2.0]) / 3.0, 70.0)
    moved, same = lines_on_surface(apply_transform(turn, made.points), topology, made.fixed_to)
    np.testing.assert_array_equal(same, offsets)
    np.testing.assert_allclose(moved, apply_transform(turn, points), atol=1e-9)


def test_a_muscle_on_one_bone_has_no_stand_ins(strap):
    made, topology = strap
    assert lines_on_surface(made.points, topology, np.minimum(made.fixed_to, 0)) is None
    assert lines_on_surface(made.points, topology, np.full(len(made.points), -1)) is None

"""Tissue that the scene does not have holds a muscle's bow: a cord like a hamstring, behind its bone."""

from functools import cache

import numpy as np
import pytest
from shapes import box
from taut_phantoms import fibres_along

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.taut.bedding import bedding_of
from vtkmuscle.core.paths.bundles import bundle_of
from vtkmuscle.core.taut.paths import TautPaths
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.straps import cord

#: Radius of the cord, by how much it bows behind the chord of its ends, and half of that chord [mm].
RADIUS, BOW, HALF = 8.0, 30.0, 150.0
#: The thigh's bone: the middle of its front is this far before the chord [mm].
BEFORE = 25.0


def course(bow=BOW):
    """Return points (y, z) of an arc behind y = 0, downward."""
    z = np.linspace(HALF, -HALF, 61)
    return np.column_stack([-bow * (1.0 - (z / HALF) ** 2), z])


@cache
def bowed(bow=BOW):
    """Return strings in a cord from the block 0 to the block 1, behind the bone 2 in the middle of it."""
    points, triangles = mesh_of(cord(course(bow), np.full(9, RADIUS)), 2.0, 1500)
    fibres = fibres_along(course(bow), (-4.0, 0.0, 4.0), (-4.0, 0.0, 4.0))
    low = [(-10.0, -10.0, HALF), (-10.0, -10.0, -HALF - 20.0), (-8.0, BEFORE, -HALF + 30.0)]
    high = [(10.0, 10.0, HALF + 20.0), (10.0, 10.0, -HALF), (8.0, BEFORE + 16.0, HALF - 30.0)]
    bones = {k: (*box(*corners), np.eye(4)) for k, corners in enumerate(zip(low, high, strict=True))}
    ends = np.zeros(len(fibres), dtype=int), np.ones(len(fibres), dtype=int)
    return TautPaths(fibres, *ends, points, triangles, bones)


def pose(angle):
    """Return where the bones are when the lower block is turned backward about the chord's lower third."""
    turn = hinge("b", centre=(0.0, 0.0, -100.0), axis=(1.0, 0.0, 0.0), angles=[angle]).transforms["b"][0]
    return np.array([np.eye(4), turn, np.eye(4)])


def test_a_bow_that_no_bone_makes_stays_at_rest():
    paths = bowed()
    behind = -paths.rest.points[:, 16, 1].mean()
    assert behind == pytest.approx(BOW, abs=0.1 * BOW)
    assert paths.rest.unsettled == 0


def test_a_bow_within_the_muscles_thickness_is_pulled_straight():
    assert -bowed(2.0).rest.points[:, 16, 1].mean() < 0.5


def test_the_moment_arm_at_rest_is_that_of_the_course_not_of_the_chord():
    """The axis is on the chord: a straight string has no lever about it. What gives takes some of it."""
    paths = bowed()
    lengths = [paths.follow(paths.rest, pose(angle)).lengths.mean() for angle in (-2.0, 2.0)]
    arm = (lengths[0] - lengths[1]) / np.radians(4.0)
    behind = np.interp(-100.0, course()[::-1, 1], -course()[::-1, 0])
    assert 0.6 * behind < abs(arm) < behind


def test_tension_is_even_along_a_string_that_tissue_holds():
    paths = bowed()
    state = paths.follow(paths.rest, pose(40.0))
    steps = np.linalg.norm(np.diff(state.points, axis=1), axis=2)
    assert (steps / steps.mean(axis=1, keepdims=True)).std() < 0.02


def test_bones_that_move_together_take_strings_along():
    paths = bowed()
    turn = pose(30.0)[1]
    state = paths.follow(paths.rest, np.array([turn] * 3))
    expected = paths.rest.points @ turn[:3, :3].T + turn[:3, 3]
    np.testing.assert_allclose(state.points, expected, atol=1e-9)


def test_tissue_moves_with_the_nearest_bone_and_its_shares_are_the_whole():
    fibres = fibres_along(course(), (-4.0, 0.0, 4.0), (-4.0, 0.0, 4.0))
    chords = fibres[:, :1] + np.linspace(0.0, 1.0, fibres.shape[1])[None, :, None] * (
        fibres[:, -1:] - fibres[:, :1]
    )
    bundle = bundle_of(fibres, 4.0 * RADIUS)
    # Twice as far from the second bone everywhere.
    distances = np.array([np.full(fibres.shape[:2], 10.0), np.full(fibres.shape[:2], 20.0)])
    both = bedding_of(fibres, chords, distances, bundle, RADIUS / 2.0, 2.0 * RADIUS)
    alone = bedding_of(fibres, chords, distances[:1], bundle, RADIUS / 2.0, 2.0 * RADIUS)
    np.testing.assert_allclose(both.force.sum(axis=0), alone.force[0], atol=1e-12)
    np.testing.assert_allclose(both.force[0], 4.0 * both.force[1], atol=1e-12)
    assert not both.force[:, :, [0, -1]].any()
    # It holds the muscle back, behind the chord.
    assert (both.force[0, :, 16, 1] < 0.0).all()


def test_a_string_pulled_round_another_side_does_not_move_the_course_of_the_others():
    fibres = fibres_along(course(), (-4.0, 0.0, 4.0), (-4.0, 0.0, 4.0))
    taut = fibres + np.array([0.0, BOW / 3.0, 0.0])
    bundle = bundle_of(fibres, 4.0 * RADIUS)
    distances = np.full((1, *fibres.shape[:2]), 10.0)
    alike = bedding_of(fibres, taut, distances, bundle, RADIUS / 2.0, 2.0 * RADIUS)
    taut[0] += [0.0, 300.0, 0.0]
    one_off = bedding_of(fibres, taut, distances, bundle, RADIUS / 2.0, 2.0 * RADIUS)
    np.testing.assert_allclose(one_off.course[1:], alike.course[1:], atol=0.05)

"""Directions over a whole muscle from a few fibres: where they are known, these must be what comes out."""

import numpy as np
import pytest
from bent_muscle import bent_tube, half_circle

from vtkmuscle.core.mesh.polylines import fibre_directions_at
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.morphing.superficial import (
    SeenFibres,
    angle_between,
    angle_to_nearest,
    directions_over_muscle,
    root_mean_square,
    seen_fibres,
)
from vtkmuscle.data.arrays import checked_surface, polylines_of
from vtkmuscle.phantoms import winding_spindle
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.winding_spindle import winding_fibre


def fixed_at(points, low, high):
    return np.select([points[:, 2] < low + 1e-9, points[:, 2] > high - 1e-9], [0, 1], default=-1)


def directions(points, triangles, fixed_to, lines, offsets):
    topology = mesh_topology(len(points), triangles)
    found = directions_over_muscle(
        points, topology, fixed_to, seen_fibres(lines, np.asarray(offsets), points)
    )
    return points[topology.edges].mean(axis=1), found


def off(found, truth):
    return np.degrees(angle_between(found, truth))


@pytest.mark.parametrize(("twist", "n_seen", "bound"), [(60.0, 1, 2.5), (60.0, 5, 2.5), (-150.0, 3, 6.0)])
def test_fibres_that_wind_around_a_muscle_do_so_all_over_it(twist, n_seen, bound):
    phantom = winding_spindle(twist, n_superficial=n_seen)
    points, triangles = checked_surface(phantom.muscles["spindle"], "spindle")
    seen = polylines_of(phantom.superficial["spindle"], "seen")
    middles, found = directions(points, triangles, fixed_at(points, 0, 120), seen.points, seen.offsets)
    t, start = middles[:, 2] / 120, np.arctan2(middles[:, 1], middles[:, 0])
    start -= np.radians(twist) * t
    ahead, behind = (
        np.array([winding_fibre(1.0, s, twist, np.array([z + e]))[0] for s, z in zip(start, t, strict=True)])
        for e in (1e-5, -1e-5)
    )
    free = (t > 0.02) & (t < 0.98)
    errors = off(found, ahead - behind)[free]
    assert errors.max() < bound
    # What the muscle's shape alone says is farther off.
    straight = np.column_stack([np.zeros((len(t), 2)), np.ones(len(t))])
    assert np.median(off(straight, ahead - behind)[free]) > 4 * np.median(errors)


@pytest.mark.parametrize("behind", [False, True])
def test_oblique_fibres_on_a_flat_muscle_run_straight_through_it(behind):
    points, triangles = box((0, 0, 0), (60, 12, 120), 3.0)
    way = np.array([np.sin(np.radians(20)), 0, np.cos(np.radians(20))])
    starts = [(20.0, 0, 40), (20, 12, 40) if behind else (35, 0, 40)]
    lines = np.vstack([np.add(start, np.linspace(0, 30, 4)[:, None] * way) for start in starts])
    middles, found = directions(points, triangles, fixed_at(points, 0, 120), lines, [0, 4, 8])
    x, y, z = middles.T
    inner = (z > 3) & (z < 117) & (x > 1) & (x < 59)
    assert off(found, np.tile(way, (len(found), 1)))[inner & (y < 0.01)].max() < 0.1
    assert off(found, np.tile(way, (len(found), 1)))[inner & (y > 11.99)].max() < 0.1
    flank = (x < 0.01) & (y > 0.1) & (y < 11.9) & (z > 3) & (z < 117)
    assert flank.any()
    assert off(found, np.tile([0.0, 0, 1], (len(found), 1)))[flank].max() < 0.1


def test_the_deviation_from_the_course_goes_round_a_bend():
    radius, winding = 12.0, 0.8
    points, triangles, origin, insertion = bent_tube(half_circle(), radius)
    fixed_to = np.full(len(points), -1)
    fixed_to[origin], fixed_to[insertion] = 0, 1

    def at(theta, phi):
        out = np.column_stack([np.cos(theta), 0 * theta, np.sin(theta)])
        across = np.cross([0, 1.0, 0], np.column_stack([-np.sin(theta), 0 * theta, np.cos(theta)]))
        around = np.cos(phi)[:, None] * across + np.sin(phi)[:, None] * np.array([0, 1.0, 0])
        return 60 * out + radius * around

    along = np.linspace(0.3, 0.9, 7)
    lines = np.vstack([at(along, start + winding * along) for start in np.arange(4) * np.pi / 2])
    middles, found = directions(points, triangles, fixed_to, lines, np.arange(0, 29, 7))
    theta = np.arctan2(middles[:, 2], middles[:, 0])
    out = np.column_stack([np.cos(theta), 0 * theta, np.sin(theta)])
    across = np.cross([0, 1.0, 0], np.column_stack([-np.sin(theta), 0 * theta, np.cos(theta)]))
    phi = np.arctan2(middles[:, 1], ((middles - 60 * out) * across).sum(axis=1))
    truth = at(theta + 1e-5, phi + winding * 1e-5) - at(theta - 1e-5, phi - winding * 1e-5)
    beyond = (theta > 1.2) & (theta < 2.9)
    assert off(found, truth)[beyond].max() < 2.5
    # The nearest fibre is of no use there.
    assert np.median(off(fibre_directions_at(middles, lines, np.arange(0, 29, 7)), truth)[beyond]) > 20


def test_a_point_beside_a_given_fibre_has_its_direction():
    points, triangles = box((0, 0, 0), (40, 10, 100), 2.5)
    lines = np.array([[10.0, -5, 40], [14, -5, 60], [30, -1, 40], [22, -1, 60]])
    middles, found = directions(points, triangles, fixed_at(points, 0, 100), lines, [0, 2, 4])
    for a, b in (lines[:2], lines[2:]):
        flat = (b - a) * [1, 0, 1]
        near = np.linalg.norm((middles - (a + b) / 2) * [1, 0, 1], axis=1) < 1.3
        near &= middles[:, 1] < 0.1
        assert near.any()
        assert off(found, np.tile(flat, (len(found), 1)))[near].max() < 3.0


def test_a_muscle_fixed_at_one_end_takes_the_nearest_fibre():
    points, triangles = box((0, 0, 0), (20, 10, 60), 5.0)
    fixed_to = np.where(points[:, 2] < 1e-9, 0, -1)
    lines = np.array([[0.0, 0, 10], [10, 0, 30], [20, 0, 10], [10, 0, 50]])
    middles, found = directions(points, triangles, fixed_to, lines, [0, 2, 4])
    expected = fibre_directions_at(middles, lines, np.array([0, 2, 4]))
    assert np.median(off(found, expected)) < 1e-5


def test_a_rigid_motion_turns_the_directions_with_it(rng):
    phantom = winding_spindle(60.0, n_superficial=3)
    points, triangles = checked_surface(phantom.muscles["spindle"], "spindle")
    seen = polylines_of(phantom.superficial["spindle"], "seen")
    fixed_to = fixed_at(points, 0, 120)
    _, found = directions(points, triangles, fixed_to, seen.points, seen.offsets)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    _, moved = directions(
        points @ turn.T + 300.0, triangles, fixed_to, seen.points @ turn.T + 300.0, seen.offsets
    )
    assert np.abs(moved - found @ turn.T).max() < 1e-6


def test_pieces_share_out_their_fibres():
    lines = np.array([[0.0, 0, 0], [0, 0, 10], [5, 0, 0], [5, 0, 0], [5, 3, 0]])
    seen = seen_fibres(lines, np.array([0, 2, 5]), np.array([[0.0, 0, -50], [0, 0, 50]]))
    assert seen.weights.sum() == pytest.approx(13.0)
    assert seen.weights.max() <= 2.0
    assert np.allclose(np.abs(seen.directions @ [0, 0, 1]).round(12) @ seen.weights, 10.0)
    assert np.allclose(seen.places[:5], [[0, 0, z] for z in (1, 3, 5, 7, 9)])
    with pytest.raises(ValueError, match="no fibre has a length"):
        seen_fibres(lines[2:4], np.array([0, 2]), lines)


def test_angles_have_no_sign():
    a = np.array([[1.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 0, 0]])
    b = np.array([[-3.0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]])
    assert np.allclose(np.degrees(angle_between(a, b)), [0, 90, 45, 90])
    assert root_mean_square(np.array([1.0, 3.0]), np.array([3.0, 1.0])) == pytest.approx(np.sqrt(3.0))


def test_the_angle_to_others_is_that_to_the_nearest_of_them():
    seen = SeenFibres(np.array([[0.0, 0, 0], [10, 0, 0]]), np.eye(3)[[0, 0]], np.ones(2))
    others = np.array([[-1.0, 0, 1], [1, 0, 1], [9, -1, 0], [11, 1, 0]])
    angle = angle_to_nearest(seen, others, np.array([0, 2, 4]))
    assert np.degrees(angle) == pytest.approx(np.sqrt(45**2 / 2))

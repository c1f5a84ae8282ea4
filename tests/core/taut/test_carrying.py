"""A muscle carried by its strings: at rest it is where it is, and it goes with bones, fibres and stretch."""

from dataclasses import replace

import numpy as np
import pytest
from taut_phantoms import known_paths, paths_of, strung_phantom, swept

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.mesh.topology import mesh_topology
from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.taut.carrying import GREATEST_STRETCH, THINNING, Carrier
from vtkmuscle.core.taut.lines import bones_at_ends, evenly_spread, lines_on_surface
from vtkmuscle.core.taut.paths import POINTS

TURN = rotation_about((10.0, -20.0, 30.0), np.array([1.0, 2.0, 2.0]) / 3.0, 65.0)


def carrier_of(make, paths):
    made = strung_phantom(make)
    return Carrier(paths, made.points, made.fixed_to)


def flexed(make, bone, *angles):
    motion = hinge(bone, centre=(0, 0, 0), axis=(-1, 0, 0), angles=[0.0, *angles])
    return strung_phantom(make).poses(motion)[1:]


@pytest.mark.parametrize(
    "make", ["wrapping_cylinder", "lifting_strap", "spindle_over_ball", "tendon_through_ring"]
)
def test_at_rest_nothing_moves(make):
    """Not by rounding, though strings are pulled taut at rest and leave their fibres by millimetres."""
    paths, made = paths_of(make), strung_phantom(make)
    assert np.abs(paths.rest.points - made.fibres).max() > 0.5
    carrier = carrier_of(make, paths)
    carried = carrier.at(paths.follow(paths.rest, paths.rest.transforms))
    np.testing.assert_allclose(carried.surface, made.points, rtol=0.0, atol=1e-9)
    lines, offsets = made.fibres.reshape(-1, 3), made.fibres.shape[1] * np.arange(len(made.fibres) + 1)
    passengers = carrier.fibres(lines, offsets)
    np.testing.assert_allclose(carried.points(passengers), lines, rtol=0.0, atol=1e-9)


def test_strings_all_in_one_place_do_not_turn_the_muscle():
    """Stand-ins of fibres often end at the same points: taut they lie in each other, and tell of no turn."""
    made = strung_phantom("spindle_over_ball")
    topology = mesh_topology(len(made.points), made.triangles)
    fibres = evenly_spread(*lines_on_surface(made.points, topology, made.fixed_to), POINTS)
    start, end = bones_at_ends(fibres, made.points, made.fixed_to)
    paths = made.pulled(fibres=fibres, start_bones=start, end_bones=end)
    carrier = carrier_of("spindle_over_ball", paths)
    assert len(np.unique(paths.rest.points[:, 16].round(6), axis=0)) < len(fibres) / 4
    np.testing.assert_allclose(carrier.at(paths.rest).surface, made.points, rtol=0.0, atol=1e-9)
    for state in swept(paths, flexed("spindle_over_ball", "distal", 20.0, 40.0, 60.0)):
        carried = carrier.at(state).surface
        volume = signed_volume(carried, made.triangles) / signed_volume(made.points, made.triangles)
        assert 0.5 < volume < 1.5


@pytest.mark.parametrize("make", ["lifting_strap", "strap_over_two_joints"])
def test_a_muscle_goes_rigidly_with_bones_that_move_together(make):
    paths, made = paths_of(make), strung_phantom(make)
    together = np.array([TURN] * len(paths.rest.transforms))
    carried = carrier_of(make, paths).at(paths.follow(paths.rest, together))
    np.testing.assert_allclose(carried.surface, apply_transform(TURN, made.points), atol=1e-9)


def test_it_does_not_matter_from_where_a_pose_is_seen():
    """Everything moved rigidly in a pose gives the carried surface, moved."""
    paths = paths_of("lifting_strap")
    carrier = carrier_of("lifting_strap", paths)
    (pose,) = flexed("lifting_strap", "distal", 40.0)
    here = paths.follow(paths.rest, pose)
    there = paths.follow(here, TURN @ pose)
    expected = apply_transform(TURN, carrier.at(here).surface)
    np.testing.assert_allclose(carrier.at(there).surface, expected, atol=1e-9)


def test_fixed_points_stay_with_their_bones():
    made, paths = strung_phantom("lifting_strap"), paths_of("lifting_strap")
    poses = flexed("lifting_strap", "distal", 20.0, 40.0, 60.0)
    state = swept(paths, poses)[-1]
    carried = carrier_of("lifting_strap", paths).at(state)
    for bone in (0, 1):
        fixed = made.fixed_to == bone
        expected = apply_transform(poses[-1][bone], made.points[fixed])
        np.testing.assert_allclose(carried.surface[fixed], expected, atol=1e-9)


def test_a_straight_muscle_that_is_drawn_out_is_longer_and_thinner():
    """By l along and l^(-p / 2) across, p the part of the thinning that is the carrier's."""
    paths, made = known_paths("spindle_over_ball"), strung_phantom("spindle_over_ball")
    away = np.array(paths.rest.transforms)
    away[1][2, 3] = -28.0
    state = paths.follow(paths.rest, away)
    stretch = 168.0 / 140.0
    np.testing.assert_allclose(state.lengths / paths.rest.lengths, stretch, rtol=1e-9)
    carried = carrier_of("spindle_over_ball", paths).at(state).surface
    middle = np.abs(made.points[:, 2] - 10.0) < 25.0
    centre = np.array([12.0, -32.0])
    across = np.linalg.norm(carried[middle, :2] - centre, axis=1)
    rest = np.linalg.norm(made.points[middle, :2] - centre, axis=1)
    np.testing.assert_allclose(across / rest, stretch ** (-0.5 * THINNING), rtol=0.01)
    along = np.polyfit(made.points[middle, 2], carried[middle, 2], 1)[0]
    assert along == pytest.approx(stretch, rel=0.01)
    volume = signed_volume(carried, made.triangles) / signed_volume(made.points, made.triangles)
    assert volume == pytest.approx(stretch ** (1.0 - THINNING), rel=0.05)


def test_the_stretch_has_bounds():
    paths, made = known_paths("spindle_over_ball"), strung_phantom("spindle_over_ball")
    away = np.array(paths.rest.transforms)
    away[1][2, 3] = -140.0 * 9.0
    carried = carrier_of("spindle_over_ball", paths).at(paths.follow(paths.rest, away)).surface
    assert np.isfinite(carried).all()
    middle = np.abs(made.points[:, 2] - 10.0) < 5.0
    across = np.linalg.norm(carried[middle, :2] - [12.0, -32.0], axis=1)
    rest = np.linalg.norm(made.points[middle, :2] - [12.0, -32.0], axis=1)
    np.testing.assert_allclose(across / rest, GREATEST_STRETCH ** (-0.5 * THINNING), rtol=0.02)


def test_a_wound_strap_keeps_its_distance_from_the_cylinder():
    """Its surface goes round as its fibres do: no point of the free part comes nearer than 1 mm too much."""
    made, paths = strung_phantom("wrapping_cylinder"), paths_of("wrapping_cylinder")
    carrier = carrier_of("wrapping_cylinder", paths)
    for state in swept(paths, flexed("wrapping_cylinder", "pulley", 20.0, 40.0, 60.0, 80.0)):
        carried = carrier.at(state).surface
        radius = np.linalg.norm(carried[made.fixed_to < 0, 1:], axis=1)
        assert radius.min() > 24.0


def test_points_of_fibres_go_with_their_strings():
    made, paths = strung_phantom("lifting_strap"), known_paths("lifting_strap")
    carrier = carrier_of("lifting_strap", paths)
    # Every second point, as of fibres that have fewer than strings have.
    lines = paths.fibres[:, ::2]
    count, n = lines.shape[1], paths.fibres.shape[1]
    passengers = carrier.fibres(lines.reshape(-1, 3), count * np.arange(len(lines) + 1))
    np.testing.assert_allclose(passengers.shares.sum(axis=1), 1.0, rtol=1e-12)
    assert (passengers.carriers // n == np.repeat(np.arange(len(lines)), count)[:, None]).all()
    state = swept(paths, flexed("lifting_strap", "distal", 20.0, 40.0, 60.0))[-1]
    moved = carrier.at(state).points(passengers).reshape(lines.shape)
    for end, bones in ((0, paths.start_bones), (-1, paths.end_bones)):
        turns = state.transforms[bones]
        at_bone = np.einsum("fij,fj->fi", turns[:, :3, :3], lines[:, end]) + turns[:, :3, 3]
        np.testing.assert_allclose(moved[:, end], at_bone, rtol=0.0, atol=1e-9)
    lengths = np.linalg.norm(np.diff(moved, axis=1), axis=2).sum(axis=1)
    # Each keeps its place among those beside it, whose lengths differ: the mean counts.
    expected = np.mean([made.phantom.known["length"](60.0, depth) for depth in (-3.0, 0.0, 3.0)])
    assert lengths.mean() == pytest.approx(expected, rel=0.01)


def test_a_string_that_strays_does_not_take_the_surface_along():
    """It is one of 25; where it goes 40 mm aside, the surface moves by less than the muscle is thick."""
    made, paths = strung_phantom("lifting_strap"), paths_of("lifting_strap")
    carrier = carrier_of("lifting_strap", paths)
    state = paths.rest
    strayed = state.points.copy()
    part = np.sin(np.linspace(0.0, np.pi, strayed.shape[1]))[:, None]
    strayed[12] += 40.0 * part * [1.0, 0.0, 0.0]
    moved = carrier.at(replace(state, points=strayed)).surface
    assert np.linalg.norm(moved - made.points, axis=1).max() < 10.0

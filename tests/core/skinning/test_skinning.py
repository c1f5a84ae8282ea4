"""A muscle taken along by its paths: at rest it is where it is, and it goes with bones, paths and stretch."""

import numpy as np
import pytest
from phantom_paths import known_paths, off_lines, paths_of, strung_phantom, swept
from test_thin_parts import LENGTH, SECTIONS, tendon

from vtkmuscle.core.mesh.polylines import evenly_spread
from vtkmuscle.core.mesh.surface import mean_thickness, mesh_topology, signed_volume
from vtkmuscle.core.motion.rigid import apply_transform, hinge, rotation_about
from vtkmuscle.core.paths.lines import bones_at_ends, lines_on_surface
from vtkmuscle.core.paths.sheet import POINTS, MusclePaths
from vtkmuscle.core.skinning.skinning import Skinning

TURN = rotation_about((10.0, -20.0, 30.0), np.array([1.0, 2.0, 2.0]) / 3.0, 65.0)


def skinning_of(make, paths, **settings):
    made = strung_phantom(make, **settings)
    return skinned_by(paths, made.points, made.triangles, made.fixed_to)


def skinned_by(paths, points, triangles, fixed_to):
    ends = paths.start_bones, paths.end_bones
    return Skinning(paths.rest.points, ends, points, fixed_to, mean_thickness(points, triangles))


def carried(skinning, state):
    return skinning.at(state.points, state.transforms)


def flexed(make, bone, *angles, **settings):
    motion = hinge(bone, centre=(0, 0, 0), axis=(-1, 0, 0), angles=[0.0, *angles])
    return strung_phantom(make, **settings).poses(motion)[1:]


def as_lines(fibres):
    """Return the points of fibres (f, n, 3), one after the other, and the first of each."""
    return fibres.reshape(-1, 3), fibres.shape[1] * np.arange(len(fibres) + 1)


# -------------------------------------------------------------------- at rest, and all together


@pytest.mark.parametrize(
    "make", ["wrapping_cylinder", "lifting_strap", "spindle_over_ball", "tendon_through_ring"]
)
def test_at_rest_nothing_moves(make):
    """Though paths are pulled taut at rest and leave their fibres."""
    paths, made = paths_of(make), strung_phantom(make)
    assert np.abs(paths.rest.points - made.fibres).max() > 0.05
    skinning = skinning_of(make, paths)
    muscle = carried(skinning, paths.follow(paths.rest, paths.rest.transforms))
    np.testing.assert_allclose(muscle.surface, made.points, rtol=0.0, atol=1e-9)
    lines = as_lines(made.fibres)
    moved = muscle.points(skinning.weights_of_fibres(*lines))
    np.testing.assert_allclose(moved, lines[0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("make", ["lifting_strap", "strap_over_two_joints", "flexor_over_brim"])
def test_a_muscle_goes_rigidly_with_bones_that_move_together(make):
    """From rest, and from another pose."""
    paths, made = paths_of(make), strung_phantom(make)
    skinning = skinning_of(make, paths)
    together = np.array([TURN] * len(paths.rest.transforms))
    moved = carried(skinning, paths.follow(paths.rest, together))
    np.testing.assert_allclose(moved.surface, apply_transform(TURN, made.points), atol=1e-9)
    (pose,) = flexed(make, "distal", 40.0)
    here = paths.follow(paths.rest, pose)
    there = carried(skinning, paths.follow(here, TURN @ pose)).surface
    np.testing.assert_allclose(there, apply_transform(TURN, carried(skinning, here).surface), atol=1e-9)


# -------------------------------------------------------------------- fibres inside


CYLINDER, STRAP = ("wrapping_cylinder", {}, "pulley"), ("lifting_strap", {}, "distal")
BALL = "spindle_over_ball", {}, "distal"
RIDGE, GROOVE = (("flexor_over_brim", {"groove": depth}, "distal") for depth in (-5.0, 8.0))


@pytest.mark.gap("distance between a fibre and its path, strap round a cylinder", "0.49 mm", "0.2 mm")
@pytest.mark.gap("distance between a fibre and its path, flexor over a ridge", "0.44 mm", "0.2 mm")
@pytest.mark.gap("distance between a fibre and its path, flexor over a groove", "0.82 mm", "0.2 mm")
@pytest.mark.parametrize(
    ("make", "settings", "bone", "bound"),
    [(*BALL, 0.02), (*STRAP, 0.2), (*CYLINDER, 0.5), (*RIDGE, 0.5), (*GROOVE, 0.9)],
)
def test_fibres_inside_are_where_their_paths_are(make, settings, bone, bound):
    paths = known_paths(make, **settings)
    skinning = skinning_of(make, paths, **settings)
    # Every second point, as of fibres that have fewer than paths have.
    fibres = paths.fibres[:, ::2]
    weights = skinning.weights_of_fibres(*as_lines(fibres))
    for state in swept(paths, flexed(make, bone, 20.0, 40.0, 60.0, **settings)):
        moved = carried(skinning, state).points(weights).reshape(fibres.shape)
        assert off_lines(moved, state.points).max() < bound
        for end, bones in ((0, paths.start_bones), (-1, paths.end_bones)):
            turns = state.transforms[bones]
            at_bone = np.einsum("fij,fj->fi", turns[:, :3, :3], fibres[:, end]) + turns[:, :3, 3]
            np.testing.assert_allclose(moved[:, end], at_bone, rtol=0.0, atol=1e-9)


def test_a_wound_strap_keeps_its_distance_from_the_cylinder():
    """Its surface goes round as its paths do: no point of the free part comes nearer than 1 mm too much."""
    made, paths = strung_phantom("wrapping_cylinder"), paths_of("wrapping_cylinder")
    skinning = skinning_of("wrapping_cylinder", paths)
    for state in swept(paths, flexed("wrapping_cylinder", "pulley", 20.0, 40.0, 60.0, 80.0)):
        radius = np.linalg.norm(carried(skinning, state).surface[made.fixed_to < 0, 1:], axis=1)
        assert radius.min() > 24.0


# -------------------------------------------------------------------- stretch


def test_a_muscle_ten_times_as_long_is_as_much_thinner():
    """No muscle stretches so far; its surface is finite."""
    muscle = tendon("cord", "even")
    fibres = evenly_spread(*muscle.fibres, 33)
    ends = bones_at_ends(fibres, muscle.points, muscle.fixed_to)
    paths = MusclePaths(fibres, *ends, (muscle.points, muscle.triangles), {})
    pulled = np.array([np.eye(4)] * 2)
    pulled[1, 2, 3] = 9.0 * LENGTH
    skinning = skinned_by(paths, muscle.points, muscle.triangles, muscle.fixed_to)
    surface = carried(skinning, paths.follow(paths.rest, pulled)).surface
    middle = np.abs(muscle.points[:, 2] - LENGTH / 2.0) < 0.2 * LENGTH
    assert np.isfinite(surface).all()
    radius = np.hypot(*surface[middle, :2].T)
    assert radius.mean() == pytest.approx(SECTIONS["cord"][0] / np.sqrt(10.0), rel=0.05)


# -------------------------------------------------------------------- what may go wrong


def test_paths_all_in_one_place_do_not_turn_the_muscle():
    """Fibres that lie in each other tell of no turn about them."""
    made = strung_phantom("spindle_over_ball")
    topology = mesh_topology(len(made.points), made.triangles)
    lines = evenly_spread(*lines_on_surface(made.points, topology, made.fixed_to), POINTS)
    fibres = np.repeat(lines[:1], 4, axis=0)
    start, end = bones_at_ends(fibres, made.points, made.fixed_to)
    paths = made.pulled(fibres=fibres, start_bones=start, end_bones=end)
    skinning = skinning_of("spindle_over_ball", paths)
    np.testing.assert_allclose(carried(skinning, paths.rest).surface, made.points, rtol=0.0, atol=1e-9)
    for state in swept(paths, flexed("spindle_over_ball", "distal", 20.0, 40.0, 60.0)):
        moved = carried(skinning, state).surface
        volume = signed_volume(moved, made.triangles) / signed_volume(made.points, made.triangles)
        assert 0.5 < volume < 1.5

"""Sheets come to rest, in few steps: in a crease between two walls of a bone, and strongly sheared."""

import numpy as np
import phantoms
import pytest
from phantom_paths import strung, swept
from shapes import box, ring

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.motion.rigid import rotation_about
from vtkmuscle.core.paths.bone_contact import BoneContacts
from vtkmuscle.core.paths.sheet import MusclePaths
from vtkmuscle.data.arrays import field_array
from vtkmuscle.phantoms.meshing import solid_of_revolution
from vtkmuscle.run.muscles import muscle_pipeline


@pytest.mark.realdata
@pytest.mark.slow
def test_an_infraspinatus_on_the_spine_of_its_scapula_comes_to_rest(bp3d_arm):
    scene = Scene.load(bp3d_arm / "shoulder_abduction.toml")
    paths = muscle_pipeline(scene, "infraspinatus").taut_paths
    steps = []
    for time in scene.motion.times:
        frame = paths.update(time=float(time)).output
        assert not field_array(frame, "Unsettled")[0]
        steps.append(field_array(frame, "PathSteps")[0])
    # With other differences of distances where these are flat no frame comes to rest.
    assert np.median(steps) <= 12


@pytest.mark.slow
def test_a_sheet_of_a_hundred_paths_that_is_wedged_comes_to_rest():
    """Springs between the nearest paths alone leave a sheared section two shapes."""
    made = strung(phantoms.slivered_tendon(), 100)
    for state in swept(made.pulled(), made.poses()):
        assert state.settled
        assert state.steps < 100


def test_a_sheet_in_the_groove_of_a_pulley_comes_to_rest():
    """Newton's matrix does not know how the slopes meet: points swing from slope to slope."""
    heights = np.linspace(-12.0, 12.0, 13)
    pulley = Bone(*solid_of_revolution(heights, 16.0 + 1.2 * np.abs(heights), 72))
    z, x = np.random.default_rng(2).uniform(-1.0, 1.0, (16, 2)).T[..., None] * [[[3.0]], [[6.0]]]
    part = np.linspace(0.0, 1.0, 33)
    fibres = np.dstack(np.broadcast_arrays(24.0 + 0.9 * x, 130.0 * part - 60.0, (0.9 + 0.4 * part) * z))
    body = box(fibres.min((0, 1)) - 1.0, fibres.max((0, 1)) + 1.0)
    paths = MusclePaths(fibres, np.ones(16, dtype=int), np.zeros(16, dtype=int), body, {0: pulley})
    state = paths.rest
    for angle in range(10, 100, 10):
        turn = rotation_about((0.0, 0.0, 0.0), (0.1, 0.05, 1.0), -angle)
        state = paths.follow(state, np.array([np.eye(4), turn]))
        assert state.settled


@pytest.mark.parametrize(
    ("radius", "points", "step", "passes"),
    [(6.0, 17, 10, 1.0), (8.0, 17, 30, 1.0), (5.0, 33, 10, 1.0), (16.0, 33, 60, 0.0), (16.0, 33, 10, 0.0)],
)
def test_paths_that_pass_through_a_thin_bone_say_so(radius, points, step, passes):
    """A rod slips between the points of a path, at once or slowly; a thick one does not."""
    place = np.stack(np.meshgrid([-2.0, 0.0, 2.0], [-0.5, 0.5], indexing="ij"), axis=-1).reshape(-1, 1, 2)
    along = np.linspace(-200.0, 200.0, points)[None, :, None]
    fibres = np.concatenate([place + 0.0 * along, 0.0 * place[..., :1] + along], axis=2)
    body = box(fibres.min((0, 1)) - 1.0, fibres.max((0, 1)) + 1.0)
    rod = Bone(*solid_of_revolution(np.linspace(-40.0, 40.0, 9), np.full(9, radius), 48))
    lying = Bone(rod.points[:, [2, 1, 0]] + [0.0, radius + 2.0, 0.0], rod.triangles[:, ::-1])
    bones = np.zeros(6, dtype=int), np.ones(6, dtype=int)
    state = (paths := MusclePaths(fibres, *bones, body, {0: lying})).rest
    moved = np.tile(np.eye(4), (2, 1, 1))
    for moved[1, 1, 3] in range(step, 121, step):
        state = paths.follow(state, moved)
    assert state.settled
    assert state.passed.mean() == passes
    straight = np.hypot(400.0, 120.0)
    assert (state.lengths.mean() - straight > 1.0) == (passes == 0.0)


def test_the_gap_of_a_point_near_a_bone_does_not_depend_on_its_way(rng):
    """In the hole of a ring, values between nodes may be less than bounds by the distances of nodes."""
    bone, still, x = Bone(*ring(), cell=2.0), np.eye(4)[None], rng.uniform(-12.0, 12.0, (1, 5000, 3))
    standoff = np.maximum(bone.solids.exact(x[0])[0] - rng.uniform(0.02, 0.1, 5000), 0.0)
    contacts = BoneContacts([(0, bone)], standoff[None, None], 1.0)
    near = contacts.proximity(still)
    for _ in range(10):
        contacts.update(x, near)
        gaps, values = near.gaps[0], bone.field(x[0])[0] - standoff
        close = np.minimum(values, gaps) < contacts.rounding
        np.testing.assert_allclose(gaps[close], values[close], rtol=0, atol=1e-12)
        x = x + rng.normal(0.0, 0.05, x.shape)

"""What a settled muscle keeps, and what it does not depend on."""

import numpy as np
import pytest
from shapes import box
from spindle import spindle

from vtkmuscle.core.bones.bone import bone_of
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import mesh_topology, signed_volume
from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.core.skinning.carried_muscle import Settling

POINTS, TRIANGLES, FIXED_TO = spindle(rings=40, around=24, seed=0)
FREE = FIXED_TO < 0
STILL = np.array([np.eye(4)] * 2)


def box_bone(bone, low, high):
    return bone, bone_of(*box(low, high))


def settling_of(*bones, points=POINTS, fixed_to=FIXED_TO):
    return Settling(RestShape(points, mesh_topology(len(points), TRIANGLES)), fixed_to, dict(bones))


def carried(depth=0.0, squeeze=1.0):
    """Return the free points squeezed, and moved along y by a bump of so much half way."""
    moved = POINTS * [1.0, squeeze, 1.0]
    bump = np.cos(0.5 * np.pi * POINTS[:, 2] / np.abs(POINTS[:, 2]).max())
    moved[:, 1] += depth * bump
    moved[~FREE] = POINTS[~FREE]
    return moved


@pytest.mark.parametrize("rounds", [1, 5, 20])
def test_at_rest_nothing_moves(rounds):
    inside = box_bone(0, [-5, -40, -20], [5, -2, 20])  # overlaps the muscle at rest, as real bones do
    settled = settling_of(inside).settle(POINTS, STILL, rounds=rounds)
    np.testing.assert_allclose(settled.surface, POINTS, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("rounds", [1, 2, 5, 20])
@pytest.mark.parametrize("squeeze", [0.7, 1.0, 1.3])
def test_volume_bones_and_fixed_points_are_kept(rounds, squeeze):
    top = POINTS[:, 1].max()
    wall = box_bone(1, [-60, top + 1.0, -60], [60, top + 40.0, 60])
    turn = rotation_about((0.0, 300.0, 0.0), [0, 0, 1], 2.0)
    transforms = np.array([np.eye(4), turn])
    settled = settling_of(wall).settle(carried(6.0, squeeze), transforms, rounds=rounds)
    volume = signed_volume(settled.surface, TRIANGLES)
    assert volume == pytest.approx(signed_volume(POINTS, TRIANGLES), rel=1e-9)
    for bone in (0, 1):
        fixed = bone == FIXED_TO
        expected = apply_transform(transforms[bone], POINTS[fixed])
        np.testing.assert_allclose(settled.surface[fixed], expected, rtol=0.0, atol=1e-6)
    seen = apply_transform(np.linalg.inv(turn), settled.surface[FREE])
    assert (seen[:, 1] - (top + 1.0)).max() < 0.1
    assert settled.colliding > 0


def test_what_is_carried_well_stays_where_it_is():
    twisted = POINTS.copy()
    angle = np.radians(20.0) * (POINTS[:, 2] - POINTS[:, 2].min()) / np.ptp(POINTS[:, 2])
    x, y = POINTS[:, 0], POINTS[:, 1]
    twisted[:, 0], twisted[:, 1] = (
        np.cos(angle) * x - np.sin(angle) * y,
        np.sin(angle) * x + np.cos(angle) * y,
    )
    free = np.zeros(len(POINTS), dtype=bool)
    free[np.abs(POINTS[:, 2]) < 0.5 * np.abs(POINTS[:, 2]).max()] = True
    settling = settling_of(fixed_to=np.where(FREE, -1, 0))
    settled = settling.settle(np.where(FREE[:, None], twisted, POINTS), STILL, rounds=5).surface
    assert np.linalg.norm(settled - twisted, axis=1)[free].max() < 0.5


def test_more_rounds_make_a_smoother_surface():
    top = POINTS[:, 1].max()
    settling = settling_of(box_bone(0, [-60, top - 2.0, -8], [60, top + 40.0, 8]))
    shape = RestShape(POINTS, mesh_topology(len(POINTS), TRIANGLES))
    bumped = carried(5.0, 0.9)
    errors = [
        shape.compare(settling.settle(bumped, STILL, rounds=rounds).surface).dihedral_error_p95
        for rounds in (1, 3, 10)
    ]
    assert errors[0] > errors[1] > errors[2]


def test_a_finer_mesh_settles_the_same():
    """What a displacement spreads over is a length, and not a number of edges."""
    ends = []
    for rings, around in ((40, 24), (80, 48)):
        points, triangles, fixed_to = spindle(rings=rings, around=around)
        fixed_to = np.where(np.abs(points[:, 2]) > 0.9 * np.abs(points[:, 2]).max(), 0, -1)
        wall = box_bone(0, [-60, points[:, 1].max() - 3.0, -60], [60, points[:, 1].max() + 40.0, 60])
        shape = RestShape(points, mesh_topology(len(points), triangles))
        moved = points + np.where(fixed_to < 0, 3.0, 0.0)[:, None] * [0.0, 1.0, 0.0]
        # The wall is where it allows the muscle at rest to be: it comes down onto it.
        transforms = np.eye(4)[None].copy()
        transforms[0, 1, 3] = 4.0
        held = np.where(fixed_to < 0, -1, 1)
        settled = Settling(shape, held, dict([wall])).settle(
            moved, np.array([transforms[0], np.eye(4)]), rounds=10
        )
        middle = np.abs(points[:, 2]) < 0.1 * np.abs(points[:, 2]).max()
        ends.append(float((settled.surface - points)[middle, 1].mean()))
    assert ends[0] == pytest.approx(ends[1], abs=0.15)


def test_a_muscle_carried_across_a_bone_is_not_torn():
    """Some of its points there are nearer to one side of the bone than to the end, and some to the other."""
    bar = box_bone(1, [-12.0, 60.0, -20.0], [12.0, 160.0, 20.0])
    below = np.array([np.eye(4), np.eye(4)])
    below[1, 1, 3] = POINTS[:, 1].min() - 161.0  # its end is 1 mm below the muscle
    shape = RestShape(POINTS, mesh_topology(len(POINTS), TRIANGLES))
    settled = settling_of(bar, fixed_to=np.where(FREE, -1, 0)).settle(carried(-14.0), below, rounds=5)
    assert settled.colliding > 0
    assert shape.compare(settled.surface).edge_stretch_max < 3.0  # 4.4 where each goes to its nearest side

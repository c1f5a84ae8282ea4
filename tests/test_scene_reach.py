"""The part of each bone that the muscles of a scene can meet."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from vtkmuscle import Scene
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.data.arrays import field_array, multiblock_from, points_of, set_field_array
from vtkmuscle.phantoms import hip
from vtkmuscle.pipelines import deform
from vtkmuscle.run.reach import bones_with_reach


@pytest.fixture(scope="module")
def phantom():
    return hip()


def test_it_holds_all_muscles_where_their_bones_take_them(phantom):
    scene = Scene.from_phantom(phantom)
    for name, bone in bones_with_reach(scene).items():
        hull = Delaunay(field_array(bone, "Reach"))
        for time in scene.motion.times[[0, 7, -1]]:
            now = scene.motion.at(float(time))
            to_bone = inverse(now.get(name, np.eye(4)))
            for muscle in scene.muscles.values():
                for carrier in scene.bones:
                    points = apply_transform(to_bone @ now.get(carrier, np.eye(4)), points_of(muscle.surface))
                    middle = points.mean(axis=0)
                    assert (hull.find_simplex(middle + 0.999 * (points - middle)) >= 0).all()


def test_frames_do_not_depend_on_it(phantom):
    bones = multiblock_from(bones_with_reach(Scene.from_phantom(phantom)))
    chains = [
        deform(phantom.muscles["iliacus"], data, phantom.motion, phantom.attachments["iliacus"])
        for data in (phantom.bones, bones)
    ]
    for time in phantom.motion.times[:9:4]:
        whole, part = (points_of(chain.update(time=float(time)).output) for chain in chains)
        np.testing.assert_allclose(part, whole, atol=1e-6)
    assert any(obstacle.region is not None for obstacle in chains[1]._rest_bones.obstacles)


@pytest.mark.parametrize("wrong", [np.zeros(6), np.full((3, 3), np.nan)])
def test_one_that_is_no_points_is_refused(phantom, wrong):
    bones = multiblock_from(bones_with_reach(Scene.from_phantom(phantom)))
    set_field_array(bones.GetBlock(0), "Reach", wrong)
    chain = deform(phantom.muscles["iliacus"], bones, phantom.motion, phantom.attachments["iliacus"])
    with pytest.raises(ValueError, match="'pelvis': the field array 'Reach' must be points"):
        chain.update(time=0.0)

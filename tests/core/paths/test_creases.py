"""Points in a crease between two walls of a bone: one gap on every way; sheets come to rest, in few steps."""

import numpy as np
import pytest
from shapes import ring

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.paths.bone_contact import BoneContacts
from vtkmuscle.data.arrays import field_array
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


def test_the_gap_of_a_point_near_a_bone_does_not_depend_on_its_way(rng):
    """In the hole of a ring, values between nodes may be less than bounds by the distances of nodes."""
    bone, still, x = Bone(*ring(), cell=2.0), np.eye(4)[None], rng.uniform(-12.0, 12.0, (1, 5000, 3))
    standoff = np.maximum(bone.exact(x[0])[0] - rng.uniform(0.02, 0.1, 5000), 0.0)
    contacts = BoneContacts([(0, bone)], standoff[None, None], 1.0)
    near = contacts.proximity(still)
    for _ in range(10):
        contacts.update(x, near)
        gaps, values = near.gaps[0], bone.field(x[0])[0] - standoff
        close = np.minimum(values, gaps) < contacts.rounding
        np.testing.assert_allclose(gaps[close], values[close], rtol=0, atol=1e-12)
        x = x + rng.normal(0.0, 0.05, x.shape)

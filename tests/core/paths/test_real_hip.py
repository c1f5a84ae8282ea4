"""Paths in the muscles of a real hip, flexed."""

import numpy as np
import pytest
from phantom_paths import strung_muscle, swept

from vtkmuscle import Scene

pytestmark = pytest.mark.realdata

#: Angles from rest [degrees], and the step of a difference.
ANGLES, STEP = np.arange(0.0, 61.0, 30.0), 5.0


@pytest.fixture(scope="module")
def hip_scene(lhdl_hip):
    return Scene.load(lhdl_hip / "scene.toml")


@pytest.mark.parametrize(
    "name",
    [
        *("gluteus_maximus", "iliacus"),
        *(pytest.param(name, marks=pytest.mark.long) for name in ("gluteus_medius", "adductor_brevis")),
    ],
)
@pytest.mark.slow
def test_paths_of_a_real_muscle_have_lengths_and_come_to_rest(hip_scene, name):
    made = strung_muscle(
        hip_scene.muscles[name].surface,
        hip_scene.bones_data(),
        hip_scene.attachments_data(name),
        fibres=hip_scene.muscles[name].fibres or {},
        **hip_scene.fixing_of(name),
    )
    rest = hip_scene.motion.times[0]
    poses = [
        [hip_scene.motion.at(rest + max(angle + side, 0.0)).get(bone, np.eye(4)) for bone in made.names]
        for angle in ANGLES
        for side in (-STEP, STEP)
    ]
    states = swept(made.pulled(), np.array(poses))
    lengths = np.array([state.lengths for state in states]).reshape(len(ANGLES), 2, -1)
    assert np.isfinite(lengths).all()
    assert lengths.min() > 5.0
    assert all(state.settled for state in states)
    if name == "iliacus":
        arms = -np.diff(lengths.mean(axis=2), axis=1)[:, 0] / np.radians([STEP, *[2.0 * STEP] * 2])
        # The literature has about 30 mm.
        assert arms.min() > 20.0
        assert arms.max() < 40.0

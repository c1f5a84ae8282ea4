"""Strings in the muscles of a real hip, flexed."""

import numpy as np
import pytest
from taut_phantoms import strung_muscle, swept

from vtkmuscle import Scene

pytestmark = pytest.mark.realdata

#: Angles from rest [degrees], and the step of a difference.
ANGLES, STEP = np.arange(0.0, 61.0, 20.0), 5.0


@pytest.fixture(scope="module")
def hip_scene(lhdl_hip):
    return Scene.load(lhdl_hip / "scene.toml")


def flexed_lengths(scene, name):
    """Return lengths (4, 2, f) before and after each of the angles, and how many strings never settle."""
    fibres = scene.muscles[name].fibres or {}
    fixing = scene.fixing_of(name)
    made = strung_muscle(
        scene.muscles[name].surface, scene.bones_data(), scene.attachments_data(name), fibres=fibres, **fixing
    )
    rest = scene.motion.times[0]
    poses = [
        [scene.motion.at(rest + max(angle + side, 0.0)).get(bone, np.eye(4)) for bone in made.names]
        for angle in ANGLES
        for side in (-STEP, STEP)
    ]
    paths = made.pulled()
    states = swept(paths, np.array(poses))
    lengths = np.array([state.lengths for state in states]).reshape(len(ANGLES), 2, -1)
    return lengths, np.mean([state.unsettled for state in states]) / len(made.fibres)


#: Measured, of 100 strings and as a mean over the poses: 4.8, 0 and 0.4 do not come to rest; the last was not
#: measured anew.
@pytest.mark.parametrize(
    ("name", "unsettled"),
    [("gluteus_maximus", 0.08), ("gluteus_medius", 0.02), ("iliacus", 0.02), ("adductor_brevis", 0.05)],
)
def test_strings_of_a_real_muscle_have_lengths_and_come_to_rest(hip_scene, name, unsettled):
    lengths, part = flexed_lengths(hip_scene, name)
    assert np.isfinite(lengths).all()
    assert lengths.min() > 5.0
    assert part <= unsettled
    if name == "iliacus":
        arms = -np.diff(lengths.mean(axis=2), axis=1)[:, 0] / np.radians([STEP, *[2.0 * STEP] * 3])
        # The literature has about 30 mm.
        assert arms.min() > 20.0
        assert arms.max() < 40.0

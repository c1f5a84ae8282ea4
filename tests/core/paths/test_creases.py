"""Sheets with points in a crease between two walls of a bone come to rest."""

import pytest

from vtkmuscle import Scene
from vtkmuscle.data.arrays import field_array
from vtkmuscle.run.muscles import muscle_pipeline


@pytest.mark.realdata
@pytest.mark.slow
def test_an_infraspinatus_on_the_spine_of_its_scapula_comes_to_rest(bp3d_arm):
    scene = Scene.load(bp3d_arm / "shoulder_abduction.toml")
    paths = muscle_pipeline(scene, "infraspinatus").taut_paths
    for time in scene.motion.times:
        assert not field_array(paths.update(time=float(time)).output, "Unsettled")[0]

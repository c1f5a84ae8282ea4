"""The runs whose pages are tested: small, and made once."""

from dataclasses import replace

import numpy as np
import pytest
from tiny_scene import write_tiny_scene

from vtkmuscle import Scene
from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.io.literature import LiteratureCurve


@pytest.fixture(scope="session")
def two_muscles(tmp_path_factory):
    """A scene with two muscles, of which one has published moment arms."""
    scene = Scene.load(write_tiny_scene(tmp_path_factory.mktemp("two")))
    motion = replace(
        scene.motion, coordinates={"knee_angle": Coordinate(scene.motion.times, "deg", "flexion")}
    )
    muscle = scene.muscles["spindle"]
    band = [
        LiteratureCurve("Somebody1985", "spindle", "knee_angle", f"fibres_{side}_bound", *np.array(curve))
        for side, curve in (("lower", ((0.0, 20.0), (10.0, 12.0))), ("upper", ((0.0, 20.0), (16.0, 18.0))))
    ]
    muscles = {"spindle": replace(muscle, literature=tuple(band)), "second_one": muscle}
    return replace(scene, muscles=muscles, motion=motion)


@pytest.fixture(scope="session")
def run_folder(two_muscles, tmp_path_factory):
    """The folder of its run, and what it gave."""
    out = tmp_path_factory.mktemp("run") / "out"
    return out, two_muscles.run(out, figures=False)

"""Two-joint muscles of a real knee, bent to 90 degrees: they do not crumple, and have known moment arms."""

import dataclasses

import numpy as np
import pytest

from vtkmuscle import Scene

pytestmark = [pytest.mark.realdata, pytest.mark.slow]

MUSCLES = ("semitendinosus", "biceps_femoris_long")


@pytest.fixture(scope="module")
def bent(bp3d_knee):
    """The result of two hamstrings, by the defaults."""
    scene = Scene.load(bp3d_knee / "scene.toml")
    muscles = {name: scene.muscles[name] for name in MUSCLES}
    with pytest.warns(UserWarning, match=r"up to 4\.\d mm deep in the bone"):
        return dataclasses.replace(scene, muscles=muscles).run(figures=False)


def flexion_arms(result, name):
    """Return the mean moment arm of a muscle's fibres at each angle [mm]."""
    return -np.gradient(result.lengths[name].mean(axis=1), np.radians(result.times))


@pytest.mark.parametrize("name", MUSCLES)
def test_a_hamstring_neither_crumples_nor_leaves_its_fibres_outside(bent, name):
    assert bent.verdicts[name] != "failed"
    assert max(row["fibres_outside_max_mm"] for row in bent.report["muscles"][name]["frames"]) <= 0.1


@pytest.mark.parametrize("name", MUSCLES)
def test_a_hamstring_has_no_less_than_the_moment_arms_of_dissections(bent, name):
    assert flexion_arms(bent, name).min() >= 10.0


@pytest.mark.gap(
    "moment arm of the semitendinosus at 90 degrees of the knee", "71.3 mm", "50 mm, dissections"
)
@pytest.mark.gap(
    "moment arm of the biceps femoris at 90 degrees of the knee", "50.4 mm", "50 mm, dissections"
)
@pytest.mark.parametrize(("name", "most"), [("semitendinosus", 72.0), ("biceps_femoris_long", 53.0)])
def test_a_hamstring_has_hardly_more_than_the_moment_arms_of_dissections(bent, name, most):
    assert flexion_arms(bent, name).max() <= most


@pytest.mark.parametrize("name", MUSCLES)
def test_moment_arms_grow_evenly_as_the_knee_flexes(bent, name):
    assert np.abs(np.diff(flexion_arms(bent, name))).max() < 5.0

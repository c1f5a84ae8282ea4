"""A muscle's paths and its fibres: two lengths, two names, in every model."""

from dataclasses import replace

import numpy as np
import phantoms
import pytest
from slow import slow

from vtkmuscle import Scene

#: What fibres are on the mean longer or shorter than their paths, at most [mm], or as a part of these.
MILLIMETRE, PART = 1.0, 0.01


LONGER = (
    *("strap_over_two_joints", "spindle_over_ball", "flexor_over_brim", "slivered_tendon"),
    *("tendon_through_ring", "lifting_strap"),
)


def scene_of(make, n_fibres=12, every=4, **settings):
    scene = Scene.from_phantom(getattr(phantoms, make)(), n_fibres=n_fibres, **settings)
    return replace(scene, motion=scene.motion.part(range(0, len(scene.motion.times), every)))


@pytest.mark.parametrize("make", ["wrapping_cylinder", "spindle_over_hinge", *slow(*LONGER)])
def test_fibres_from_bone_to_bone_are_as_long_as_their_paths_in_every_frame(make):
    result = scene_of(make, every=2).run(figures=False, sense=False)  # a sliding bone
    ((name, paths),) = result.lengths.items()
    means = paths.mean(axis=1)
    off = np.abs(result.fibre_lengths[name].mean(axis=1) - means)
    assert (off <= np.maximum(MILLIMETRE, PART * means)).all()


@pytest.fixture(scope="module")
def spindle():
    return scene_of("spindle_over_hinge", n_fibres=6)


@pytest.mark.parametrize("deformer", ["paths", "pbd"])
def test_every_deformer_has_the_same_paths(spindle, deformer):
    """The paths beside a deformed muscle are the ones that are pulled alone."""
    paths = replace(spindle, deformer="none").run(figures=False)
    volume = replace(spindle, deformer=deformer, paths={}).run(figures=False)
    np.testing.assert_allclose(volume.lengths["spindle"], paths.lengths["spindle"], atol=1e-6)
    mine, theirs = (one.moment_arms()["spindle"]["distal_angle"].arms for one in (volume, paths))
    np.testing.assert_allclose(mine, theirs, atol=1e-4)
    np.testing.assert_allclose(paths.fibre_lengths["spindle"], paths.lengths["spindle"], rtol=1e-12)
    assert np.abs(volume.fibre_lengths["spindle"] - volume.lengths["spindle"]).max() > 0.05

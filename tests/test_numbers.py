"""Numbers depend on what a scene is: not on order, names, workers, or which frames are asked for."""

from dataclasses import replace

import numpy as np
import pytest

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import checked_surface, surface_from

FRAMES = "0:3:2"


@pytest.fixture(scope="module")
def scene():
    return Scene.from_phantom(phantoms.hip(), n_fibres=9).with_muscles("gluteus_medius", "iliacus")


def numbers(scene, frames=FRAMES, workers=1):
    """Return what a run measures of each muscle."""
    found = scene.run(None, frames=frames, figures=False, workers=workers)
    return {name: (found.lengths[name], found.fibre_lengths[name]) for name in scene.muscles}


@pytest.fixture(scope="module")
def expected(scene):
    return numbers(scene)


def deviation(found, expected):
    """Return the largest difference of a length [mm]."""
    return max(
        float(np.abs(np.subtract(one, other)).max())
        for name, lengths in expected.items()
        for one, other in zip(found[name], lengths, strict=True)
    )


@pytest.mark.slow
def test_of_the_order_of_muscles_and_of_workers(scene, expected):
    turned = replace(scene, muscles=dict(reversed(scene.muscles.items())))
    assert deviation(numbers(turned, workers=2), expected) == 0.0


def test_of_the_frames_that_are_asked_for(scene, expected):
    alone = numbers(scene, frames="2:3")
    assert deviation(alone, {name: [table[-1:] for table in one] for name, one in expected.items()}) == 0.0


def test_of_names_and_of_the_order_of_bones_and_areas(scene, expected):
    new = {name: f"{9 - number} {name[::-1]}" for number, name in enumerate(scene.bones)}
    muscles = {
        f"a {name}": replace(
            muscle, attachments=[replace(one, bone=new[one.bone]) for one in reversed(muscle.attachments)]
        )
        for name, muscle in scene.muscles.items()
    }
    motion = scene.motion
    renamed = replace(
        scene,
        bones={new[name]: bone for name, bone in reversed(scene.bones.items())},
        muscles=muscles,
        motion=RigidMotion(
            motion.times, {new[one]: of for one, of in motion.transforms.items()}, motion.centre
        ),
    )
    found = numbers(renamed)
    assert deviation({name: found[f"a {name}"] for name in expected}, expected) < 1e-9


def renumbered(surface, rng):
    """Return a surface whose points and triangles come in another order."""
    places, triangles = checked_surface(surface, "surface")
    order = rng.permutation(len(places))
    places, triangles = places[order], rng.permutation(np.argsort(order)[triangles])
    first = rng.integers(0, 3, len(triangles))[:, None]
    return surface_from(places, np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1))


def test_of_the_order_of_points_and_triangles_of_bones(scene, expected, rng):
    bones = {name: renumbered(bone, rng) for name, bone in scene.bones.items()}
    assert deviation(numbers(replace(scene, bones=bones)), expected) < 1e-3


def test_of_the_order_of_points_and_triangles_of_muscles(scene, expected, rng):
    muscles = {
        name: replace(one, surface=renumbered(one.surface, rng)) for name, one in scene.muscles.items()
    }
    assert deviation(numbers(replace(scene, muscles=muscles)), expected) < 0.01

"""A muscle's paths and its fibres: two lengths, two names, in every model."""

import csv
from dataclasses import replace

import numpy as np
import phantoms
import pytest

from vtkmuscle import Result, Scene

#: What fibres are on the mean longer or shorter than their paths, at most [mm], or as a part of these.
MILLIMETRE, PART = 1.0, 0.01


def scene_of(make, n_fibres=12, every=4, **settings):
    scene = Scene.from_phantom(getattr(phantoms, make)(), n_fibres=n_fibres, **settings)
    return replace(scene, motion=scene.motion.part(range(0, len(scene.motion.times), every)))


@pytest.mark.parametrize(
    "make",
    [
        "wrapping_cylinder",
        "strap_over_two_joints",
        "slivered_tendon",
        "spindle_over_hinge",
        "spindle_over_ball",
        "flexor_over_brim",
        "tendon_through_ring",
        "lifting_strap",
    ],
)
def test_fibres_from_bone_to_bone_are_as_long_as_their_paths_in_every_frame(make):
    result = scene_of(make, every=2).run(figures=False)
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
    assert np.abs(volume.fibre_lengths["spindle"] - volume.lengths["spindle"]).max() > 0.1


def test_a_paths_length_is_that_of_its_points_and_its_levers_are_the_moment_arms(spindle):
    result = spindle.run(figures=False)
    for frame, lengths in zip(result.frames, result.lengths["spindle"], strict=True):
        found = result.paths("spindle", frame=frame)
        steps = np.linalg.norm(np.diff(found.points, axis=1), axis=2)
        np.testing.assert_allclose(steps.sum(axis=1), lengths)
        arms = result.moment_arms()["spindle"]["distal_angle"]
        np.testing.assert_array_equal(found.levers["distal_angle"], arms.arms[result.frames.index(frame)])


def test_each_quantity_has_its_table_and_is_read_back(spindle, tmp_path):
    result = spindle.run(tmp_path, figures=False)
    again = Result.load(tmp_path)
    for file, known, read, table in (
        ("lengths.csv", result.lengths, again.lengths, result.length_table()),
        ("fibre_lengths.csv", result.fibre_lengths, again.fibre_lengths, result.fibre_length_table()),
    ):
        np.testing.assert_array_equal(read["spindle"], known["spindle"])
        rows = list(csv.DictReader((tmp_path / file).read_text().splitlines()))
        assert list(rows[0]) == ["muscle", "fibre", "frame", "time", "length_mm", "segment_error_mm"]
        written = np.array([float(row["length_mm"]) for row in rows])
        np.testing.assert_array_equal(written.reshape(6, -1).T, known["spindle"])
        np.testing.assert_array_equal(table["length_mm"], written)
    arms, others = (one.moment_arms()["spindle"]["distal_angle"].arms for one in (result, again))
    np.testing.assert_array_equal(arms, others)
    strain = list(csv.DictReader((tmp_path / "spindle_fibres.csv").read_text().splitlines()))
    first = [float(row["length_mm"]) for row in strain if row["fibre"] == "0"]
    np.testing.assert_allclose(first, result.fibre_lengths["spindle"][:, 0], rtol=1e-9)


def test_lengths_and_arms_are_millimetres_whatever_the_scene_is_in(spindle):
    """The same muscle, in metres."""
    from vtkmuscle.data.arrays import points_of, with_points

    def smaller(surface):
        return with_points(surface, points_of(surface) / 1000.0)

    def shrunk(transforms):
        shrunk = np.array(transforms)
        shrunk[:, :3, 3] /= 1000.0
        return shrunk

    muscle = spindle.muscles["spindle"]
    areas = tuple(replace(one, landmarks=np.asarray(one.landmarks) / 1000.0) for one in muscle.attachments)
    motion = spindle.motion
    (coordinate,) = motion.coordinates.values()
    twists = {bone: one * [1e-3, 1e-3, 1e-3, 1, 1, 1] for bone, one in coordinate.twists.items()}
    in_metres = replace(
        spindle,
        units="m",
        deformer="none",
        bones={name: smaller(bone) for name, bone in spindle.bones.items()},
        muscles={"spindle": replace(muscle, surface=smaller(muscle.surface), attachments=areas)},
        motion=replace(
            motion,
            transforms={bone: shrunk(table) for bone, table in motion.transforms.items()},
            centre=motion.centre / 1000.0,
            coordinates={"distal_angle": replace(coordinate, twists=twists)},
        ),
    )
    result, known = (one.run(figures=False) for one in (in_metres, replace(spindle, deformer="none")))
    np.testing.assert_allclose(result.lengths["spindle"], known.lengths["spindle"], rtol=1e-4)
    mine, theirs = (one.moment_arms()["spindle"]["distal_angle"].arms for one in (result, known))
    np.testing.assert_allclose(mine, theirs, atol=0.05)

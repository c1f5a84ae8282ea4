"""TautPaths: what a pose's paths depend on, and what they have with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import phantoms
import pytest
from filter_case import digest
from slow import slow

from vtkmuscle import Scene
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.paths import pose
from vtkmuscle.data.arrays import (
    add_arrays,
    blocks_of,
    cell_array,
    field_array,
    names_of,
    point_array,
    points_of,
    polylines_of,
    shallow_copy,
)
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths, taut_paths
from vtkmuscle.pipelines import MusclePipeline, decompose
from vtkmuscle.run import muscle_pipeline

#: Phantom and muscle, whose paths lie round bones, in a groove, over two joints or through a ring.
CASES = [
    ("hip", "gluteus_medius"),
    ("hip", "gluteus_maximus"),
    ("hip", "iliacus"),
    ("wrapping_cylinder", "strap"),
    ("flexor_over_brim", "flexor"),
    ("tendon_through_ring", "muscle"),
]
#: Quick cases of these, and all others.
HIP, ROUND = CASES[0], [CASES[3], *slow(*CASES[:3], CASES[4]), CASES[5]]
LEVERS = "Lever_"


@cache
def at_rest(make, name):
    """Return a phantom, one of its muscles with its fixed points, and 16 fibres."""
    phantom = getattr(phantoms, make)()
    areas = phantom.attachments[name]
    fixed = FixedPointDetector()(phantom.muscles[name], phantom.bones, areas)
    fibres = decompose(fixed, areas, n_fibres=16, template=phantom.templates.get(name)).update().output
    return phantom, fixed, fibres


def paths_of(make, name, **settings):
    """Return the filter that pulls a muscle's paths."""
    phantom, fixed, fibres = at_rest(make, name)
    moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
    inputs = {"rest_fibres": fibres, "attachments": phantom.attachments[name]} | settings
    return TautPaths(rest_muscle=fixed, rest_bones=phantom.bones, bones=moving, **inputs)


def lengths(paths, time):
    return np.array(cell_array(paths.update(time=time).output, "Length", "test"))


def times_of(make, count):
    times = at_rest(make, dict(CASES)[make])[0].motion.times
    return times[np.linspace(0, len(times) - 1, count).astype(int)]


# -------------------------------------------------------------------- a pose


@pytest.mark.gap(
    "difference of a path's length, alone and after other poses, in a via ring", "0.90 mm", "0.02 mm"
)
@pytest.mark.parametrize(("make", "name"), ROUND)
def test_a_pose_asked_for_alone_is_the_pose_reached_through_all_frames(make, name):
    bound = 1.1 if make == "tendon_through_ring" else 0.02
    times = [float(time) for time in at_rest(make, name)[0].motion.times]
    swept, alone = paths_of(make, name), paths_of(make, name)
    through = {time: lengths(swept, time) for time in times}
    for time in (times[-1], times[len(times) // 2]):
        np.testing.assert_allclose(lengths(alone, time), through[time], rtol=0.0, atol=bound)


@pytest.mark.realdata
@pytest.mark.gap(
    "difference of a path's length, a last pose alone and after others, gluteus maximus", "0.16 mm", "0.02 mm"
)
@pytest.mark.parametrize(
    ("name", "bound"),
    [("adductor_brevis", 0.02), ("gluteus_maximus", 0.2), ("gluteus_medius", 0.02), ("iliacus", 0.02)],
)
@pytest.mark.slow
def test_a_pose_of_the_real_hip_asked_for_alone_is_the_pose_reached_through_all_frames(lhdl_hip, name, bound):
    scene = replace(Scene.load(lhdl_hip / "scene.toml"), deformer="none")
    swept, alone = (muscle_pipeline(scene, name).taut_paths for _ in range(2))
    through = [lengths(swept, float(time)) for time in scene.motion.times]
    last = float(scene.motion.times[-1])
    np.testing.assert_allclose(lengths(alone, last), through[-1], rtol=0.0, atol=bound)


@pytest.mark.parametrize(("make", "name"), [HIP, *slow(*CASES[1:3])])
def test_lengths_settle_as_paths_get_more_segments(make, name):
    times = times_of(make, 4)
    coarse, default, fine = (
        np.array([lengths(paths, time) for time in times])
        for paths in (paths_of(make, name, resolution=n) for n in (16, 32, 64))
    )
    off_coarse, off_default = (np.sqrt(((one - fine) ** 2).mean()) for one in (coarse, default))
    # Measured 0.14, 0.32 and 0.35 mm with 36 fibres and 7 poses; 0.8 to 1.8 mm where what is smoothed along
    # the fibre, and how stiff its guides are, depends on the number of points.
    assert off_default < 0.6
    assert off_default < 0.6 * off_coarse


@pytest.mark.realdata
@pytest.mark.slow
def test_paths_end_where_larger_steps_take_them(lhdl_hip):
    """Of the adductor brevis, where a path may snap."""
    scene = replace(Scene.load(lhdl_hip / "scene.toml"), deformer="none")
    scene = replace(scene, muscles={"adductor_brevis": scene.muscles["adductor_brevis"]})
    ends = []
    for every in (1, 5):
        motion = scene.motion.part(range(0, len(scene.motion.times), every))
        ends.append(
            replace(scene, motion=motion).run(figures=False, workers=1).lengths["adductor_brevis"][-1]
        )
    assert np.abs(ends[0] - ends[1]).max() < 0.5


# -------------------------------------------------------------------- what comes out


def test_paths_have_lengths_rest_and_the_arrays_of_their_fibres():
    fibres = shallow_copy(at_rest(*CASES[3])[2])
    own = np.arange(float(fibres.GetNumberOfCells()))
    add_arrays(fibres, cells={"Own": own})
    paths = paths_of(*CASES[3], rest_fibres=fibres, resolution=20)
    rest = shallow_copy(paths.update(time=0.0).output)
    out = paths.update(time=30.0).output
    lines = polylines_of(out, "test").points.reshape(len(own), 21, 3)
    measured = np.linalg.norm(np.diff(lines, axis=1), axis=2).sum(axis=1)
    np.testing.assert_allclose(cell_array(out, "Length", ""), measured, rtol=1e-9)
    np.testing.assert_array_equal(point_array(out, "RestPosition", ""), point_array(rest, "RestPosition", ""))
    np.testing.assert_allclose(points_of(rest), point_array(rest, "RestPosition", ""), atol=1e-6)
    np.testing.assert_allclose(cell_array(rest, "Length", ""), cell_array(rest, "RestLength", ""), atol=1e-6)
    ratio = measured / cell_array(out, "RestLength", "")
    np.testing.assert_allclose(cell_array(out, "Ratio", ""), ratio, rtol=1e-9)
    np.testing.assert_array_equal(cell_array(out, "Own", ""), own)
    assert {"Contact", "Squeezed", "Sag"} <= set(names_of("", out.GetCellData()))


def test_bones_connected_for_each_pose_leave_the_paths_at_rest(noted):
    solved = noted(taut_paths, "MusclePaths", "rest")
    paths, moving = paths_of(*CASES[3], resolution=12), paths_of(*CASES[3]).bones
    for time in (0.0, 15.0, 30.0):
        paths.bones = moving(time=time)
        paths.update()
    paths(*(getattr(paths, port.name) for port in paths.input_ports))
    assert solved == ["rest"]


def test_few_solved_paths_carry_all_fibres_and_all_are_as_without_the_setting():
    made, every = paths_of(*CASES[0], n_paths=6), paths_of(*CASES[0])
    few, all_solved = (paths.update(time=30.0).output for paths in (made, every))
    assert few.GetNumberOfCells() == 16
    assert names_of("", few.GetCellData()) == names_of("", all_solved.GetCellData())
    assert digest(few) != digest(all_solved)
    np.testing.assert_allclose(cell_array(few, "Length", ""), cell_array(all_solved, "Length", ""), atol=1.0)
    _, fixed, fibres = at_rest(*CASES[0])
    posed = {"rest_bones": made.rest_bones, "bones": made.bones, "fibres": fibres}
    deformer = PathDeformer(muscle=fixed, paths=made, measure_shape=True, **posed)
    assert field_array(deformer.update(time=30.0).output, "VolumeRatio")[0] == pytest.approx(1.0, abs=1e-9)
    for n_paths in (16, 10**6):
        made.n_paths = n_paths
        assert digest(made.update(time=30.0).output) == digest(all_solved)
    with pytest.raises(ValueError, match="n_paths is 3, but must be"):
        TautPaths(n_paths=3)


@pytest.mark.parametrize(("resolution", "cuts"), [(8, True), (32, False)])
def test_segments_too_long_for_a_bone_cut_into_it(resolution, cuts):
    """Round the cylinder of 30 mm 8 segments of 16 mm sag by 1 mm and more."""
    sag = cell_array(paths_of(*CASES[3], resolution=resolution).update(time=30.0).output, "Sag", "")
    assert bool(sag.max() > 1.0) is cuts
    assert sag.max() < 4.0


def test_levers_are_slopes_of_lengths_and_may_be_left_out():
    paths = paths_of(*CASES[3])
    (coordinate,) = at_rest(*CASES[3])[0].motion.coordinates
    before, after = (lengths(paths, time) for time in (29.0, 31.0))
    arms = np.array(cell_array(paths.update(time=30.0).output, LEVERS + coordinate, "test"))
    np.testing.assert_allclose(arms, -(after - before) / np.radians(2.0), rtol=0.0, atol=0.3)
    assert np.abs(arms).min() > 5.0
    without = paths_of(*CASES[3], levers=False).update(time=30.0).output
    assert not [name for name in names_of("", without.GetCellData()) if name.startswith(LEVERS)]
    np.testing.assert_allclose(cell_array(without, "Length", ""), lengths(paths, 30.0), atol=0.02)


@pytest.mark.parametrize(("angle", "lifted"), [(0.0, False), (10.0, False), (50.0, True)])
def test_the_bow_of_a_path_off_its_bone_is_what_the_straight_line_lacks(angle, lifted):
    """The strap lies on a roller up to 30 degrees; then the way of a path without contact is free."""
    paths, bow, straight = paths_of("lifting_strap", "strap"), {}, {}
    for time in (angle, angle + 2.0):
        out = paths.update(time=time).output
        ends = polylines_of(out, "test").points.reshape(16, -1, 3)[:, [0, -1]]
        straight[time] = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        names = "Length", "Bow", LEVERS + "distal_angle", "BowLever_distal_angle"
        length, bow[time], lever, of_lever = (cell_array(out, name, "test") for name in names)
        free = lifted * (np.array(cell_array(out, "Contact", "test")) == 0)
        np.testing.assert_allclose(bow[time], free * (length - straight[time]), atol=0.02)
    assert (bow[angle].max() > 0.3) == lifted
    slopes = (straight[angle] - straight[angle + 2.0]) / np.radians(2.0)
    np.testing.assert_allclose(of_lever, free * (lever - slopes), atol=1.0)


def test_without_fibres_lines_over_the_surface_stand_in():
    lines = paths_of(*CASES[3], rest_fibres=None).update(time=30.0).output
    fibres = paths_of(*CASES[3]).update(time=30.0).output
    assert lines.GetNumberOfCells() > 4
    means = [np.mean(cell_array(paths, "Length", "")) for paths in (lines, fibres)]
    assert means[0] == pytest.approx(means[1], rel=0.05)


def test_a_muscle_on_one_bone_has_no_paths_and_its_bone_carries_it():
    phantom, fixed, _ = at_rest("hip", "iliacus")
    alone = shallow_copy(fixed)
    marks = np.array(point_array(fixed, "FixedTo", ""))
    moved = phantom.motion.at(phantom.motion.times[-1])
    names = [name for name, _ in blocks_of(phantom.bones)]
    (bone,) = (names.index(name) for name in moved if (marks == names.index(name)).any())
    add_arrays(alone, points={"FixedTo": np.where(marks == bone, bone, -1).astype(np.int32)})
    posed = {"rest_bones": phantom.bones, "bones": BoneMotion(bones=phantom.bones, motion=phantom.motion)}
    paths = TautPaths(rest_muscle=alone, **posed)
    time = float(phantom.motion.times[-1])
    assert paths.update(time=time).output.GetNumberOfCells() == 0
    deformed = PathDeformer(muscle=alone, paths=paths, **posed).update(time=time).output
    at_bone = apply_transform(moved[names[bone]], points_of(fixed))
    np.testing.assert_allclose(points_of(deformed)[marks == bone], at_bone[marks == bone], atol=1e-6)
    # No part of the muscle is left behind: contact with the other bone is all that moves it off its own.
    assert np.median(np.linalg.norm(points_of(deformed) - at_bone, axis=1)) < 1.0


# -------------------------------------------------------------------- what is refused


def test_a_frame_that_does_not_come_to_rest_says_so_and_has_no_lengths_and_arms(monkeypatch):
    """With a step of Newton's method in place of all that the pose takes."""
    times = times_of("wrapping_cylinder", 4)

    def told(paths, time):
        output = paths.update(time=time).output
        unsettled, steps = (field_array(output, name)[0] for name in ("Unsettled", "PathSteps"))
        levers = [name for name in names_of("", output.GetCellData()) if name.startswith(LEVERS)]
        return unsettled, steps, [cell_array(output, name, "test") for name in ("Length", "Ratio", *levers)]

    paths = paths_of(*CASES[3])
    unsettled, steps, values = told(paths, times[1])
    assert not unsettled
    assert steps > 1
    assert len(values) == 3
    assert np.isfinite(values).all()
    monkeypatch.setattr(pose, "ITERATIONS", 1)
    unsettled, steps, values = told(paths, times[3])
    assert unsettled
    assert np.isnan(values).all()
    # Nor where the rest pose is unsettled.
    unsettled, _, values = told(paths_of(*CASES[3]), times[1])
    assert unsettled
    assert np.isnan(values).all()


@pytest.mark.parametrize("make", ["flexor_over_brim", "lifting_strap"])
def test_paths_of_a_muscle_without_fibres_come_to_rest(make):
    phantom = getattr(phantoms, make)()
    ((name, muscle),) = phantom.muscles.items()
    chain = MusclePipeline(muscle, phantom.bones, phantom.motion, phantom.attachments[name], fixing={})
    for time in phantom.motion.times[::9]:
        paths = chain.taut_paths.update(time=float(time)).output
        assert not field_array(paths, "Unsettled")[0]

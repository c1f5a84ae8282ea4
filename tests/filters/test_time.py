"""Paths and the muscle that they carry depend on the pose, and nothing is done without need."""

import functools

import numpy as np
import pytest
from filter_case import digest
from sequences import check_sequences

from vtkmuscle import filters
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.paths.pose import SheetPose
from vtkmuscle.core.paths.sheet import MusclePaths
from vtkmuscle.core.skinning import carried_muscle
from vtkmuscle.data.arrays import add_arrays, cell_array, points_of, surface_from, triangles_of
from vtkmuscle.filters import path_deformer, taut_paths
from vtkmuscle.phantoms import spindle_over_hinge

STEPS = (0.0, 10.0, 20.0, 30.0, 40.0)
PHANTOM = spindle_over_hinge()
MOTIONS = {
    "flexion": hinge("distal", (0.0, 0.0, 0.0), (1, 0, 0), STEPS),
    "oblique": hinge("distal", (0.0, -5.0, 5.0), (1, 0.2, 0), STEPS),
}


def spindle(width):
    """Return the phantom's muscle with its fixed points, narrower."""
    muscle = PHANTOM.muscles["spindle"]
    fixed = filters.FixedPointDetector()(muscle, PHANTOM.bones, PHANTOM.attachments["spindle"])
    surface = surface_from(points_of(muscle) * [width, 1.0, 1.0], triangles_of(muscle, "spindle"))
    add_arrays(surface, points={"FixedTo": np.array(fixed.GetPointData().GetArray("FixedTo"))})
    return surface


MUSCLES = {"round": spindle(1.0), "flat": spindle(0.7)}
#: What may change from one request to the next, with its values, the value of the first request first.
CHOICES = {
    "iterations": (2, 3),
    "resolution": (20, 24),
    "bone_clearance": (0.0, 1.0),
    "checkpoint_memory": (64.0, 0.1, 0.0),
    "levers": (True, False),
    "motion": tuple(MOTIONS),
    "muscle": tuple(MUSCLES),
}
FIRST = {name: values[0] for name, values in CHOICES.items()}
#: Largest difference of lengths, and of points of the surface, by what was asked before [mm].
LENGTHS, POINTS = 0.02, 0.1


def made(state):
    """Return the deformer of a new chain."""
    posed = {"rest_bones": PHANTOM.bones, "bones": filters.BoneMotion(bones=PHANTOM.bones)}
    deformer = filters.PathDeformer(paths=filters.TautPaths(**posed), **posed)
    for name, value in state.items():
        put(deformer, name, value)
    return deformer


def put(deformer, name, value):
    """Set a parameter of the deformer or its paths, or an input of both."""
    if name == "motion":
        deformer.bones.motion = MOTIONS[value]
    elif name == "muscle":
        deformer.muscle = deformer.paths.rest_muscle = MUSCLES[value]
    elif name in filters.PathDeformer.parameter_declarations:
        setattr(deformer, name, value)
    else:
        setattr(deformer.paths, name, value)


def frame(deformer, time):
    """Return the lengths of the paths and the points of the muscle."""
    points = points_of(deformer.update(time=time).output)
    return np.array(cell_array(deformer.paths.update(time=time).output, "Length", "paths")), points


def digests(deformer, time):
    return digest(deformer.update(time=time).output), digest(deformer.paths.update(time=time).output)


@functools.cache
def fresh_frame(state, time):
    """Return the frame of a new chain that is asked for nothing else."""
    return frame(made(dict(state)), time)


@pytest.mark.filterwarnings("ignore:.* is outside of the motion")
def test_any_sequence_of_times_and_changes_gives_the_frames_of_a_fresh_chain(request):
    times, examples = (*STEPS, -5.0, 15.0, 37.0, 50.0), 100 if request.config.getoption("long") else 8
    check_sequences(CHOICES, times, made, put, check_frame, examples=examples, longest=10)


def check_frame(deformer, state, time):
    expected = fresh_frame(tuple(state.items()), time)
    for found, fresh, most in zip(frame(deformer, time), expected, (LENGTHS, POINTS), strict=True):
        np.testing.assert_allclose(found, fresh, rtol=0.0, atol=most)
    assert digests(deformer, time) == digests(deformer, time)


def test_frames_that_were_asked_for_are_the_same_bit_for_bit_in_any_order():
    deformer = made(FIRST)
    first = {time: digests(deformer, time) for time in STEPS}
    for time in (*STEPS[::-1], STEPS[1], STEPS[4], STEPS[4], *STEPS[::2], *STEPS):
        assert digests(deformer, time) == first[time]


# ---------------------------------------------------------------- what a change invalidates


OF_PATHS, OF_MUSCLE = {"paths at rest"}, {"rest shape", "skinning", "settling"}
EVERY_FRAME = {"surface"}


@pytest.fixture
def work(noted):
    """Count what is made, and the frames."""
    done = []
    noted(taut_paths, "MusclePaths", "paths at rest", done)
    noted(carried_muscle, "RestShape", "rest shape", done)
    noted(carried_muscle, "Skinning", "skinning", done)
    noted(carried_muscle, "Settling", "settling", done)
    noted(MusclePaths, "follow", "paths", done)
    noted(path_deformer.CarriedMuscle, "pose", "surface", done)
    noted(SheetPose, "levers", "levers", done)
    return done


@pytest.mark.parametrize(
    ("name", "value", "redone"),
    [
        ("iterations", 3, EVERY_FRAME),
        ("bone_clearance", 0.5, OF_MUSCLE | EVERY_FRAME),
        ("resolution", 16, OF_PATHS | OF_MUSCLE | EVERY_FRAME | {"paths", "levers"}),
        ("motion", "oblique", EVERY_FRAME | {"paths", "levers"}),
        ("muscle", "flat", OF_PATHS | OF_MUSCLE | EVERY_FRAME | {"paths", "levers"}),
        ("measure_shape", True, set()),
        ("measure_penetration", True, set()),
    ],
)
def test_a_change_redoes_what_depends_on_it_and_nothing_else(work, name, value, redone):
    deformer = made(FIRST)
    frame(deformer, 20.0)
    assert set(work) == OF_PATHS | OF_MUSCLE | EVERY_FRAME | {"paths", "levers"}
    work.clear()
    put(deformer, name, value)
    frame(deformer, 20.0)
    assert set(work) == redone
    assert len(work) == len(redone), "nothing is done twice"


# ---------------------------------------------------------------- kept poses


@pytest.mark.parametrize(("memory", "kept"), [(64.0, True), (0.0, False)])
def test_poses_are_kept_within_their_memory(work, memory, kept):
    paths = made({**FIRST, "checkpoint_memory": memory}).paths
    for time in STEPS:
        paths.update(time=time)
    work.clear()
    for time in STEPS[:-1]:
        paths.update(time=time)
    assert work.count("paths") == (0 if kept else len(STEPS) - 1)


def test_the_last_pose_is_always_kept(work):
    paths = made({**FIRST, "checkpoint_memory": 0.0}).paths
    paths.update(time=20.0)
    work.clear()
    paths.levers = False
    paths.update(time=20.0)
    assert "paths" not in work

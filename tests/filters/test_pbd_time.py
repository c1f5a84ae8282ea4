"""A frame is the same whatever was asked for, and changed, before; and nothing is done twice without need."""

import functools
from types import SimpleNamespace

import numpy as np
import pytest
from filter_case import digest
from sequences import check_sequences
from test_pbd_deformer import bones, spindle

from vtkmuscle.core import fixed_muscle
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.pbd import solver, sweep, voxels
from vtkmuscle.filters.base.history import thin
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.pbd_deformer import PBDDeformer

STEPS = (0.0, 4.0, 8.0, 12.0, 16.0, 20.0)
MOTIONS = {
    "near": hinge("upper", (0.0, 25.0, 0.0), (1, 0, 0), STEPS),
    "far": hinge("upper", (0.0, 30.0, 5.0), (1, 0.2, 0), STEPS),
}
MUSCLES = {"thin": spindle(9.0), "thick": spindle(12.0)}
#: What may change from one request to the next, with the values it may have, the default first where that is
#: not too slow.
CHOICES = {
    "quality": ("balanced", "published"),
    "iterations": (2, 3),
    "collides": (True, False),
    "solved_triangles": (0, 200),
    "signed_angles": (True, False),
    "stiffness": (1.0, 0.7),
    "anisotropy": ("always", "off"),
    "bone_clearance": (0.0, 0.5),
    "contact_velocity": ("keep", "zero"),
    "n_voxels": (200, 400),
    "n_voxels_per_axis": (None, 8),
    "bone_push": ("transform", "off"),
    "checkpoint_memory": (256.0, 0.025, 0.01, 0.0),
    "motion": tuple(MOTIONS),
    "muscle": tuple(MUSCLES),
}
FIRST = {name: values[0] for name, values in CHOICES.items()}


def made(state):
    moving = BoneMotion(bones=bones())
    deformer = PBDDeformer(muscle=MUSCLES[state["muscle"]], rest_bones=bones(), bones=moving)
    for name, value in state.items():
        put(deformer, name, value)
    return deformer


def put(deformer, name, value):
    """Set a parameter of a deformer, or what it is fed with."""
    if name == "motion":
        deformer.GetInputAlgorithm(2, 0).motion = MOTIONS[value]
    elif name == "muscle":
        deformer.connect(0, MUSCLES[value])
    elif name == "collides":
        deformer.collision = ("voxel" if deformer.quality == "published" else "sdf") if value else "off"
    else:
        setattr(deformer, name, value)


def frame(deformer, time):
    return digest(deformer.update(time).output)


@functools.cache
def fresh_frame(state, time):
    """Return the frame that a new deformer gives that is asked for nothing else."""
    return frame(made(dict(state)), time)


@pytest.mark.filterwarnings("ignore:.* is outside of the motion")
def test_any_sequence_of_times_and_changes_gives_the_frames_of_a_fresh_run(request):
    times, examples = (*STEPS, -1.0, 6.0, 10.0, 19.0, 25.0), 200 if request.config.getoption("long") else 20
    check_sequences(CHOICES, times, made, put, check_frame, examples=examples, longest=12)


def check_frame(deformer, state, time):
    straight = {**state, "checkpoint_memory": FIRST["checkpoint_memory"]}
    assert frame(deformer, time) == fresh_frame(tuple(straight.items()), time)


# ---------------------------------------------------------------- what a change invalidates


#: What is made for a muscle: of one level, and without fibres.
OF_A_MUSCLE = {"topology", "rest shape", "fibre directions"}
#: Made where the muscle comes near the bones, as it does with momentum only.
GRIDS = {"balanced": set(), "published": {"voxels"}}


@pytest.fixture
def work(noted):
    """Count what is done: frames, and the things that are made for them."""
    voxels._GRIDS.clear()  # those of equal bones are shared
    done = []
    noted(fixed_muscle.surface, "mesh_topology", "topology", done)
    noted(solver, "RestShape", "rest shape", done)
    noted(sweep, "harmonic_directions", "fibre directions", done)
    noted(voxels, "build_voxel_grid", "voxels", done)
    noted(solver.PBDSolver, "step", "frames", done)
    return done


@pytest.mark.parametrize(
    ("quality", "name", "value", "redone"),
    [
        ("balanced", "iterations", 3, {"frames", "of muscle"}),
        ("balanced", "solved_triangles", 200, {"frames", "of muscle"}),
        ("balanced", "collides", False, {"frames", "of muscle"}),
        ("balanced", "bone_clearance", 0.5, {"frames", "of muscle"}),
        ("balanced", "motion", "far", {"frames"}),
        ("balanced", "muscle", "thin", {"frames", "of muscle"}),
        ("balanced", "checkpoint_memory", 0.0, set()),
        ("balanced", "stiffness", 0.7, {"frames", "of muscle"}),
        ("balanced", "external_force", (0.01, 0.0, 0.0), set()),
        ("balanced", "bone_push", "off", set()),
        ("balanced", "n_voxels", 400, set()),
        ("balanced", "measure_penetration", True, set()),
        ("published", "iterations", 3, {"frames", "of muscle"}),
        ("published", "velocity_kept", 0.5, {"frames", "of muscle"}),
        ("published", "motion", "far", {"frames"}),
        ("published", "muscle", "thin", {"frames", "of muscle"}),
        ("published", "n_voxels", 400, {"frames", "of muscle", "voxels"}),
        ("published", "bone_clearance", 0.5, set()),
        ("published", "checkpoint_memory", 0.0, set()),
    ],
)
def test_a_change_redoes_what_depends_on_it_and_nothing_else(work, quality, name, value, redone):
    deformer = made({**FIRST, "quality": quality, "muscle": "thick"})
    frame(deformer, 8.0)
    assert set(work) == {*OF_A_MUSCLE, *GRIDS[quality], "frames"}
    before = len(work)
    put(deformer, name, value)
    frame(deformer, 8.0)
    if "of muscle" in redone:
        redone = (redone - {"of muscle"}) | OF_A_MUSCLE
    assert set(work[before:]) == redone


# ---------------------------------------------------------------- checkpoints


def kept_after_a_straight_run(n_steps, room):
    checkpoints, steps = {}, [float(i) for i in range(n_steps)]
    for i in range(n_steps):
        checkpoints[steps[i]] = SimpleNamespace(nbytes=10)
        thin(checkpoints, steps, steps[: i + 1], 10.0 * room)
    return checkpoints, [step for step in steps if step in checkpoints]


@pytest.mark.parametrize("n_steps", [1, 2, 9, 64, 100])
@pytest.mark.parametrize("room", [0, 1, 4, 7, 100])
def test_checkpoints_keep_to_their_memory_and_bound_the_way_back(n_steps, room):
    checkpoints, kept = kept_after_a_straight_run(n_steps, room)
    last = {float(n_steps - 1), float(max(n_steps - 2, 0))}
    assert last <= set(kept)
    assert len(set(kept) - last) <= room
    assert len(checkpoints) == len(kept)
    if room:
        assert 0.0 in kept
        assert np.diff(kept, append=n_steps).max() <= max(1.0, 2.0 * n_steps / room)

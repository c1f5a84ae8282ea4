"""Bones and motions that go wrong: a finite result, and a warning that says what was seen in which bone."""

import re
import warnings

import numpy as np
import pytest
from test_pbd_deformer import spindle

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data import arrays
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.path_deformer import PathDeformer
from vtkmuscle.filters.taut_paths import TautPaths
from vtkmuscle.phantoms.meshing import box


def muscle():
    """Return the spindle of position based dynamics, its lower end fixed to bone 0."""
    surface = spindle()
    marks = np.minimum(arrays.point_array(surface, "FixedTo", ""), 0)
    upper = arrays.points_of(surface)[:, 2] > 0
    return arrays.add_arrays(surface, points={"FixedTo": np.where(upper, -1, marks).astype(np.int32)})


def joined(*shapes):
    offsets = np.cumsum([0] + [len(points) for points, _ in shapes])
    triangles = [shape[1] + offset for shape, offset in zip(shapes, offsets, strict=False)]
    return np.vstack([points for points, _ in shapes]), np.vstack(triangles)


def moved(*translation):
    transform = np.eye(4)
    transform[:3, 3] = translation
    return transform


BAR = box([-40, 14, 0], [40, 24, 10], 80.0)  # beside the muscle, along x
ANCHOR = box([-5, -5, -80], [5, 5, -60], 80.0)


def deformed(bar, path):
    """Return the muscle after the bone ``bar`` went along a path of transforms, and the bones with it."""
    bones = arrays.multiblock_from({"anchor": arrays.surface_from(*ANCHOR), "bar": arrays.surface_from(*bar)})
    motion = RigidMotion(np.arange(float(len(path))), {"bar": np.array(path)})
    posed = {"rest_bones": bones, "bones": BoneMotion(bones=bones, motion=motion)}
    paths = TautPaths(rest_muscle=muscle(), **posed)
    deformer = PathDeformer(muscle=muscle(), paths=paths, measure_shape=True, **posed)
    out = deformer.update(time=float(len(path) - 1)).output
    for name in ("VolumeRatio", "EdgeStretchMax"):
        assert np.isfinite(arrays.field_array(out, name)).all()
    assert np.isfinite(arrays.points_of(out)).all()
    return out


def press(steps=4, way=-8.0):
    """Return the path of a bone that is pressed into the muscle."""
    return [moved(0.0, way * k / steps, 0.0) for k in range(steps + 1)]


def free_points(out):
    return arrays.points_of(out)[arrays.point_array(out, "FixedTo", "") < 0]


def depth_in_bar(points, transform=None):
    at_rest = points if transform is None else points - transform[:3, 3]
    low, high = BAR[0].min(axis=0), BAR[0].max(axis=0)
    return float(np.minimum(at_rest - low, high - at_rest).min(axis=1).max())


def test_a_bone_that_jumps_through_the_muscle_leaves_it_as_the_pose_has_it():
    """What a bone did on its way is no matter of the pose."""
    out = deformed(BAR, [moved(0, 0, 0), moved(0, -200.0, 0)])
    assert np.abs(arrays.point_array(out, "Displacement", "")).max() < 1e-6


def test_a_muscle_that_a_bone_drops_over_comes_out_again():
    out = deformed(box([-60, 100, -60], [60, 220, 60], 120.0), [moved(0, 0, 0), moved(0, -160, 0)])
    assert (np.abs(free_points(out)) >= 59.9).any(axis=1).mean() > 0.99


def test_a_muscle_in_a_bone_at_rest_stays_and_that_is_told():
    block = box([-60, -60, -60], [60, 60, 60], 120.0)
    with pytest.warns(UserWarning, match=r"'bar': \d+ of the muscle's \d+ free points are inside"):
        out = deformed(block, [moved(0, 0, 0)])
    assert np.abs(arrays.point_array(out, "Displacement", "")).max() < 1e-6


FAULTS = {
    "open": ((BAR[0], BAR[1][1:]), r"block 'bar': the surface is open: 1 hole\(s\), 3 edges, were closed"),
    "inside out": ((BAR[0], BAR[1][:, ::-1]), r"block 'bar': the surface is inside out"),
    "one turned": (
        (BAR[0], np.vstack([BAR[1][:1, ::-1], BAR[1][1:]])),
        r"block 'bar': 1 of 12 triangles faced the opposite side",
    ),
    "two overlapping": (joined(BAR, box([-30, 16, -5], [30, 30, 5], 80.0)), None),
    "a speck out of reach": (joined(BAR, box([-1, 90, 90], [1, 91, 91], 80.0)), None),
    "one in the other": (joined(BAR, box([-30, 16, 2], [30, 22, 8], 80.0)), None),
    "5 mm off with a fin": (
        (np.vstack([BAR[0], [[0.0, 50, 5]]]), np.vstack([BAR[1], [[0, 1, 8]]])),
        r"block 'bar': the surface is open",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bone_that_is_not_as_it_should_be(fault):
    bone, told = FAULTS[fault]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        out = deformed(bone, press())
    messages = [str(w.message) for w in caught]
    assert (messages == []) == (told is None)
    assert all(re.search(told, message) for message in messages)
    assert arrays.field_array(out, "CollidingPoints")[0] > 0
    if fault != "5 mm off with a fin":
        assert depth_in_bar(free_points(out), press()[-1]) <= 0.1  # as from the bone in good order

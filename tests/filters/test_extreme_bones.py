"""Bones and motions that go wrong: a finite result, and a warning that says what was seen in which bone."""

import re
import warnings

import numpy as np
import pytest
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import (
    field_array,
    multiblock_from,
    point_array,
    points_of,
    set_point_array,
    surface_from,
    with_points,
)
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.path_deformer import PathDeformer
from vtkmuscle.filters.taut_paths import TautPaths


def muscle():
    """Return an ellipsoid along z, 100 mm long and 24 mm thick, its lower end fixed to bone 0."""
    source = vtkSphereSource(radius=0.5, theta_resolution=12, phi_resolution=14)
    source.SetOutputPointsPrecision(vtkAlgorithm.DOUBLE_PRECISION)
    source.Update()
    source.GetOutput().GetPointData().Initialize()
    points = points_of(source.GetOutput()) * [24.0, 24.0, 100.0]
    surface = with_points(source.GetOutput(), points)
    set_point_array(surface, "FixedTo", np.where(points[:, 2] < -40, 0, -1).astype(np.int32))
    return surface


def box(low, high):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    return np.asarray(low) + corners * (np.asarray(high) - np.asarray(low)), triangles


def joined(*shapes):
    offsets = np.cumsum([0] + [len(points) for points, _ in shapes])
    triangles = [shape[1] + offset for shape, offset in zip(shapes, offsets, strict=False)]
    return np.vstack([points for points, _ in shapes]), np.vstack(triangles)


def moved(*translation):
    transform = np.eye(4)
    transform[:3, 3] = translation
    return transform


BAR = box([-40, 14, 0], [40, 24, 10])  # beside the muscle, along x
ANCHOR = box([-5, -5, -80], [5, 5, -60])


def deformed(bar, path, *, more=(), **settings):
    """Return the muscle after the bone ``bar`` went along a path of transforms, and the bones with it."""
    blocks = {"anchor": surface_from(*ANCHOR), "bar": surface_from(*bar)}
    blocks.update({f"more {k}": surface_from(*bone) for k, bone in enumerate(more)})
    bones = multiblock_from(blocks)
    motion = RigidMotion(np.arange(float(len(path))), {"bar": np.array(path)})
    posed = {"rest_bones": bones, "bones": BoneMotion(bones=bones, motion=motion)}
    paths = TautPaths(rest_muscle=muscle(), **posed)
    deformer = PathDeformer(muscle=muscle(), paths=paths, measure_shape=True, **posed, **settings)
    out = deformer.update(time=float(len(path) - 1)).output
    for name in ("VolumeRatio", "EdgeStretchMax"):
        assert np.isfinite(field_array(out, name)).all()
    assert np.isfinite(points_of(out)).all()
    return out


def press(steps=4, way=-8.0):
    """Return the path of a bone that is pressed into the muscle."""
    return [moved(0.0, way * k / steps, 0.0) for k in range(steps + 1)]


def free_points(out):
    return points_of(out)[point_array(out, "FixedTo", "") < 0]


def depth_in_bar(points, transform=None):
    at_rest = points if transform is None else points - transform[:3, 3]
    low, high = BAR[0].min(axis=0), BAR[0].max(axis=0)
    return float(np.minimum(at_rest - low, high - at_rest).min(axis=1).max())


def test_a_bone_that_jumps_through_the_muscle_leaves_it_as_the_pose_has_it():
    """What a bone did on its way is no matter of the pose."""
    out = deformed(BAR, [moved(0, 0, 0), moved(0, -200.0, 0)])
    assert np.abs(point_array(out, "Displacement", "")).max() < 1e-6


def test_a_muscle_that_a_bone_drops_over_comes_out_again():
    block = box([-60, 100, -60], [60, 220, 60])
    out = deformed(block, [moved(0, 0, 0), moved(0, -160, 0)])
    assert (np.abs(free_points(out)) >= 59.9).any(axis=1).mean() > 0.99


def test_a_muscle_in_a_bone_at_rest_stays_and_that_is_told():
    block = box([-60, -60, -60], [60, 60, 60])
    with pytest.warns(UserWarning, match=r"'bar': \d+ of the muscle's \d+ free points are inside"):
        out = deformed(block, [moved(0, 0, 0)])
    assert np.abs(point_array(out, "Displacement", "")).max() < 1e-6


FAULTS = {
    "open": ((BAR[0], BAR[1][1:]), r"block 'bar': the surface is open: 1 hole\(s\), 3 edges, were closed"),
    "inside out": ((BAR[0], BAR[1][:, ::-1]), r"block 'bar': the surface is inside out"),
    "one turned": (
        (BAR[0], np.vstack([BAR[1][:1, ::-1], BAR[1][1:]])),
        r"block 'bar': 1 of 12 triangles faced the opposite side",
    ),
    "two overlapping": (joined(BAR, box([-30, 16, -5], [30, 30, 5])), None),
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
    assert field_array(out, "CollidingPoints")[0] > 0
    if fault != "5 mm off with a fin":
        assert depth_in_bar(free_points(out), press()[-1]) <= 0.1  # as from the bone in good order

import numpy as np
import pytest
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle import Scene
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import edge_lengths, unique_edges
from vtkmuscle.data.arrays import checked_surface, multiblock_from, point_array, points_of
from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector


def ball(centre, radius):
    source = vtkSphereSource(center=centre, radius=radius, theta_resolution=60, phi_resolution=40)
    return source.update().output


def ring(z, radius):
    angle = 2 * np.pi * np.arange(16) / 16
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(16, z)])


MUSCLE = ball((0.0, 0.0, 0.0), 20.0)
#: The muscle dips into the lower bone, touches the upper one nearly, and is far from the third.
BONES = multiblock_from(
    {"far": ball((200, 0, 0), 5), "lower": ball((0, 0, -28), 10), "upper": ball((0, 0, 30.2), 10)}
)
CURVE = AttachmentArea("insertion", "lower", np.array([[x, 0.0, -21.0] for x in (-5, 0, 5)]), closed=False)
ATTACHMENTS = attachments_from([AttachmentArea("origin", "upper", ring(21.0, 8.0), closed=True), CURVE])
MORE = "iliacus", "gluteus_maximus", "adductor_brevis"


def detect(method, *, attachments=None, muscle=MUSCLE, bones=BONES, **parameters):
    fixed = FixedPointDetector(method=method, **parameters)(muscle, bones, attachments)
    return point_array(fixed, "FixedTo", "test")


def test_attachments_fix_what_their_landmarks_enclose_and_what_is_near_their_curves():
    fixed_to = detect("attachment", attachments=ATTACHMENTS)
    points = points_of(MUSCLE)
    assert fixed_to.dtype == np.int32
    assert set(fixed_to) == {-1, 1, 2}
    aside = np.hypot(points[:, 0], points[:, 1])
    assert (fixed_to[(aside < 6.0) & (points[:, 2] > 0)] == 2).all()
    assert (aside[fixed_to == 2] < 9.0).all()
    assert (points[fixed_to == 2, 2] > 0).all()
    lower = points[fixed_to == 1]
    assert (lower[:, 2] < 0).all()
    assert (np.abs(lower[:, 1]) <= 2 * mean_edge_length()).all()
    assert np.ptp(lower[:, 0]) > 8.0


def mean_edge_length():
    points, triangles = checked_surface(MUSCLE, "test")
    return edge_lengths(points, unique_edges(triangles)).mean()


@pytest.mark.parametrize("tolerance", [None, 1.0, 3.0])
def test_proximity_fixes_the_points_within_the_tolerance_of_the_nearest_bone(tolerance):
    fixed_to = detect("proximity", distance=tolerance)
    limit = mean_edge_length() if tolerance is None else tolerance
    bones = [solids_of(*checked_surface(BONES.GetBlock(i), "test")) for i in range(3)]
    distances = np.abs([bone.distances(points_of(MUSCLE)) for bone in bones])
    expected = np.where(distances.min(axis=0) <= limit, distances.argmin(axis=0), -1)
    np.testing.assert_array_equal(fixed_to, expected)
    assert set(fixed_to) == {-1, 1, 2}


def test_collision_fixes_the_points_in_the_voxels_of_a_bone():
    fixed_to, points = detect("collision", n_voxels=100_000), points_of(MUSCLE)
    bone = solids_of(*checked_surface(BONES.GetBlock(1), "test"))
    inside = bone.depth(points) > 0
    assert inside.sum() > 50
    assert (fixed_to[inside] == 1).all()
    assert (inside | (np.abs(bone.distances(points)) <= 1.05 * (20.0 / 46 * 3**0.5)))[fixed_to == 1].all()
    assert not (fixed_to == 0).any()


def test_the_numbers_are_those_of_the_blocks():
    swapped = multiblock_from(
        {name: BONES.GetBlock(i) for name, i in (("upper", 2), ("far", 0), ("lower", 1))}
    )
    renumbered = np.array([1, 2, 0, -1])  # far, lower, upper, free
    for method in ("attachment", "proximity", "collision"):
        before = detect(method, attachments=ATTACHMENTS)
        after = detect(method, attachments=ATTACHMENTS, bones=swapped)
        np.testing.assert_array_equal(after, renumbered[before])


def rings(*ends):
    areas = [AttachmentArea(role, bone, ring(z, 5.0), closed=True) for role, bone, z in ends]
    return {"attachments": attachments_from(areas)}


AWAY = {"muscle": ball((60.0, 60.0, 0.0), 20.0)}


@pytest.mark.parametrize(
    ("method", "inputs", "message"),
    [
        ("attachment", {}, "needs attachments; connect attachments"),
        (
            "attachment",
            rings(("origin", "tibia", 20.0)),
            r"area 0 \(origin on 'tibia'\): the bones are 'far', 'lower', 'upper'",
        ),
        (
            "attachment",
            rings(("origin", "upper", 20.0), ("insertion", "lower", 320.0)),
            r"area 1 \(insertion on 'lower'\): landmark \d+ is .* from the muscle",
        ),
        ("proximity", AWAY, "larger distance"),
        ("collision", AWAY, "lower n_voxels"),
    ],
)
def test_a_muscle_without_fixed_points_is_refused(method, inputs, message):
    with pytest.raises(ValueError, match=message):
        detect(method, **inputs)


@pytest.mark.realdata
@pytest.mark.parametrize("name", ["gluteus_medius", *(pytest.param(x, marks=pytest.mark.long) for x in MORE)])
def test_patches_of_a_real_muscle_are_as_large_as_their_rings_and_face_the_bone(lhdl_hip, name):
    """Area between 0.8 and 1.2 of the ring's; on every patch muscle and bone face each other."""
    scene = Scene.load(lhdl_hip / "scene.toml")
    muscle = scene.muscles[name]
    points, triangles = checked_surface(muscle.surface, name)
    normals = triangle_normals(points, triangles)
    areas = np.linalg.norm(normals, axis=1) / 2
    for number, area in enumerate(muscle.attachments):
        inputs = {"bones": scene.bones_data(), "attachments": attachments_from([area])}
        fixed_to = detect("attachment", muscle=muscle.surface, **inputs)
        patch = (fixed_to[triangles] >= 0).all(axis=1)
        arms = area.landmarks - area.landmarks.mean(axis=0)
        ring = np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)) / 2
        if area.closed:
            assert 0.8 < areas[patch].sum() / ring < 1.2, number
        middles = points[triangles[patch]].mean(axis=1)
        units = normals[patch] / np.linalg.norm(normals[patch], axis=1, keepdims=True)
        distance = solids_of(*checked_surface(scene.bones[area.bone], "test")).distances
        slope = (distance(middles + 0.1 * units) - distance(middles)) / 0.1
        # What is near a curve along a rim, as that of the iliacus, goes round the rim.
        assert np.average(slope < 0, weights=areas[patch]) > (0.98 if area.closed else 0.8), number
